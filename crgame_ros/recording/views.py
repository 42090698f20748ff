# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What drivers' views showed where, and a summary of the views and sounds of their seats."""

from collections import defaultdict
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
import re
import statistics
from typing import NamedTuple

from crgame_ros.game.documents import VEHICLE_ID
from crgame_ros.game.view_documents import VIEW_PICTURE, ViewEye, ViewPicture, ViewPlace
from crgame_ros.messages.status_values import Status, status_amount, status_truth
from crgame_ros.recording.reader import BagReader
import numpy as np
from numpy.typing import NDArray

_SOUND_NAME, _VIEW_NAME = (
    re.compile(f'cockpit_node: ({VEHICLE_ID.pattern}) {what}') for what in ('sound', 'view'))
FloatArray = NDArray[np.float64]


class SeatSound:
    """A summary of each seat's sound statuses, which come once a second and at each change."""

    def __init__(self) -> None:
        self._told: dict[str, list[tuple[bool, float, float]]] = {}

    def add(self, status: Status) -> None:
        """Process a status; ignore other statuses and those without shares."""
        found = _SOUND_NAME.fullmatch(status.name)
        volume, rumble = (status_amount(status.values, name) for name in ('volume', 'rumble'))
        if found is not None and volume is not None and rumble is not None \
                and max(volume, rumble) <= 1.0:
            told = (status_truth(status.values, 'on'), volume, rumble)
            self._told.setdefault(found[1], []).append(told)

    def as_dict(self) -> Mapping[str, Mapping[str, object]]:
        """
        Return by seat: the share of statuses with sound on, the median volume then, and rumble.

        :return: `on_share`, `volume` (null if it was never on) and `rumble`, each 0 to 1.
        """
        summary = {}
        for seat, told in sorted(self._told.items()):
            volumes = [volume for on, volume, _ in told if on]
            summary[seat] = {
                'on_share': round(len(volumes) / len(told), 3),
                'volume': statistics.median(volumes) if volumes else None,
                'rumble': statistics.median(rumble for _, _, rumble in told)}
        return summary


_SHOWN = ('map', 'driver', 'chase', 'bird')
_FLAGS = ('inset', 'plans', 'mirrors', 'bare', 'software')
_MEASURES = ('across_deg', 'screen_width_m', 'eye_distance_m', 'width_px', 'height_px')


class _Told(NamedTuple):
    time_s: float
    # The values by key; a change of one begins a new period.
    choice: Mapping[str, object]
    ratio: float | None
    rate_hz: float | None


class ViewPeriods:
    """A summary of each seat's view statuses, which come once a second and at each change."""

    def __init__(self) -> None:
        self._told: dict[str, list[_Told]] = {}

    def add(self, status: Status, time_s: float) -> None:
        """
        Process a status; ignore other statuses and those of pages that have not reported yet.

        :param time_s: of the run's clock [s]
        """
        found = _VIEW_NAME.fullmatch(status.name)
        values = status.values
        if found is None or values.get('shown') not in _SHOWN:
            return
        choice = {
            'shown': values['shown'], **{key: status_truth(values, key) for key in _FLAGS},
            **{key: status_amount(values, key) for key in _MEASURES},
            'renderer': values.get('renderer', '')}
        self._told.setdefault(found[1], []).append(
            _Told(time_s, choice, status_amount(values, 'ratio'),
                  status_amount(values, 'rate_hz')))

    def as_dict(self) -> dict[str, list[dict[str, object]]]:
        """
        Return by seat the periods with an unchanged view.

        :return: for each period `from_s` and `to_s` on the run's clock (`to_s` is the next
            period's start, or the last status), the choices, and medians of `ratio` and `rate_hz`.
        """
        return {seat: list(_periods(told)) for seat, told in sorted(self._told.items())}


def _periods(told: list[_Told]) -> Iterable[dict[str, object]]:
    first = 0
    for last in range(1, len(told) + 1):
        if last < len(told) and told[last].choice == told[first].choice:
            continue
        within = told[first:last]
        yield {'from_s': round(within[0].time_s, 3),
               'to_s': round(told[min(last, len(told) - 1)].time_s, 3), **within[0].choice,
               'ratio': _median(item.ratio for item in within),
               'rate_hz': _median(item.rate_hz for item in within)}
        first = last


def _median(values: Iterable[float | None]) -> float | None:
    known = [value for value in values if value is not None]
    return round(statistics.median(known), 3) if known else None


class ShownName(NamedTuple):
    """
    What is shown, and where.

    :param kind: of thing.
    :param id: of it.
    :param mirror: in which it is seen; None for none.
    """

    kind: str
    id: str  # noqa: A003
    mirror: str | None


@dataclass(frozen=True)
class SeatPictures:
    """
    The pictures of one driver's view (P), and all that was in them (N).

    :param times_s: (P) when they were drawn, increasing, on the steady clock [s]
    :param places: (P, 7) of the view on the screen, as in `ViewPlace`
    :param eyes: (P, 7) as in `ViewEye`
    :param starts: (P + 1) the rows of picture p are those from starts[p] to starts[p + 1].
    :param names: what there was.
    :param things: (N) numbers of names.
    :param boxes: (N, 4) left, top, right and bottom, in shares of the view
    :param distances: (N) from the eye; NaN of what lies over the view [m]
    """

    times_s: FloatArray
    places: FloatArray
    eyes: FloatArray
    starts: NDArray[np.int64]
    names: tuple[ShownName, ...]
    things: NDArray[np.int64]
    boxes: FloatArray
    distances: FloatArray


class PictureKeeper:
    """The pictures of one seat while they are read: numbers alone, as a drive has many."""

    def __init__(self) -> None:
        self._numbers: dict[ShownName, int] = {}
        self._pictures: dict[float, tuple[ViewPlace, ViewEye, FloatArray]] = {}

    def add(self, picture: ViewPicture) -> None:
        """Keep a picture; of two at the same time, the first."""
        rows = [(self._numbers.setdefault(ShownName(thing.kind, thing.id, thing.mirror),
                                          len(self._numbers)),
                 thing.left, thing.top, thing.right, thing.bottom, thing.distance_m)
                for thing in picture.shown]
        self._pictures.setdefault(picture.steady_s, (
            picture.place, picture.eye, np.array(rows, dtype=np.float64).reshape(-1, 6)))

    def kept(self) -> SeatPictures:
        """Return all of them; one or more."""
        times_s = sorted(self._pictures)
        places, eyes, parts = zip(*(self._pictures[at_s] for at_s in times_s), strict=True)
        rows = np.concatenate(parts)
        return SeatPictures(
            np.array(times_s), np.array(places), np.array(eyes),
            np.cumsum([0, *map(len, parts)]), tuple(self._numbers), rows[:, 0].astype(np.int64),
            rows[:, 1:5], rows[:, 5])


def read_pictures(path: Path, epoch: int) -> dict[str, SeatPictures]:
    """
    Read the pictures of a run by seat; empty if none were recorded.

    :raises InputError: if the recording cannot be read.
    """
    found: dict[str, PictureKeeper] = defaultdict(PictureKeeper)
    with BagReader(path, parts=True) as reader:
        for _, picture in reader.documents(VIEW_PICTURE):
            if picture.epoch == epoch:
                found[picture.seat].add(picture)
    return {seat: keeper.kept() for seat, keeper in found.items()}
