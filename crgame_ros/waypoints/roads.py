# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A road network of way-point lanes (FS II-A1), and its tables as CSV files."""

from collections.abc import Collection, Mapping
import csv
from dataclasses import dataclass, replace
from functools import cached_property
import io
import math
from pathlib import Path
from typing import NamedTuple, TextIO

from crgame_ros.errors import InputError, short
from crgame_ros.roads.network import RoadNetwork
from crgame_ros.waypoints.lanelets import lanelet_waypoints
from crgame_ros.waypoints.waypoints import CurveIndex, CurvePieces, Interpolation, WaypointLane
from crgame_ros.whole_file import write_text
import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

# Published maps contain successors that start elsewhere, even the lanelet itself [m].
MAX_GAP = 1.0
MAX_BYTES = 32 << 20
MAX_ROWS = 1_000_000
_NUMBERS = ('x', 'y', 'width', 'speed_limit')
_LISTS = ('successors', 'predecessors')
_SINGLE = ('left', 'right', 'oncoming_left', 'oncoming_right')
_MAX_ID = 2**63 - 1


@dataclass(frozen=True)
class LaneLinks:
    """
    The lanes around one lane, by their ids.

    :param successors: lanes that begin at its end.
    :param predecessors: lanes that end at its start.
    :param left: neighbour with the same direction; None without one.
    :param right: likewise.
    :param oncoming_left: neighbour with the opposite direction; None without one.
    :param oncoming_right: likewise.
    """

    successors: tuple[int, ...] = ()
    predecessors: tuple[int, ...] = ()
    left: int | None = None
    right: int | None = None
    oncoming_left: int | None = None
    oncoming_right: int | None = None

    @property
    def named(self) -> tuple[int, ...]:
        """Return all lanes in the links."""
        return (*self.successors, *self.predecessors, *self.beside)

    @property
    def beside(self) -> tuple[int, ...]:
        """Return the neighbours."""
        return tuple(lane for name in _SINGLE if (lane := getattr(self, name)) is not None)

    def only(self, lane_ids: Collection[int]) -> 'LaneLinks':
        """Return the links without other lanes."""
        return LaneLinks(
            tuple(x for x in self.successors if x in lane_ids),
            tuple(x for x in self.predecessors if x in lane_ids),
            *(x if x in lane_ids else None for x in (
                self.left, self.right, self.oncoming_left, self.oncoming_right)))


class NearestLanes(NamedTuple):
    """
    The nearest lanes of N points, each (N,).

    :param lane: ids.
    :param s: stations in [0, length] [m]
    :param d: offsets to the left of the lane's centre line [m]
    :param distance: distances to the lane's centre line [m]; |d| unless the nearest point is an
        end.
    """

    lane: NDArray[np.int64]
    s: FloatArray
    d: FloatArray
    distance: FloatArray


