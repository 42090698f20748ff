# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Measures how each driven vehicle of a run was driven, from any run's record.

`MEASURES` defines each measure; `docs/behaviour.md` explains them.
"""

from collections.abc import Callable, Collection, Mapping, Sequence
import math

from crgame_ros.analysis.behaviour.driver_controls import DriverControls
from crgame_ros.analysis.behaviour.gaps_accepted import AcceptedGap, gap_in_lane, Neighbour
from crgame_ros.analysis.behaviour.lane_keeping import (
    ChangeOfLane,
    driven_offsets,
    keep_lane,
    LaneKeeping,
    sdlp,
)
from crgame_ros.analysis.behaviour.lane_visits import LaneVisit
from crgame_ros.analysis.behaviour.measures import STABLE_ACCELERATION
from crgame_ros.analysis.behaviour.pedal_use import Spread, spread_of, use_of_pedal
from crgame_ros.analysis.behaviour.reactions import reaction_to, ResponseLimits, USUAL_LIMITS
from crgame_ros.analysis.behaviour.steering_reversals import COGNITIVE, reversal_rate, VISUAL
from crgame_ros.analysis.behaviour.take_overs import find_take_overs, TakeOverRequest
from crgame_ros.analysis.behaviour.vehicle import (
    DriverBehaviour,
    EventReaction,
    LaneChangeGap,
)
from crgame_ros.game.documents import GameDocument
from crgame_ros.game.events import FiredEvent, SpeedLimit
from crgame_ros.geometry.outline import outline, placed
from crgame_ros.geometry.reference_point import shifted, shifted_velocities
from crgame_ros.geometry.rigid_transform import RigidTransform
from crgame_ros.recording.run_record import RunRecord
from crgame_ros.roads.network import RoadNetwork
from crgame_ros.scenario.loading import parse_scenario
from crgame_ros.vehicle.state import pose_rates, StateColumn
import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


def limits_of(roads: RoadNetwork, visits: Sequence[LaneVisit], count: int,
              events: Sequence[tuple[int, SpeedLimit]]) -> FloatArray:
    """
    Return the speed limit at each step: NaN off the lanes and where there is none [m/s].

    :param visits: stays in lanelets.
    :param count: number of steps K.
    :param events: limits set by events, each with its first step, in order.
    """
    limits = np.full(count, np.nan)
    for visit in visits:
        signed = roads.speed_limit(visit.lanelet)
        limits[visit.first:visit.end] = math.nan if signed is None else signed
        for step, event in events:
            if not event.lanelets or visit.lanelet in event.lanelets:
                limits[max(visit.first, step):visit.end] = event.speed
    return limits


def limit_events(game: GameDocument, fired: Sequence[FiredEvent],
                 first_k: int) -> list[tuple[int, SpeedLimit]]:
    """Return the limits set by events, with the step since `first_k` at which they took effect."""
    actions: Mapping[str, object] = {event.name: event.action for event in game.events}
    found = []
    for event in fired:
        action = actions.get(event.name)
        if isinstance(action, SpeedLimit):
            found.append((event.k - first_k, action))
    return found


def time_above(speed: FloatArray, limits: FloatArray, step_s: float) -> float:
    """
    Return the time above the limit [s]; each state counts until the next one.

    :return: NaN where there was no limit at all
    """
    limited = np.isfinite(limits[:-1])
    if not limited.any():
        return math.nan
    return step_s * int(np.count_nonzero(np.abs(speed[:-1][limited]) > limits[:-1][limited]))


# Sources of seat orders that return the vehicle to its planner or the game.
_BACK = ('game', 'planner')
_CIRCLE_CORNERS = 32


def measure_behaviour(record: RunRecord, limits: ResponseLimits = USUAL_LIMITS,
                      requests: Collection[str] = (),
                      progress: Callable[[float], object] = lambda _: None,
                      ) -> tuple[DriverBehaviour, ...]:
    """
    Measure how each driven vehicle of a run was driven, in the log's order.

    :param record: record of a recording (`read_run_record`) or an offline run (`run_record_of`).
    :param limits: limits that define a response to an event.
    :param requests: names of further events that count as requests to take over; orders of the
        seat and the game's take-over requests always do.
    :param progress: called with the share measured so far, 0 to 1.
    :raises InputError: if the scenario in it cannot be used.
    """
    log = record.log
    loaded = parse_scenario(log.xml_text, '/scenario/xml')
    everybody = _Everybody(record, RoadNetwork(loaded.scenario.lanelet_network))
    found = []
    for number in range(len(log.vehicles)):
        found.append(_measured(everybody, number, limits, requests))
        progress((number + 1) / len(log.vehicles))
    return tuple(found)


class _Everybody:
    """All vehicles and objects of a run, driven vehicles first, by their centres."""

    def __init__(self, record: RunRecord, roads: RoadNetwork) -> None:
        log = record.log
        self.record, self.roads = record, roads
        self.step_s = log.game.scheduler.time_step_s
        self.times_s = np.multiply(log.ks - log.game.scheduler.k0, self.step_s,
                                   dtype=np.float64)
        self.ids = [item.id for item in log.descriptions]
        self._outlines = [outline(item.shape, _CIRCLE_CORNERS) for item in log.descriptions]
        self._ahead = np.array([item.rear_to_center for item in log.vehicles])

    def transform(self, number: int) -> RigidTransform:
        """Return the transform into the coordinates of a driven vehicle's road."""
        av = self.record.log.game.av(self.ids[number])
        return RigidTransform() if av is None else av.transform

    def at(self, row: int, transform: RigidTransform) -> tuple[list[FloatArray], FloatArray]:
        """Return centres with corners (C + 1, 2) each, and velocities (N, 2), at a step."""
        log = self.record.log
        states = log.vehicle_states[row]
        centers = shifted(states[:, :3], self._ahead)
        moves = shifted_velocities(centers[:, 2], pose_rates(states), self._ahead)
        poses = transform.to_scenario(np.concatenate((centers, log.object_poses[row])))
        velocities = transform.turn_to_scenario(
            np.concatenate((moves, log.object_velocities[row]))[:, :2])
        return [np.concatenate((pose[None, :2], placed(corners, pose)))
                for corners, pose in zip(self._outlines, poses, strict=True)], velocities


