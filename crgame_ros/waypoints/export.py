# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Exports way-point roads as a CommonRoad 2020a scenario."""

from bisect import bisect_right, insort
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
import itertools
import math
from pathlib import Path
import re
from typing import Any, Literal

from crgame_ros.errors import InputError
from crgame_ros.geometry.angles import wrap_pi
from crgame_ros.scenario.export_document import (
    document_text,
    goal_state,
    lanelet_references,
    planning_problem,
    refuse_invalid,
    scenario_header,
)
from crgame_ros.scenario.loading import parse_scenario
from crgame_ros.waypoints.lanelets import Bounds, DECIMALS, FloatArray, lane_bounds
from crgame_ros.waypoints.roads import LaneLinks, MAX_GAP, WaypointRoads
import numpy as np

# A neighbour's cut within this distance is the counterpart of a cut [m].
SNAP = 2.0
# New ids do not continue above existing ids that are greater than this.
_MANY = 10**15
# Lanes that meet at a greater angle than this have an intended corner there, which is kept [rad].
MAX_TURN = 0.3
# Name of a link, and its name in the lane at its other end.
_SIDES = (('left', 'right'), ('right', 'left'), ('oncoming_left', 'oncoming_left'),
          ('oncoming_right', 'oncoming_right'))
# A lane's start (0) or end (-1).
End = tuple[int, int]
LaneletKind = Literal['urban', 'highway']
TIME_STEP_S = 0.1
# Greatest length of a map in a scenario file, and of a lane in a lanelet [m].
MAX_LENGTH, MAX_LANE_LENGTH = 600e3, 99e3
# Last time step of the goal: ten minutes.
_GOAL_STEPS = 6000
_MAX_SPEED = 100.0
_LIMIT_SIGN = '274'
_ZAMUNDA = re.compile(r'ZAM_[A-Za-z0-9]+-[1-9]\d*_[1-9]\d*_T-[1-9]\d*')
_HEAD = ('<location><geoNameId>-999</geoNameId><gpsLatitude>999</gpsLatitude>'
         '<gpsLongitude>999</gpsLongitude></location>\n'
         '<scenarioTags><{}/><simulated/></scenarioTags>\n')


@dataclass(frozen=True)
class Piece:
    """
    A part of a lane that becomes a lanelet.

    :param number: its id.
    :param lane: id of the lane.
    :param start: station at which it begins [m]
    :param end: station at which it ends [m]
    :param speed_limit: [m/s]; infinite without one.
    :param successors: ids of pieces.
    :param predecessors: ids of pieces.
    :param left: id of the piece beside it, and whether that has the same direction; None without.
    :param right: likewise.
    """

    number: int
    lane: int
    start: float
    end: float
    speed_limit: float
    successors: tuple[int, ...]
    predecessors: tuple[int, ...]
    left: tuple[int, bool] | None
    right: tuple[int, bool] | None


def free_ids(taken: tuple[int, ...]) -> Iterator[int]:
    """Yield unused ids: above the existing ones, unless these are huge."""
    known = set(taken)
    first = max(known) + 1 if max(known) < _MANY else 1
    return (number for number in itertools.count(max(first, 1)) if number not in known)


def cut_lanes(roads: WaypointRoads, links: Mapping[int, LaneLinks], ids: Iterator[int],
              where: str) -> list[Piece]:
    """
    Cut every lane where its speed limit changes, and where a neighbour is cut.

    The first piece of a lane has the lane's id (except 0, which lanelets cannot have). A lane that
    is its own successor is cut in the middle, because a lanelet cannot be its own successor.

    :param links: links as `completed_links` returns them.
    :param ids: ids for the other pieces.
    :param where: text for messages, before the lane.
    :raises InputError: if a speed limit is not a step function.
    """
    cuts = _cuts(roads, links, where)
    numbers = {lane: [lane or next(ids), *itertools.islice(ids, len(cuts[lane]))]
               for lane in links}
    pieces = []
    for lane, near in links.items():
        road, own = roads.lane(lane), numbers[lane]
        stations = [0.0, *cuts[lane], road.length]
        limits = road.at(np.array(stations[:-1])).speed_limit.tolist()
        for index, number in enumerate(own):
            after = own[index + 1:index + 2] or [numbers[x][0] for x in near.successors]
            before = own[index - 1:index] or [numbers[x][-1] for x in near.predecessors]
            sides = [_piece_beside(roads, cuts, numbers, lane, index, same, oncoming)
                     for same, oncoming in ((near.left, near.oncoming_left),
                                            (near.right, near.oncoming_right))]
            pieces.append(Piece(number, lane, stations[index], stations[index + 1],
                                limits[index], tuple(after), tuple(before), *sides))
    return pieces


