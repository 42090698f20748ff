# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Encounters of agents: whether two touch, and the braking that avoids it."""

import math

from crgame_ros.traffic.compiling.compiled import bare, inlined
from crgame_ros.traffic.fleet.agents import AgentTable
from crgame_ros.traffic.following.leaders import Corridors, first_from, LONGEST, Pairs, Ways
from crgame_ros.traffic.lanes.lane_graph import FloatArray, IntArray
from crgame_ros.traffic.lanes.lane_table import (
    angle_between,
    LaneTable,
    nearest_row,
    point_on,
    project_on,
)
from crgame_ros.traffic.lanes.placement import Entries
from crgame_ros.traffic.lanes.pursuit import curve_shift, swing_out
from crgame_ros.traffic.motion.motion import onward

# Agents brake harder than this only where they cannot halt behind a leader otherwise [m/s^2].
FIRMEST = 3.9
# A leader is expected to brake with this, if it doesn't brake harder already [m/s^2].
THEIRS = 4.0
# Room left when that happens [m].
LAST_GAP = 0.3
# For an agent that drives across no braking is considered until `CONSIDERS` is needed to halt
# before it: the right of way has usually settled the encounter. Until `ALARM` is needed, an agent
# waits as long as braking with less than `FIRM` avoids contact [m/s^2].
CONSIDERS, ALARM, FIRM = 0.5, 2.0, 3.0
# Decelerations that are tried, the gentlest first; up to `SMOOTH` [m/s^2] they set in after
# `ONSET` [s].
TRIED = (2.0, 3.0, 3.9, 6.0, 8.0)
SMOOTH, ONSET = 3.0, 0.3
# If contact is this near and no braking avoids it, the hardest is used [s].
LAST_MOMENT = 1.0
# Agents brake no harder than this for another that appears beside their way [m/s^2].
GENTLY = 2.0
# Both agents are predicted for this time, in these steps [s].
FORESEEN, STEP = 3.0, 0.15
# The present offset and heading error of a predicted agent decay over this distance [m].
STRAIGHTENS = 5.0
# Room that each of two agents keeps beside it [m], and how many times as much before and behind;
# for agents that brush past each other in lanes of their own the room beside is smaller [m].
BESIDE, BEFORE, BRUSH_BESIDE = 0.1, 2.5, 0.03
# How far ahead a brush is predicted [s], and the speed assumed for a standing agent [m/s].
BRUSH_TIME, CREEP = 1.2, 0.5
# In how many lanes of the way a brush is predicted.
BRUSH_LANES = 3
# Slower along the road than this an obstacle crosses the road [m/s].
ACROSS = 2.0
# Time between passing and the arrival of a person that walks into the way [s], and room beside
# [m].
SPARE_TIME, SPARE_ROOM = 0.4, 0.4


@bare
def moderate(lanes: LaneTable, following: IntArray, agents: AgentTable, entries: Entries,
             pairs: Pairs, corridor: Corridors, wanted: FloatArray, result: FloatArray) -> None:
    """
    Lower accelerations (A) to what the car-following model wants, or the encounter demands.

    Behind a leader in the same direction braking is `FIRMEST` at most, unless more is needed to
    halt when the leader does. For another agent that drives across, only the last moment to brake
    counts, and there is no braking if both pass each other as they go. For an object that moves
    into the way from the side there is none if the agent passes before.

    :param corridor: room that agents (A) take.
    :param wanted: (P) by the model [m/s^2]
    """
    for p in range(len(pairs.agent)):
        i, n = pairs.agent[p], pairs.entry[p]
        slot, behind = corridor.owner[i], wanted[p]
        if entries.crosses[n] and entries.owner[n] >= 0:
            needed = agents.speed[slot]**2 / (2.0 * max(pairs.gap[p] - 0.5, 0.05))
            braking = needed_braking(lanes, following, agents, slot, entries.owner[n]) \
                if needed > CONSIDERS else -math.inf
            behind = -braking if needed > ALARM or braking >= FIRM else math.inf
        elif entries.owner[n] < 0 and abs(entries.speed[n]) < ACROSS and _passes_before(
                agents, slot, entries, n, pairs.gap[p], corridor.low[i], corridor.high[i]):
            behind = math.inf
        elif entries.speed[n] > -0.5:
            theirs = max(entries.speed[n], 0.0)
            room = pairs.gap[p] - LAST_GAP + theirs**2 / (
                2.0 * max(THEIRS, -entries.acceleration[n]))
            needed = agents.speed[slot]**2 / (2.0 * max(room, 0.01)) if pairs.gap[p] > 0.0 \
                else 0.0
            behind = max(behind, -max(needed, FIRMEST))
        result[i] = min(result[i], behind)


