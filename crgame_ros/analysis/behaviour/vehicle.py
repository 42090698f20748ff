# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The measured behaviour of a vehicle: values, reactions, lane changes and take-overs."""

from dataclasses import dataclass
import math

from crgame_ros.analysis.behaviour.gaps_accepted import AcceptedGap, Neighbour
from crgame_ros.analysis.behaviour.measures import MEASURES
from crgame_ros.analysis.behaviour.reactions import Reaction, ResponseLimits
from crgame_ros.analysis.behaviour.take_overs import TakeOver
import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class EventReaction:
    """A driver's reaction to an event, with the event's time since the run's start [s]."""

    event: str
    event_s: float
    reaction: Reaction


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


@dataclass(frozen=True)
class DriverBehaviour:
    """
    The behaviour of a vehicle's driver.

    :param vehicle_id: id of the vehicle.
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

    def as_dict(self, series: bool = False) -> dict[str, object]:
        """
        Return the fields as a JSON-compatible dictionary; None where a value is not finite.

        :param series: whether to include the time series.
        """
        found: dict[str, object] = {
            'human': self.human, 'driven_s': self.driven_s,
            'measures': {name: {'value': _finite(value), 'unit': MEASURES[name].unit}
                         for name, value in self.values.items()},
            'reactions': [{
                'event': each.event, 'time_s': each.event_s,
                'reaction_throttle': _finite(each.reaction.throttle_s),
                'reaction_brake': _finite(each.reaction.brake_s),
                'reaction_steering': _finite(each.reaction.steering_s)}
                for each in self.reactions],
            'response_limits': self.limits._asdict(),
            'lane_changes': [_lane_change(each) for each in self.lane_changes],
            'take_overs': [_take_over_values(each) for each in self.take_overs]}
        if series:
            found['series'] = {'time_s': self.times_s.tolist(),
                               'tlc': list(map(_finite, self.tlc_s.tolist())),
                               'tlc_linear': list(map(_finite, self.tlc_linear_s.tolist()))}
        return found


def _lane_change(change: LaneChangeGap) -> dict[str, object]:
    found: dict[str, object] = {'time_s': _finite(change.time_s), 'side': change.side}
    for name in ('leader', 'follower'):
        neighbour: Neighbour | None = getattr(change.gap, name)
        found |= {name: getattr(change, name),
                  f'gap_to_{name}': None if neighbour is None else neighbour.gap,
                  f'gap_accepted_{name}':
                  None if neighbour is None else _finite(neighbour.time_gap_s)}
    return found


def _take_over_values(take_over: TakeOver) -> dict[str, object]:
    request = take_over.request
    return {'request': None if request is None else request.by,
            'request_s': None if request is None else request.time_s,
            'seat_s': take_over.seat_s, 'end_s': take_over.end_s,
            'hands_on_s': _finite(take_over.hands_on_s),
            'stable_s': _finite(take_over.stable_s),
            'take_over_hands_on': _finite(take_over.to_hands_on_s),
            'take_over_stable': _finite(take_over.to_stable_s)}


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None