def _cuts(roads: WaypointRoads, links: Mapping[int, LaneLinks],
          where: str) -> dict[int, list[float]]:
    cuts: dict[int, list[float]] = {}
    for lane, near in links.items():
        road = roads.lane(lane)
        if road.kinds['speed_limit'] != 'step':
            raise InputError('the speed limit changes gradually', f'{where}, lane {lane}',
                             'interpolate it as steps: a lanelet has one limit')
        changes = np.flatnonzero(road.speed_limit[1:-1] != road.speed_limit[:-2]) + 1
        cuts[lane] = road.s[changes].tolist()
        if lane in near.successors and not cuts[lane]:
            cuts[lane] = [0.5 * road.length]
    waiting = [(lane, s) for lane, own in cuts.items() for s in own]
    for lane, s in waiting:
        for other in links[lane].beside:
            station = _across(roads, lane, s, other)
            near_end = min(station, roads.lane(other).length - station) < SNAP
            if not near_end and all(abs(station - cut) >= SNAP for cut in cuts[other]):
                insort(cuts[other], station)
                waiting.append((other, station))
    return cuts


def _across(roads: WaypointRoads, lane: int, s: float, other: int) -> float:
    """Return the station of another lane beside a station of a lane."""
    here = roads.lane(lane).at(np.array([s]))
    return float(roads.lane(other).project(np.stack((here.x, here.y), axis=-1)).s[0])


def _piece_beside(roads: WaypointRoads, cuts: Mapping[int, list[float]],
                  numbers: Mapping[int, list[int]], lane: int, index: int, same: int | None,
                  oncoming: int | None) -> tuple[int, bool] | None:
    """Return the piece beside a piece: the middle of each must be beside the other."""
    other = oncoming if same is None else same
    if other is None:
        return None
    if not (cuts[lane] or cuts[other]):
        return numbers[other][0], same is not None
    beside = bisect_right(cuts[other], _across(roads, lane, _middle(roads, cuts, lane, index),
                                               other))
    back = bisect_right(cuts[lane], _across(roads, other, _middle(roads, cuts, other, beside),
                                            lane))
    return (numbers[other][beside], same is not None) if back == index else None


def _middle(roads: WaypointRoads, cuts: Mapping[int, list[float]], lane: int,
            index: int) -> float:
    stations = [0.0, *cuts[lane], roads.lane(lane).length]
    return 0.5 * (stations[index] + stations[index + 1])


def completed_links(roads: WaypointRoads, where: str) -> dict[int, LaneLinks]:
    """
    Return the links of every lane, including those that only the lane at the other end names.

    A neighbour that already has another neighbour on that side keeps it.

    :param where: text for messages, before the lane.
    :raises InputError: if a lane is beside itself, has two neighbours on a side, or is followed
        by a lane that begins elsewhere.
    """
    links = {lane: roads.links(lane) for lane in roads.lane_ids}
    for lane, near in links.items():
        _check(roads, lane, near, f'{where}, lane {lane}')
    for lane, near in list(links.items()):
        for other in near.successors:
            if lane not in links[other].predecessors:
                links[other] = replace(
                    links[other], predecessors=(*links[other].predecessors, lane))
        for other in near.predecessors:
            if lane not in links[other].successors:
                links[other] = replace(links[other], successors=(*links[other].successors, lane))
        for name, back in _SIDES:
            other = getattr(near, name)
            side = back.removeprefix('oncoming_')
            if other is not None and _lanes_beside(links[other], side) is None:
                beside: dict[str, Any] = {back: lane}
                links[other] = replace(links[other], **beside)
    return links


def turns(roads: WaypointRoads, links: Mapping[int, LaneLinks]) -> dict[End, float]:
    """
    Return the rotations of lanes' ends to the mean heading of the lanes that meet there.

    Splines of successive lanes have slightly different headings where they meet, which would
    leave gaps between their bounds. An end with a rotation above `MAX_TURN` is not rotated.

    :return: [rad], by lane and end.
    """
    found: dict[End, float] = {}
    for lane in links:
        for end in ((lane, 0), (lane, -1)):
            if end not in found:
                ends = _meeting(end, links)
                yaws = [_heading(roads, *item) for item in ends]
                mean = math.atan2(sum(map(math.sin, yaws)), sum(map(math.cos, yaws)))
                found |= {item: turn if abs(turn := wrap_pi(mean - yaw)) <= MAX_TURN else 0.0
                          for item, yaw in zip(ends, yaws, strict=True)}
    return found