def _measured(everybody: _Everybody, number: int, limits: ResponseLimits,
              requests: Collection[str]) -> DriverBehaviour:
    record = everybody.record
    log, vehicle_id = record.log, everybody.ids[number]
    game: GameDocument = log.game
    vehicle = game.vehicles[number].vehicle
    transform = everybody.transform(number)
    states = log.vehicle_states[:, number].copy()
    states[:, :3] = transform.to_scenario(states[:, :3])
    keeping = keep_lane(everybody.roads, states, vehicle, everybody.step_s,
                        record.jumps(number))
    dt_s = game.scheduler.dt_s
    controls = DriverControls.from_commands(record.times_s, record.commands[:, number],
                                            vehicle.max_steering_wheel_angle, dt_s)
    human = game.human(vehicle_id) is not None
    return DriverBehaviour(
        vehicle_id, human, controls.driven_s,
        {**_motion(everybody, states, keeping), **_commands(controls)},
        tuple(EventReaction(event.name, event.n * dt_s,
                            reaction_to(event.n * dt_s, controls, limits))
              for event in record.fired if event.is_of_game and len(controls.times_s)),
        limits,
        tuple(_gap(everybody, number, keeping, change) for change in keeping.changes),
        () if human else find_take_overs(
            controls, _calm(everybody, states, keeping, controls),
            _requests(record, vehicle_id, requests)),
        everybody.times_s, keeping.tlc_s, keeping.linear_s)


