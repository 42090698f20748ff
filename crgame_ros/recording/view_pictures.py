# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Reads from a recording what drivers' views showed where."""

from collections import defaultdict
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple, Self

from crgame_ros.errors import InputError
from crgame_ros.game.view_documents import ShownThing, VIEW_PICTURE, ViewPicture
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

    @classmethod
    def of(cls, pictures: list[ViewPicture]) -> Self:
        """Return some pictures of one seat, given in any order; one or more."""
        times_s, first = np.unique([item.steady_s for item in pictures], return_index=True)
        ordered = [pictures[place] for place in first]
        numbers: dict[ShownName, int] = {}
        shown = [thing for item in ordered for thing in item.shown]
        things = [numbers.setdefault(_name_of(thing), len(numbers)) for thing in shown]
        return cls(
            times_s, np.array([item.place for item in ordered]),
            np.array([item.eye for item in ordered]),
            np.cumsum([0, *(len(item.shown) for item in ordered)]), tuple(numbers),
            np.array(things, dtype=np.int64),
            np.array([thing[2:6] for thing in shown]).reshape(-1, 4),
            np.array([thing.distance_m for thing in shown], dtype=np.float64))


def _name_of(thing: ShownThing) -> ShownName:
    return ShownName(thing.kind, thing.id, thing.mirror)


def read_pictures(path: Path, epoch: int) -> dict[str, SeatPictures]:
    """
    Read the pictures of a run by seat; empty if none were recorded.

    :raises InputError: if the recording cannot be read.
    """
    found: dict[str, list[ViewPicture]] = defaultdict(list)
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
                found[picture.seat].append(picture)
    return {seat: SeatPictures.of(pictures) for seat, pictures in found.items()}