def is_reachable(links: Mapping[int, LaneLinks], start: int, goal: int) -> bool:
    """Return whether a lane can be reached by successors and neighbours of the same direction."""
    seen, waiting = {start}, [start]
    while waiting:
        near = links[waiting.pop()]
        for other in (*near.successors, near.left, near.right):
            if other is not None and other not in seen:
                seen.add(other)
                waiting.append(other)
    return goal in seen


def _lanes_beside(near: LaneLinks, side: str) -> int | None:
    same: int | None = getattr(near, side)
    oncoming: int | None = getattr(near, f'oncoming_{side}')
    return oncoming if same is None else same


def _check(roads: WaypointRoads, lane: int, near: LaneLinks, where: str) -> None:
    for side in ('left', 'right'):
        same, oncoming = getattr(near, side), getattr(near, f'oncoming_{side}')
        if same is not None and oncoming is not None:
            raise InputError(f'there are lane {same} and the oncoming lane {oncoming} on its '
                             f'{side}', where, 'name one')
        if lane in (same, oncoming):
            raise InputError(f'it is its own neighbour on the {side}', where, 'name another lane')
    pairs = [(lane, other) for other in near.successors]
    pairs += [(other, lane) for other in near.predecessors]
    for before, after in pairs:
        gap = float(np.hypot(*(roads.lane(after).points[0] - roads.lane(before).points[-1])))
        if gap > MAX_GAP:
            raise InputError(f'lane {after} follows lane {before}, but begins {gap:.1f} m from '
                             'its end', where, f'correct the link, or the way-points to within '
                             f'{MAX_GAP:g} m')


def _meeting(end: End, links: Mapping[int, LaneLinks]) -> list[End]:
    """Return the ends of lanes that meet at the place of an end, in a fixed order."""
    found = [end]
    for lane, which in found:
        near = links[lane].successors if which else links[lane].predecessors
        found += [item for other in near if (item := (other, 0 if which else -1)) not in found]
    return found


def _heading(roads: WaypointRoads, lane: int, which: int) -> float:
    road = roads.lane(lane)
    return float(road.at(np.array([road.length if which else 0.0])).yaw[0])


@dataclass(frozen=True)
class Drive:
    """
    The task of an AV, for a planning problem.

    :param lane: id of the lane on whose centre line it starts.
    :param station: station of the vehicle's centre at the start [m]
    :param speed: initial speed [m/s]
    :param goal: id of the lane to reach.
    """

    lane: int
    station: float
    speed: float
    goal: int


@dataclass(frozen=True)
class ExportedRoads:
    """
    Way-point roads as a scenario.

    :param xml_text: the content of the file.
    :param pieces: its lanelets, in order.
    """

    benchmark_id: str
    xml_text: str
    pieces: tuple[Piece, ...]

    def lanelets(self, lane: int) -> tuple[int, ...]:
        """Return the lanelets of a lane, in driving direction."""
        return tuple(piece.number for piece in self.pieces if piece.lane == lane)


def export_roads(roads: WaypointRoads, name: str, kind: LaneletKind = 'urban',
                 drive: Drive | None = None, where: str = 'way-point roads') -> ExportedRoads:
    """
    Convert way-point lanes to a map of lanelets.

    Every lane becomes a lanelet, or several where its speed limit changes (`cut_lanes`). Without
    a drive there is no planning problem, although CommonRoad's schema requires one; everything
    else conforms to the schema.

    :param name: name of the map, part of the benchmark id.
    :param kind: lanelet type of all lanes.
    :param where: text for messages, before the lane.
    :raises InputError: if a lane or a link cannot be represented by lanelets.
    :raises CrgameError: if the schema refuses the result.
    """
    _refuse_long(roads, where)
    links = completed_links(roads, where)
    ids = free_ids(roads.lane_ids)
    pieces = tuple(cut_lanes(roads, links, ids, where))
    if drive is not None:
        _check_drive(roads, drive)
        if not is_reachable(links, drive.lane, drive.goal):
            raise InputError(f'no way leads from lane {drive.lane} to lane {drive.goal}',
                             '--goal', 'name another, or complete the links of the lanes')
    at_ends = turns(roads, links)
    lanelets, signs = [], []
    for piece in pieces:
        bounds = lane_bounds(roads.lane(piece.lane), piece.start, piece.end,
                             (at_ends[piece.lane, 0], at_ends[piece.lane, -1]),
                             f'{where}, lane {piece.lane}')
        sign = next(ids) if math.isfinite(piece.speed_limit) else None
        lanelets.append(_lanelet(piece, bounds, kind, sign))
        if sign is not None:
            signs.append(_sign(sign, piece.speed_limit, bounds.right[0]))
    problem = _problem(next(ids), roads, drive, pieces)
    benchmark_id = name if _ZAMUNDA.fullmatch(name) else (
        f'ZAM_{re.sub("[^A-Za-z0-9]", "", name)[:40] or "Roads"}-1_1_T-1')
    network = _HEAD.format(kind) + ''.join(lanelets + signs)
    refuse_invalid(_document(benchmark_id, network + problem, where))
    text = _document(benchmark_id, network + (problem if drive is not None else ''), where)
    # Check that the file can be loaded: the loader refuses more than the schema, e.g. large files.
    parse_scenario(text, f'{where} as a scenario')
    return ExportedRoads(benchmark_id, text, pieces)