class WaypointRoads:
    """
    Way-point lanes and their connections.

    :param lanes: by id; one at least.
    :param links: by id; a lane without an entry has none.
    :raises InputError: if there is no lane, or a link names one that does not exist.
    """

    def __init__(self, lanes: Mapping[int, WaypointLane], links: Mapping[int, LaneLinks]) -> None:
        if not lanes:
            raise InputError('there is no lane', 'way-point roads', 'give one at least')
        self._lanes = dict(lanes)
        self._links = {lane: links.get(lane, LaneLinks()) for lane in lanes}
        for lane, near in links.items():
            for other in (lane, *near.named):
                if other not in self._lanes:
                    raise InputError(f'lane {lane} is linked with lane {other}, which does not '
                                     'exist', 'way-point roads', 'name lanes that are there')

    @classmethod
    def from_lanelets(cls, network: RoadNetwork,
                      kinds: Mapping[str, Interpolation] | None = None) -> 'WaypointRoads':
        """
        Derive the lanes from lanelets; their ids are the lanelets'.

        Positions and widths come from the bounds, and limits from the traffic signs. Links are
        the lanelets' own, without those to missing lanelets, and without successors and
        predecessors with a gap of more than 1 m (`MAX_GAP`).
        """
        lanes = {lanelet: WaypointLane.from_rows(lanelet_waypoints(network, lanelet), kinds)
                 for lanelet in network.lanelet_ids}
        return cls(lanes, {lanelet: _lanelet_links(network, lanelet, lanes) for lanelet in lanes})

    @classmethod
    def from_csv(cls, path: Path,
                 kinds: Mapping[str, Interpolation] | None = None) -> 'WaypointRoads':
        """
        Read lanes from a table of way-points; docs/roads.md documents its columns.

        :raises InputError: naming the file and the line.
        """
        rows = _read_lane_rows(path)
        lanes, links = {}, {}
        for lane, entry in rows.items():
            try:
                lanes[lane] = WaypointLane.from_rows(np.array(entry.points), kinds)
            except InputError as error:
                raise InputError(error.what, f'{path}, line {entry.line}, lane {lane}',
                                 error.remedy) from error
            links[lane] = entry.links
            missing = [other for other in links[lane].named if other not in rows]
            if missing:
                raise InputError(f'lane {lane} is linked with lane {missing[0]}, which does not '
                                 'exist', f'{path}, line {entry.line}', 'name lanes of the file')
        if not any(near.predecessors for near in links.values()):
            links = _with_predecessors(links)
        return cls(lanes, links)

    def to_csv(self, path: Path) -> None:
        """
        Write the way-points so that `from_csv` gives the same roads to the last bit.

        :raises InputError: if the file cannot be written.
        """
        text = io.StringIO()
        writer = csv.writer(text, lineterminator='\n')
        writer.writerow(('lane', *_NUMBERS, *_LISTS, *_SINGLE))
        for lane, road in self._lanes.items():
            near = self._links[lane]
            links = [' '.join(map(str, getattr(near, name))) for name in _LISTS]
            links += ['' if (beside := getattr(near, name)) is None else str(beside)
                      for name in _SINGLE]
            for row in road.rows.tolist():
                limit = row[3] if math.isfinite(row[3]) else ''
                writer.writerow((lane, *row[:3], limit, *links))
                links = [''] * len(links)
        write_text(text.getvalue(), path)

    def only(self, lane_ids: Collection[int]) -> 'WaypointRoads':
        """
        Return the roads of some lanes, with the links between these.

        :raises InputError: if none of them exists.
        """
        kept = {lane: None for lane in self._lanes if lane in lane_ids}
        return WaypointRoads({lane: self._lanes[lane] for lane in kept},
                             {lane: self._links[lane].only(kept) for lane in kept})

    @property
    def lane_ids(self) -> tuple[int, ...]:
        """Return the ids of all lanes."""
        return tuple(self._lanes)

    def lane(self, lane_id: int) -> WaypointLane:
        """
        Return a lane.

        :raises InputError: if it does not exist.
        """
        if lane_id not in self._lanes:
            raise InputError(f'there is no lane {lane_id}', 'way-point roads', 'name another')
        return self._lanes[lane_id]

    def links(self, lane_id: int) -> LaneLinks:
        """Return the lanes around a lane."""
        self.lane(lane_id)
        return self._links[lane_id]

    def successors(self, lane_id: int) -> tuple[int, ...]:
        """Return the lanes that begin at the end of a lane."""
        return self.links(lane_id).successors

    def predecessors(self, lane_id: int) -> tuple[int, ...]:
        """Return the lanes that end at the start of a lane."""
        return self.links(lane_id).predecessors

    def left(self, lane_id: int) -> int | None:
        """Return the left neighbour with the same direction; None without one."""
        return self.links(lane_id).left

    def right(self, lane_id: int) -> int | None:
        """Return the right neighbour with the same direction; None without one."""
        return self.links(lane_id).right

    def nearest(self, points: FloatArray) -> NearestLanes:
        """
        Find the lane whose centre line is nearest to each of many points, in any direction.

        :param points: (N, 2) [m]; O(log of all way-points) each.
        """
        ids, index = self._index
        found = index.nearest(np.asarray(points, dtype=np.float64))
        return NearestLanes(ids[found.curve], found.s, found.d, found.distance)

    @cached_property
    def _index(self) -> tuple[NDArray[np.int64], CurveIndex]:
        pieces = [lane.pieces for lane in self._lanes.values()]
        return np.array(self.lane_ids), CurveIndex(CurvePieces(
            np.concatenate([part.coefficients for part in pieces], axis=1),
            np.concatenate([part.start for part in pieces]),
            np.concatenate([part.length for part in pieces]),
            np.repeat(np.arange(len(pieces)), [len(part.start) for part in pieces])))


def _lanelet_links(network: RoadNetwork, lanelet_id: int,
                   known: Mapping[int, WaypointLane]) -> LaneLinks:
    lanelet = network.lanelet_network.find_lanelet_by_id(lanelet_id)
    own = network.line(lanelet_id).points

    def touching(others: list[int], end: int) -> tuple[int, ...]:
        return tuple(int(other) for other in others if other in known and other != lanelet_id
                     and np.hypot(*(network.line(other).points[-1 - end] - own[end])) <= MAX_GAP)

    def beside(other: int | None, same: bool | None, wanted: bool) -> int | None:
        return other if other is not None and other in known and bool(same) is wanted else None

    left = (lanelet.adj_left, lanelet.adj_left_same_direction)
    right = (lanelet.adj_right, lanelet.adj_right_same_direction)
    return LaneLinks(touching(lanelet.successor, -1), touching(lanelet.predecessor, 0),
                     beside(*left, True), beside(*right, True),
                     beside(*left, False), beside(*right, False))