@bare
def brush(lanes: LaneTable, following: IntArray, agents: AgentTable, slots: IntArray,
          entries: Entries, way: Ways, result: FloatArray) -> None:
    """
    Lower accelerations (A) so that agents don't touch others that reach into their lanes.

    Where lanes fork, merge or turn beside each other, two agents may touch although neither is
    the other's leader. Of the two the one behind brakes. For a standing agent all others brake.
    """
    for i, slot in enumerate(slots):
        reach = 0.5 * agents.length[slot] + 3.0 + BRUSH_TIME * agents.speed[slot]
        if agents.source[slot] >= 0:
            continue
        for step in range(min(way.depth[i], BRUSH_LANES)):
            lane, offset = way.lane[i, step], way.offset[i, step]
            n = first_from(entries, lane, -offset - LONGEST)
            while n < entries.begin[lane + 1] and entries.rear[n] + offset < reach:
                other = entries.owner[n]
                if other >= 0 and other != slot and agents.lane[other] != lane and (
                        entries.front[n] + offset > -agents.length[slot]
                        and agents.source[other] < 0):
                    result[i] = min(result[i], _brushed(
                        lanes, following, agents, slot, other))
                n += 1


@bare
def _brushed(lanes: LaneTable, following: IntArray, agents: AgentTable, slot: int,
             other: int) -> float:
    """Return the acceleration with which an agent does not touch another, inf if any [m/s^2]."""
    east, north = agents.x[other] - agents.x[slot], agents.y[other] - agents.y[slot]
    mine = east * math.cos(agents.yaw[slot]) + north * math.sin(agents.yaw[slot])
    theirs = -east * math.cos(agents.yaw[other]) - north * math.sin(agents.yaw[other])
    speed = max(agents.speed[slot], CREEP)
    goes_first = mine < theirs or (mine == theirs and slot < other)
    if (goes_first and agents.speed[other] > CREEP) or mine < 0.0 or _touch(
            lanes, following, agents, slot, speed, other, 0.0, BRUSH_TIME,
            BRUSH_BESIDE) == math.inf or _touch(
            lanes, following, agents, slot, speed, other, 0.0, 0.0, 0.0) < math.inf:
        return math.inf
    agents.blocker[slot] = other
    if agents.speed[slot] < CREEP:
        return -1.0
    braking = _gentlest(lanes, following, agents, slot, speed, other, BRUSH_TIME, BRUSH_BESIDE)
    return -min(braking, TRIED[-1])


@bare
def is_in_the_way(lanes: LaneTable, following: IntArray, agents: AgentTable, slots: IntArray,
                  slot: int) -> bool:
    """
    Return whether another agent, even with gentle braking, touches one that has just appeared.

    :param slots: (A) of the agents on the road.
    """
    reach = FORESEEN * agents.speed[slot] + agents.length[slot]
    for other in slots:
        away = math.hypot(agents.x[other] - agents.x[slot], agents.y[other] - agents.y[slot])
        if other != slot and away < reach + FORESEEN * agents.speed[other] + (
                agents.length[other]) and agents.lane[other] != agents.lane[slot] and _touch(
                lanes, following, agents, slot, agents.speed[slot], other, 0.0, FORESEEN,
                BESIDE) < math.inf and _touch(
                lanes, following, agents, other, agents.speed[other], slot, GENTLY, FORESEEN,
                BESIDE) < math.inf:
            return True
    return False


@bare
def _passes_before(agents: AgentTable, slot: int, entries: Entries, n: int, gap: float,
                   low: float, high: float) -> bool:
    """Return whether an agent has passed before an object beside its way gets there."""
    aside, drift = entries.aside[n], entries.drift[n]
    if aside > 0.1:
        rest = low - SPARE_ROOM - (entries.high[n] - max(drift, 0.0))
    elif aside < -0.1:
        rest = entries.low[n] - min(drift, 0.0) - high - SPARE_ROOM
    else:
        return False
    way = gap + agents.length[slot] + entries.front[n] - entries.rear[n]
    return bool(rest > 0.0 and way < max(rest / abs(aside) - SPARE_TIME, 0.0)
                * agents.speed[slot])


@bare
def needed_braking(lanes: LaneTable, following: IntArray, agents: AgentTable, slot: int,
                   other: int) -> float:
    """Return the gentlest braking by which two agents miss each other, -inf if none is needed."""
    speed = agents.speed[slot]
    soon = _touch(lanes, following, agents, slot, speed, other, 0.0, FORESEEN, BESIDE)
    if soon == math.inf:
        return -math.inf
    braking = _gentlest(lanes, following, agents, slot, speed, other, FORESEEN, BESIDE)
    if braking <= FIRMEST:
        return braking
    # An agent brakes harder only if the two would touch, not for the room between them.
    soon = _touch(lanes, following, agents, slot, speed, other, 0.0, FORESEEN, 0.0)
    if soon == math.inf:
        return FIRMEST
    braking = _gentlest(lanes, following, agents, slot, speed, other, FORESEEN, 0.0)
    if braking < math.inf:
        return braking
    # No braking of this agent helps now, but the other may react.
    return TRIED[-1] if soon < LAST_MOMENT else FIRMEST