def _refuse_long(roads: WaypointRoads, where: str) -> None:
    lengths = [(roads.lane(lane).length, lane) for lane in roads.lane_ids]
    longest, lane = max(lengths)
    if longest > MAX_LANE_LENGTH:
        raise InputError(f'is {longest / 1e3:.0f} km long', f'{where}, lane {lane}',
                         f'split it into lanes of {MAX_LANE_LENGTH / 1e3:.0f} km at most; '
                         'way-points are in metres')
    total = sum(length for length, _ in lengths)
    if total > MAX_LENGTH:
        raise InputError(f'the lanes are {total / 1e3:.0f} km long together', where,
                         f'split the map: {MAX_LENGTH / 1e3:.0f} km are a full scenario file')


def _check_drive(roads: WaypointRoads, drive: Drive) -> None:
    for option, lane in (('--start', drive.lane), ('--goal', drive.goal)):
        if lane not in roads.lane_ids:
            raise InputError(f'there is no lane {lane}', option, 'name a lane of the way-points')
    length = roads.lane(drive.lane).length
    if not 0.0 <= drive.station <= length:
        raise InputError(f'the station {drive.station:g} m is not on lane {drive.lane}',
                         '--start', f'give 0 to {length:.1f} m')
    if not 0.0 <= drive.speed <= _MAX_SPEED:
        raise InputError(f'the speed is {drive.speed:g} m/s', '--start',
                         f'give 0 to {_MAX_SPEED:g} m/s')


def _problem(number: int, roads: WaypointRoads, drive: Drive | None,
             pieces: Sequence[Piece]) -> str:
    """Return the XML of the planning problem, or of a substitute for the check by the schema."""
    if drive is None:
        drive = Drive(pieces[0].lane, 0.0, 0.0, pieces[0].lane)
    here = roads.lane(drive.lane).at(np.array([drive.station]))
    goals = lanelet_references(piece.number for piece in pieces if piece.lane == drive.goal)
    return planning_problem(
        number, (float(here.x[0]), float(here.y[0]), float(here.yaw[0]), drive.speed, 0.0,
                 float(here.curvature[0]) * drive.speed), [goal_state((0, _GOAL_STEPS), goals)])


def _lanelet(piece: Piece, bounds: Bounds, kind: LaneletKind, sign: int | None) -> str:
    parts = [f'<lanelet id="{piece.number}">\n'
             f'<leftBound>{_points(bounds.left)}</leftBound>\n'
             f'<rightBound>{_points(bounds.right)}</rightBound>\n']
    parts += [f'<predecessor ref="{number}"/>' for number in piece.predecessors]
    parts += [f'<successor ref="{number}"/>' for number in piece.successors]
    for tag, side in (('adjacentLeft', piece.left), ('adjacentRight', piece.right)):
        if side is not None:
            direction = 'same' if side[1] else 'opposite'
            parts.append(f'<{tag} ref="{side[0]}" drivingDir="{direction}"/>')
    parts.append(f'<laneletType>{kind}</laneletType>')
    if sign is not None:
        parts.append(f'<trafficSignRef ref="{sign}"/>')
    return ''.join(parts) + '\n</lanelet>\n'


def _sign(number: int, limit: float, position: FloatArray) -> str:
    # All digits, so that reading it again gives the same number.
    value = np.format_float_positional(limit, trim='0')
    return (f'<trafficSign id="{number}"><trafficSignElement><trafficSignID>{_LIMIT_SIGN}'
            f'</trafficSignID><additionalValue>{value}</additionalValue></trafficSignElement>'
            f'<position>{_points(position[None])}</position><virtual>false</virtual>'
            '</trafficSign>\n')


def _points(points: FloatArray) -> str:
    return ''.join(f'<point><x>{x:.{DECIMALS}f}</x><y>{y:.{DECIMALS}f}</y></point>'
                   for x, y in points.tolist())


def _document(benchmark_id: str, content: str, source: str) -> str:
    # The folder is left out, so that equal way-points give equal bytes.
    name = ''.join(letter for letter in Path(source).name if letter.isprintable())
    return document_text(scenario_header(benchmark_id, TIME_STEP_S,
                                         f'{name}, made by crgame roads'), content)