def _motion(everybody: _Everybody, states: FloatArray, keeping: LaneKeeping) -> dict[str, float]:
    speed, acceleration = states[:, StateColumn.SPEED], states[:, StateColumn.ACCELERATION]
    log = everybody.record.log
    limits = limits_of(everybody.roads, keeping.visits, len(states), limit_events(
        log.game, everybody.record.fired, int(log.ks[0])))
    kept = keeping.kept
    return {
        **_named('speed', spread_of(speed)), **_named('acceleration', spread_of(acceleration)),
        **_named('jerk', spread_of(np.diff(acceleration) / everybody.step_s)),
        'time_above_limit': time_above(speed, limits, everybody.step_s),
        'time_with_limit': everybody.step_s * int(np.count_nonzero(np.isfinite(limits[:-1]))),
        'sdlp': sdlp(keeping.offset, kept, speed),
        'lane_offset_mean': spread_of(driven_offsets(keeping.offset, kept, speed)).mean,
        'lane_changes': float(len(keeping.changes)),
        'tlc_min': float(keeping.tlc_s[kept].min(initial=math.inf)),
        'tlc_linear_min': float(keeping.linear_s[kept].min(initial=math.inf))}


def _commands(controls: DriverControls) -> dict[str, float]:
    angles = controls.even_pieces(controls.wheel_deg)
    found = {'srr_visual': reversal_rate(angles, controls.dt_s, VISUAL),
             'srr_cognitive': reversal_rate(angles, controls.dt_s, COGNITIVE)}
    for name, travel in (('throttle', controls.throttle), ('brake', controls.brake)):
        use = use_of_pedal(controls.even_pieces(travel), controls.dt_s)
        found |= {**_named(name, use.travel), f'{name}_share': use.share,
                  f'{name}_applications': use.per_minute}
    return found


def _named(name: str, spread: Spread) -> dict[str, float]:
    return {f'{name}_mean': spread.mean, f'{name}_sd': spread.sd, f'{name}_min': spread.least,
            f'{name}_max': spread.most}


def _calm(everybody: _Everybody, states: FloatArray, keeping: LaneKeeping,
          controls: DriverControls) -> NDArray[np.bool_]:
    """Return at each command whether the steps around it allow a stable second."""
    calm = (keeping.beyond <= 0.0) & (
        np.abs(states[:, StateColumn.ACCELERATION]) <= STABLE_ACCELERATION)
    after = np.searchsorted(everybody.times_s, controls.times_s - 1e-9).clip(0, len(calm) - 1)
    return np.asarray(calm[after] & calm[np.maximum(after - 1, 0)])


def _requests(record: RunRecord, vehicle_id: str,
              events: Collection[str]) -> list[TakeOverRequest]:
    dt_s = record.log.game.scheduler.dt_s
    found = [TakeOverRequest(order.n * dt_s, 'order') for order in record.orders
             if order.seat == vehicle_id and order.source not in _BACK]
    found += [TakeOverRequest(event.n * dt_s, event.name) for event in record.fired
              if event.name in events]
    found += [TakeOverRequest(entry.n * dt_s, entry.task) for entry in record.tasks
              if entry.seat == vehicle_id and entry.what == 'request']
    return sorted(found)


def _gap(everybody: _Everybody, number: int, keeping: LaneKeeping,
         change: ChangeOfLane) -> LaneChangeGap:
    side = 'left' if change.side > 0 else 'right'
    if change.wheel is None:
        return LaneChangeGap(math.nan, side, AcceptedGap(None, None), None, None)
    outlines, velocities = everybody.at(change.wheel, everybody.transform(number))
    others = [each for each in range(len(outlines)) if each != number]
    gap = gap_in_lane(keeping.strips[change.visit], outlines[number], velocities[number],
                      [outlines[each] for each in others], velocities[others])

    def named(neighbour: Neighbour | None) -> str | None:
        return None if neighbour is None else everybody.ids[others[neighbour.number]]
    return LaneChangeGap(float(everybody.times_s[change.wheel]), side, gap, named(gap.leader),
                         named(gap.follower))
