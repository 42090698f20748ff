# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Measures how each driven vehicle of a run was driven, and says it in lines of text.

`MEASURES` defines each measure; `docs/behaviour.md` explains them.
"""

from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass
import math

from crgame_ros.analysis.behaviour.driver_controls import (
    COGNITIVE,
    DriverControls,
    reversal_rate,
    ReversalSetting,
    Spread,
    spread_of,
    use_of_pedal,
    VISUAL,
)
from crgame_ros.analysis.behaviour.gaps_accepted import AcceptedGap, gap_in_lane, Neighbour
from crgame_ros.analysis.behaviour.lane_keeping import (
    ChangeOfLane,
    driven_offsets,
    keep_lane,
    LaneKeeping,
    sdlp,
)
from crgame_ros.analysis.behaviour.lane_visits import LaneVisit
from crgame_ros.analysis.behaviour.measures import MEASURES, STABLE_ACCELERATION
from crgame_ros.analysis.behaviour.reactions import (
    find_take_overs,
    Reaction,
    reaction_to,
    ResponseLimits,
    TakeOver,
    TakeOverRequest,
    USUAL_LIMITS,
)
from crgame_ros.analysis.behaviour.task_events import DetectionScore
from crgame_ros.finite_json import finite
from crgame_ros.game.documents import GameDocument
from crgame_ros.game.events import SpeedLimit
from crgame_ros.geometry.outline import outline, placed
from crgame_ros.geometry.reference_point import shifted, shifted_velocities
from crgame_ros.recording.run_record import RunRecord
from crgame_ros.roads.network import RoadNetwork
from crgame_ros.scenario.loading import parse_scenario
from crgame_ros.vehicle.state import pose_rates, StateColumn
import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class EventReaction:
    """A driver's reaction to an event, with the event's time since the run's start [s]."""

    event: str
    event_s: float
    reaction: Reaction

    def values(self) -> dict[str, object]:
        """Return its values by the names of tables and JSON; NaN where there is none."""
        return {'event': self.event, 'time_s': self.event_s,
                'reaction_throttle': self.reaction.throttle_s,
                'reaction_brake': self.reaction.brake_s,
                'reaction_steering': self.reaction.steering_s}


@dataclass(frozen=True)
class LaneChangeGap:
    """
    The gap that a driver accepted.

    :param time_s: time at which the first wheel crossed, since the run's start; NaN if it was
        across before [s]
    :param side: `left` or `right`.
    :param gap: in the lane entered.
    :param leader: id of the leader in that lane, None without one; `follower` likewise.
    """

    time_s: float
    side: str
    gap: AcceptedGap
    leader: str | None
    follower: str | None

    def values(self) -> dict[str, object]:
        """Return its values by the names of tables and JSON; NaN or None where there is none."""
        found: dict[str, object] = {'time_s': self.time_s, 'side': self.side}
        for who, name, gap in (('leader', self.leader, self.gap.leader),
                               ('follower', self.follower, self.gap.follower)):
            found |= {who: name, f'gap_to_{who}': None if gap is None else gap.gap,
                      f'gap_accepted_{who}': None if gap is None else gap.time_gap_s}
        return found


@dataclass(frozen=True)
class DriverBehaviour:
    """
    The behaviour of a vehicle's driver.

    :param human: whether the game assigns a human driver; an AV is driven by its planner except
        during take-overs, and its measures of motion cover both.
    :param driven_s: time for which commands of a human drove it [s]
    :param values: by name, the measures of `MEASURES` with one value per vehicle.
    :param reactions: reactions to each event.
    :param limits: limits that defined a response.
    :param lane_changes: lane changes with the gaps accepted.
    :param take_overs: take-overs of an AV.
    :param times_s: (K) times of the steps, since the run's start [s]
    :param tlc_s: (K) time to lane crossing; NaN off the lanes, inf without a crossing [s]
    :param tlc_linear_s: (K) its linear form [s]
    """

    vehicle_id: str
    human: bool
    driven_s: float
    values: dict[str, float]
    reactions: tuple[EventReaction, ...]
    limits: ResponseLimits
    lane_changes: tuple[LaneChangeGap, ...]
    take_overs: tuple[TakeOver, ...]
    times_s: FloatArray
    tlc_s: FloatArray
    tlc_linear_s: FloatArray

    def as_dict(self) -> dict[str, object]:
        """Return the fields as a JSON-compatible dictionary; None where a value is not finite."""
        return {
            'human': self.human, 'driven_s': self.driven_s,
            'measures': {name: {'value': finite(value), 'unit': MEASURES[name].unit}
                         for name, value in self.values.items()},
            'reactions': [finite(each.values()) for each in self.reactions],
            'response_limits': self.limits._asdict(),
            'lane_changes': [finite(each.values()) for each in self.lane_changes],
            'take_overs': [finite(each.values()) for each in self.take_overs]}


def time_above(speed: FloatArray, limits: FloatArray, step_s: float) -> float:
    """Return the time above a limit [s], NaN if there is none; states count until the next."""
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
        self.times_s = log.times_s
        self.ids = [item.id for item in log.descriptions]
        self._outlines = [outline(item.shape, _CIRCLE_CORNERS) for item in log.descriptions]
        self._ahead = np.array([item.rear_to_center for item in log.vehicles])

    def at(self, row: int, number: int) -> tuple[list[FloatArray], FloatArray]:
        """
        Return centres with corners (C + 1, 2) each, and velocities (N, 2), at a step.

        :param number: the driven vehicle whose road gives the coordinates.
        """
        log = self.record.log
        transform = log.road_transforms[number]
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
    states = log.states_on_road(number)
    keeping = keep_lane(everybody.roads, states, vehicle, everybody.step_s,
                        record.jumps(number))
    dt_s = game.scheduler.dt_s
    controls = DriverControls.of_vehicle(record, number)
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
    limits = _limits(everybody, keeping.visits, len(states))
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