def _with_predecessors(links: Mapping[int, LaneLinks]) -> dict[int, LaneLinks]:
    before: dict[int, list[int]] = {lane: [] for lane in links}
    for lane, near in links.items():
        for other in near.successors:
            before[other].append(lane)
    return {lane: replace(near, predecessors=tuple(before[lane])) for lane, near in links.items()}


class _LaneRows(NamedTuple):
    """
    One lane of a table.

    :param line: line number of its first row.
    :param points: of each way-point x [m], y [m], width [m], speed limit [m/s]
    """

    line: int
    points: list[list[float]]
    links: LaneLinks


def _read_lane_rows(path: Path) -> dict[int, _LaneRows]:
    """
    Read a table of way-points, lane by lane.

    :raises InputError: naming the file, the line and the remedy.
    """
    try:
        if path.stat().st_size > MAX_BYTES:
            raise InputError(f'is larger than {MAX_BYTES >> 20} MiB', str(path),
                             'thin out the way-points, or split the map')
        with path.open(encoding='utf-8-sig', newline='') as file:
            return _parse(file, str(path))
    except OSError as error:
        raise InputError(f'cannot read the way-points ({error.strerror})', str(path),
                         'check the name') from error
    except (UnicodeDecodeError, csv.Error) as error:
        raise InputError(f'is no CSV ({error})', str(path), 'save it as CSV in UTF-8') from error


def _parse(file: TextIO, path: str) -> dict[int, _LaneRows]:
    reader = csv.reader(file, strict=True)
    columns = _header(next(reader, []), path)
    lanes: dict[int, _LaneRows] = {}
    current = None
    for count, row in enumerate(row for row in reader if any(cell.strip() for cell in row)):
        where = f'{path}, line {reader.line_num}'
        if count >= MAX_ROWS:
            raise InputError(f'there are more than {MAX_ROWS} way-points', where, 'thin them out')
        if len(row) != len(columns):
            raise InputError(f'there are {len(row)} values', where,
                             f'give {len(columns)}, one for each column')
        cells = {name: cell.strip() for name, cell in zip(columns, row, strict=True)}
        lane = _id(cells['lane'], where)
        if lane != current and lane in lanes:
            raise InputError(f'lane {lane} goes on after another lane', where,
                             'put the way-points of one lane below each other')
        current = lane
        numbers = [_number(cells, name, where) for name in _NUMBERS]
        if lane not in lanes:
            lanes[lane] = _LaneRows(reader.line_num, [], _links(cells, where))
        elif any(cells.get(name) for name in _LISTS + _SINGLE):
            raise InputError(f'links of lane {lane} stand at another row than its first', where,
                             'give them at the first way-point of the lane')
        lanes[lane].points.append(numbers)
    if not lanes:
        raise InputError('there are no way-points', path, 'give two for each lane at least')
    for lane, entry in lanes.items():
        if len(entry.points) < 2:
            raise InputError(f'lane {lane} has one way-point', f'{path}, line {entry.line}',
                             'give two at least')
    return lanes


def _header(row: list[str], path: str) -> list[str]:
    columns = [cell.strip() for cell in row]
    where = f'{path}, line 1'
    for name in ('lane', *_NUMBERS):
        if name not in columns:
            raise InputError(f'there is no column "{name}"', where,
                             'the first line is lane,x,y,width,speed_limit')
    for name in columns:
        if name not in ('lane', *_NUMBERS, *_LISTS, *_SINGLE):
            raise InputError(f'the column {short(name)} is unknown', where,
                             'known are lane, ' + ', '.join(_NUMBERS + _LISTS + _SINGLE))
        if columns.count(name) > 1:
            raise InputError(f'there are two columns "{name}"', where, 'leave one out')
    return columns


def _number(cells: Mapping[str, str], name: str, where: str) -> float:
    text = cells[name]
    if name == 'speed_limit' and not text:
        return math.inf
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise InputError(f'"{name}" is {short(text)}', where, 'give a finite number')
    if name == 'width' and value < 0.0 or name == 'speed_limit' and value <= 0.0:
        raise InputError(f'"{name}" is {short(text)}', where, 'give a positive number')
    return value


def _id(text: str, where: str) -> int:
    if not (text.isascii() and text.isdigit() and len(text) < 20 and int(text) <= _MAX_ID):
        raise InputError(f'{short(text)} is no lane', where, 'give a whole number from 0 on')
    return int(text)


def _links(cells: Mapping[str, str], where: str) -> LaneLinks:
    successors, predecessors = (
        tuple(_id(item, where) for item in cells.get(name, '').split()) for name in _LISTS)
    return LaneLinks(successors, predecessors, *(
        _id(text, where) if (text := cells.get(name, '')) else None for name in _SINGLE))
