# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The links of way-point lanes, checked and completed, and what they say about a drive."""

from collections.abc import Mapping
from dataclasses import replace
import math
from typing import Any

from crgame_ros.errors import InputError
from crgame_ros.geometry.angles import wrap_pi
from crgame_ros.waypoints.waypoint_roads import LaneLinks, MAX_GAP, WaypointRoads
import numpy as np

# Lanes that meet at a greater angle than this have a corner there, and keep it [rad].
MAX_TURN = 0.3
# The name of a link, and what the lane at its other end calls it.
_SIDES = (('left', 'right'), ('right', 'left'), ('oncoming_left', 'oncoming_left'),
          ('oncoming_right', 'oncoming_right'))

# A lane's start (0) or end (-1).
End = tuple[int, int]


def completed_links(roads: WaypointRoads, where: str) -> dict[int, LaneLinks]:
    """
    Return the links of every lane, with those that only the lane at the other end names.

    A neighbour that already has another neighbour on that side keeps it.

    :param where: what to name in messages, before the lane.
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
            if other is not None and _beside(links[other], back.removeprefix('oncoming_')) is None:
                beside: dict[str, Any] = {back: lane}
                links[other] = replace(links[other], **beside)
    return links


def turns(roads: WaypointRoads, links: Mapping[int, LaneLinks]) -> dict[End, float]:
    """
    Return the angles by which ends of lanes turn to the mean heading of the lanes that meet there.

    Splines of lanes that follow each other have slightly different headings where they meet;
    their bounds would gape there. An end that turns by more than `MAX_TURN` stays.

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
    """Return whether a lane can be reached, over successors and neighbours of the same direction."""
    seen, waiting = {start}, [start]
    while waiting:
        near = links[waiting.pop()]
        for other in (*near.successors, near.left, near.right):
            if other is not None and other not in seen:
                seen.add(other)
                waiting.append(other)
    return goal in seen


def _beside(near: LaneLinks, side: str) -> int | None:
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
    """List the ends of lanes that meet in one place, in a fixed order."""
    found = [end]
    for lane, which in found:
        near = links[lane].successors if which else links[lane].predecessors
        found += [item for other in near if (item := (other, 0 if which else -1)) not in found]
    return found


def _heading(roads: WaypointRoads, lane: int, which: int) -> float:
    road = roads.lane(lane)
    return float(road.at(np.array([road.length if which else 0.0])).yaw[0])
