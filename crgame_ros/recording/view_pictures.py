# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Reads from a recording what drivers' views showed where."""

from collections import defaultdict
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from crgame_ros.errors import InputError
from crgame_ros.game.view_documents import VIEW_PICTURE, ViewEye, ViewPicture, ViewPlace
from crgame_ros.recording.reader import BagReader
import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


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
        if VIEW_PICTURE.topic not in reader.topics:
            return {}
        for topic, _, _, message in reader.readable([VIEW_PICTURE.topic]):
            try:
                picture = VIEW_PICTURE.read(str(message.data))
            except (InputError, AttributeError):
                # The message may come from a foreign publisher.
                reader.foreign[topic] += 1
                continue
            if picture.epoch == epoch:
                found[picture.seat].add(picture)
    return {seat: keeper.kept() for seat, keeper in found.items()}