def _limits(everybody: _Everybody, visits: Sequence[LaneVisit], count: int) -> FloatArray:
    """Return the limits (K) of signs and events: NaN off the lanes and without one [m/s]."""
    log, fired = everybody.record.log, everybody.record.fired
    actions = {event.name: event.action for event in log.game.events
               if isinstance(event.action, SpeedLimit)}
    events = [(event.k - int(log.ks[0]), actions[event.name]) for event in fired
              if event.name in actions]
    limits = np.full(count, np.nan)
    for visit in visits:
        signed = everybody.roads.speed_limit(visit.lanelet)
        limits[visit.first:visit.end] = math.nan if signed is None else signed
        for step, event in events:
            if not event.lanelets or visit.lanelet in event.lanelets:
                limits[max(visit.first, step):visit.end] = event.speed
    return limits


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
    outlines, velocities = everybody.at(change.wheel, number)
    others = [each for each in range(len(outlines)) if each != number]
    gap = gap_in_lane(keeping.strips[change.visit], outlines[number], velocities[number],
                      [outlines[each] for each in others], velocities[others])

    def named(neighbour: Neighbour | None) -> str | None:
        return None if neighbour is None else everybody.ids[others[neighbour.number]]
    return LaneChangeGap(float(everybody.times_s[change.wheel]), side, gap, named(gap.leader),
                         named(gap.follower))


def behaviour_lines(found: DriverBehaviour) -> Iterator[str]:
    """Yield lines on how a vehicle was driven; undefined values are left out."""
    values = found.values
    yield f'{found.vehicle_id} as it was driven'
    for name in ('speed', 'acceleration', 'jerk'):
        yield _line(f'{name}_mean', values[f'{name}_mean'],
                    f'{name}, sd {values[f"{name}_sd"]:.2f}, '
                    f'{values[f"{name}_min"]:.2f} to {values[f"{name}_max"]:.2f}')
    lines = [
        ('time_above_limit', f'of {values["time_with_limit"]:.1f} s with a speed limit'),
        ('sdlp', f'of the centre, N - 1; lane changes cut out: {values["lane_changes"]:.0f}'),
        ('tlc_min', 'smallest time to lane crossing, speed and yaw rate held'),
        ('tlc_linear_min', 'the same by distance and speed towards the boundary'),
        ('srr_visual', _setting(VISUAL)), ('srr_cognitive', _setting(COGNITIVE)),
        *((f'{pedal}_applications', f'applied {100.0 * values[f"{pedal}_share"]:.0f} % of the '
           'time') for pedal in ('throttle', 'brake'))]
    for name, text in lines:
        if math.isfinite(values[name]):
            yield _line(name, values[name], text)
    for each in found.reactions:
        for name, value in zip(('throttle', 'brake', 'steering'), each.reaction, strict=True):
            if math.isfinite(value):
                yield _line(f'reaction_{name}', value, f'after {each.event} at '
                            f'{each.event_s:.1f} s')
    for change in found.lane_changes:
        yield from _lane_change_lines(change)
    for take_over in found.take_overs:
        yield from _take_over_lines(take_over)


def detection_lines(found: DetectionScore) -> Iterator[str]:
    """Yield lines on a driver's results in a detection response task."""
    yield f'{found.task}, answered in {found.seat}'
    yield (f'  hit_rate             {found.hit_rate:9.2f}        {found.hits} hits, '
           f'{found.misses} misses, {found.premature} premature, {found.unrequested} unrequested')
    if found.hits:
        yield (f'  response_mean        {found.response_mean_s:9.2f} s      median '
               f'{found.response_median_s:.2f}, by the page that showed the light')


def _line(name: str, value: float, text: str) -> str:
    return f'  {name:<21}{value:9.2f} {MEASURES[name].unit:<6} {text}'.rstrip()


def _setting(setting: ReversalSetting) -> str:
    return f'steering reversals of {setting.gap_deg:g} degrees, {setting.cutoff_hz:g} Hz'


def _lane_change_lines(change: LaneChangeGap) -> Iterator[str]:
    if math.isnan(change.time_s):
        return
    where = f'to the {change.side} at {change.time_s:.1f} s'
    told = False
    for role in ('leader', 'follower'):
        neighbour: Neighbour | None = getattr(change.gap, role)
        if neighbour is not None and math.isfinite(neighbour.time_gap_s):
            told = True
            yield _line(f'gap_accepted_{role}', neighbour.time_gap_s,
                        f'{getattr(change, role)} in {neighbour.gap:.1f} m, {where}')
    if not told:
        yield f'  lane change {where}: no vehicle near'


def _take_over_lines(take_over: TakeOver) -> Iterator[str]:
    by = '' if take_over.request is None else f', asked for by {take_over.request.by}'
    yield f'  taken over from {take_over.seat_s:.1f} to {take_over.end_s:.1f} s{by}'
    for name, value in (('take_over_hands_on', take_over.to_hands_on_s),
                        ('take_over_stable', take_over.to_stable_s)):
        if math.isfinite(value):
            yield _line(name, value, 'after the request')