@bare
def _gentlest(lanes: LaneTable, following: IntArray, agents: AgentTable, slot: int, speed: float,
              other: int, foreseen: float, beside: float) -> float:
    """Return the gentlest of `TRIED` with which two agents don't touch, or inf; see `_touch`."""
    for braking in TRIED:
        if _touch(lanes, following, agents, slot, speed, other, braking, foreseen,
                  beside) == math.inf:
            return braking
    return math.inf


@bare
def _touch(lanes: LaneTable, following: IntArray, agents: AgentTable, slot: int, speed: float,
           other: int, braking: float, foreseen: float, beside: float) -> float:
    """
    Return when two agents touch if one brakes and the other drives on as now, or inf [s].

    :param speed: of the one that brakes [m/s]
    :param foreseen: time of the prediction [s]; 0 checks whether they touch now.
    :param beside: room around each [m]
    """
    mine, theirs = _start(lanes, agents, slot), _start(lanes, agents, other)
    onset = ONSET if braking <= SMOOTH else 0.0
    slows = max(-agents.acceleration[other], 0.0)
    before = BEFORE * beside
    for step in range(min(1, int(foreseen / STEP)), int(foreseen / STEP) + 1):
        t = step * STEP
        way = speed * min(t, onset) + _rolled(speed, braking, max(t - onset, 0.0))
        x, y, yaw = _pose_after(lanes, following, agents, slot, mine, way)
        other_x, other_y, other_yaw = _pose_after(
            lanes, following, agents, other, theirs, _rolled(agents.speed[other], slows, t))
        if overlap(other_x - x, other_y - y, yaw, other_yaw,
                   0.5 * agents.length[slot] + before, 0.5 * agents.width[slot] + beside,
                   0.5 * agents.length[other] + before, 0.5 * agents.width[other] + beside):
            return t
    return math.inf


@inlined
def _rolled(speed: float, braking: float, time: float) -> float:
    """Return the distance driven within a time when braking [m]."""
    if braking > 0.0:
        time = min(time, speed / braking)
    return speed * time - 0.5 * braking * time * time


@inlined
def _start(lanes: LaneTable, agents: AgentTable, slot: int) -> tuple[float, float, float]:
    """Return s of the rear axle, its offset from where it steers for, and its heading error."""
    lane = agents.lane[slot]
    s, d, yaw = project_on(lanes, lane, agents.x[slot], agents.y[slot],
                           agents.s[slot] - agents.rear_to_center[slot], 2)
    return s, d - _shift(lanes, agents, slot, lane, s), angle_between(agents.yaw[slot], yaw)


@inlined
def _shift(lanes: LaneTable, agents: AgentTable, slot: int, lane: int, s: float) -> float:
    """Return how far to the left of the lane's centre line the rear axle runs [m]."""
    front = agents.rear_to_center[slot] + 0.5 * agents.length[slot]
    at = lanes.line[nearest_row(lanes, lane, s)]
    return curve_shift(at.curvature, front) + swing_out(at.swing, at.swing_long, front)


@bare
def _pose_after(lanes: LaneTable, following: IntArray, agents: AgentTable, slot: int,
                start: tuple[float, float, float], way: float) -> tuple[float, float, float]:
    """Predict x, y and heading of an agent's centre after a distance on its route [m, rad]."""
    lane, s = onward(lanes, following, agents.destination[slot], agents.lane[slot],
                     start[0] + way)
    x, y, yaw = point_on(lanes, lane, s)
    left = math.exp(-way / STRAIGHTENS)
    d = _shift(lanes, agents, slot, lane, s) + start[1] * left
    heading = yaw + start[2] * left
    middle = agents.rear_to_center[slot]
    return (x - d * math.sin(yaw) + middle * math.cos(heading),
            y + d * math.cos(yaw) + middle * math.sin(heading), heading)


@bare
def overlap(east: float, north: float, yaw: float, other_yaw: float, length: float,
            width: float, other_length: float, other_width: float) -> bool:
    """Return whether two rectangles, given by half their sizes, overlap, by separating axes."""
    cos, sin = abs(math.cos(other_yaw - yaw)), abs(math.sin(other_yaw - yaw))
    for turn, along, aside, their_along, their_aside in (
            (yaw, length, width, other_length, other_width),
            (other_yaw, other_length, other_width, length, width)):
        ahead = abs(east * math.cos(turn) + north * math.sin(turn))
        left = abs(north * math.cos(turn) - east * math.sin(turn))
        if ahead > along + their_along * cos + their_aside * sin or (
                left > aside + their_along * sin + their_aside * cos):
            return False
    return True
