# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Cuts way-point lanes into pieces with one speed limit each, and links the pieces."""

from bisect import bisect_right, insort
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
import itertools
import math
from typing import Any

from crgame_ros.errors import InputError
from crgame_ros.geometry.angles import wrap_pi
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
        for other in _beside(links[lane]):
            station = _across(roads, lane, s, other)
            near_end = min(station, roads.lane(other).length - station) < SNAP
            if not near_end and all(abs(station - cut) >= SNAP for cut in cuts[other]):
                insort(cuts[other], station)
                waiting.append((other, station))
    return cuts


def _beside(near: LaneLinks) -> list[int]:
    return [other for other in (near.left, near.right, near.oncoming_left, near.oncoming_right)
            if other is not None]


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
