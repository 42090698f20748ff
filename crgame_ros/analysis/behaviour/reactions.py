# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Reaction times of a driver to an event, and take-overs of an AV."""

from collections.abc import Sequence
import math
from typing import NamedTuple

from crgame_ros.analysis.behaviour.driver_controls import DriverControls
import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

# The first such input counts as hands on (Gold et al. 2013): pedal travel [share], or the
# steering wheel's deviation from its angle when the human took over [degrees].
PEDAL_INPUT, WHEEL_INPUT_DEG = 0.1, 2.0
# A request that is older than this did not lead to the take-over [s].
LONGEST_WAIT_S = 60.0
# A second is stable if the steering wheel stays within this range [degrees].
STABLE_S, STABLE_WHEEL_DEG = 1.0, 10.0


class ResponseLimits(NamedTuple):
    """
    Limits that define a response.

    :param window_s: time after the event in which a response counts [s]
    :param throttle_release: decrease of the throttle from its value at the event [share]
    :param brake_press: brake travel from which on the brake counts as pressed [share]
    :param wheel_rate_deg: rate of the steering wheel in either direction [degrees/s]
    :param rate_time_s: time over which that rate is measured, so that it depends neither on the
        simulation's rate nor on the resolution of a wheel [s]
    """

    window_s: float = 5.0
    throttle_release: float = 0.1
    brake_press: float = 0.05
    wheel_rate_deg: float = 20.0
    rate_time_s: float = 0.1


USUAL_LIMITS = ResponseLimits()


class Reaction(NamedTuple):
    """
    The times from an event to the first response of each kind, NaN without one [s].

    :param throttle_s: time until the throttle was released.
    :param brake_s: time until the brake was pressed.
    :param steering_s: time until the steering wheel was turned.
    """

    throttle_s: float
    brake_s: float
    steering_s: float


def reaction_to(event_s: float, controls: DriverControls,
                limits: ResponseLimits = USUAL_LIMITS) -> Reaction:
    """
    Find the first responses to an event.

    A response begins after the event. A driver who is braking or steering already responds only
    by doing so again. A throttle that is pressed by less than `throttle_release` cannot be
    released by that amount. All times are NaN where no human drove at the event.

    :param event_s: time at which the event took effect, since the run's start [s]
    """
    times_s = controls.times_s
    # The first command belongs to the first step: an event at the start is before it.
    at = max(int(np.searchsorted(times_s, event_s + 1e-9)) - 1, 0)
    if not len(times_s) or abs(times_s[at] - event_s) > 1.5 * controls.dt_s:
        return Reaction(math.nan, math.nan, math.nan)
    end = int(np.searchsorted(times_s, event_s + limits.window_s + 1e-9))
    wheel, until = controls.wheel_deg[:end], times_s[at:end]
    rates = np.abs(wheel[at:] - np.interp(until - limits.rate_time_s, times_s[:end], wheel)) \
        / limits.rate_time_s
    throttle = controls.throttle[at:end]
    low = throttle[0] - limits.throttle_release
    released = throttle <= low + 1e-9 if low >= -1e-9 else np.zeros(len(throttle), dtype=bool)
    return Reaction(*(
        _first_onset(responds, until) - event_s for responds in (
            released, controls.brake[at:end] >= limits.brake_press,
            rates >= limits.wheel_rate_deg)))


def _first_onset(responds: NDArray[np.bool_], times_s: NDArray[np.float64]) -> float:
    """Return the first time at which the response begins; NaN without one."""
    onsets = np.flatnonzero(responds[1:] & ~responds[:-1])
    return float(times_s[onsets[0] + 1]) if len(onsets) else math.nan


class TakeOverRequest(NamedTuple):
    """
    A request that a human take over an AV.

    :param time_s: since the run's start [s]
    :param by: `order` for an order of the seat, or the name of an event or task.
    """

    time_s: float
    by: str


class TakeOver(NamedTuple):
    """
    A take-over of an AV; times since the run's start, NaN where it did not happen [s].

    :param request: request that led to it; None where none is known.
    :param seat_s: first command that the vehicle obeyed.
    :param end_s: last such command.
    :param hands_on_s: first input.
    :param stable_s: start of the first stable second after that input.
    """

    request: TakeOverRequest | None
    seat_s: float
    end_s: float
    hands_on_s: float
    stable_s: float

    @property
    def to_hands_on_s(self) -> float:
        """Return the time from the request to hands on; NaN where one is missing [s]."""
        return math.nan if self.request is None else self.hands_on_s - self.request.time_s

    @property
    def to_stable_s(self) -> float:
        """Return the time from request to first stable second; NaN if one is missing [s]."""
        return math.nan if self.request is None else self.stable_s - self.request.time_s

    def values(self) -> dict[str, object]:
        """Return its values by the names of tables and JSON; NaN or None where there is none."""
        return {'request': None if self.request is None else self.request.by,
                'request_s': None if self.request is None else self.request.time_s,
                'seat_s': self.seat_s, 'end_s': self.end_s,
                'hands_on_s': self.hands_on_s, 'stable_s': self.stable_s,
                'take_over_hands_on': self.to_hands_on_s,
                'take_over_stable': self.to_stable_s}


def find_take_overs(controls: DriverControls, calm: NDArray[np.bool_],
                    requests: Sequence[TakeOverRequest]) -> tuple[TakeOver, ...]:
    """
    Find the take-overs of an AV.

    A request belongs to the first take-over after it; of several requests the first counts.

    :param controls: human controls of the AV; each piece of them is a take-over.
    :param calm: (R) whether vehicle and lane allow a stable second at each command: no wheel
        beyond a boundary of its lane, and no hard acceleration.
    :param requests: in order of time.
    """
    found: list[TakeOver] = []
    for piece in controls.pieces():
        times_s = controls.times_s[piece]
        since_s = max(found[-1].end_s if found else -math.inf, times_s[0] - LONGEST_WAIT_S)
        request = next((each for each in requests
                        if since_s < each.time_s <= times_s[0] + 1e-9), None)
        hands_on = _hands_on(controls, piece)
        stable = math.nan if hands_on is None else _stable(
            times_s[hands_on:], controls.wheel_deg[piece][hands_on:], calm[piece][hands_on:],
            controls.dt_s)
        found.append(TakeOver(request, float(times_s[0]), float(times_s[-1]),
                              math.nan if hands_on is None else float(times_s[hands_on]), stable))
    return tuple(found)


def hands_on_after(controls: DriverControls, request_s: float) -> float:
    """
    Return the time from a request to hands on in the first take-over after it.

    :param controls: human controls of the AV.
    :return: NaN without a take-over within `LONGEST_WAIT_S`, or without an input in it [s]
    """
    for piece in controls.pieces():
        begin_s = controls.times_s[piece][0]
        if request_s <= begin_s + 1e-9 and begin_s - request_s <= LONGEST_WAIT_S:
            hands_on = _hands_on(controls, piece)
            return math.nan if hands_on is None else float(
                controls.times_s[piece][hands_on] - request_s)
    return math.nan


def _hands_on(controls: DriverControls, piece: slice) -> int | None:
    """Return the row of the first input in a piece."""
    turned = np.abs(controls.wheel_deg[piece] - controls.wheel_deg[piece][0])
    inputs = np.flatnonzero((controls.throttle[piece] >= PEDAL_INPUT)
                            | (controls.brake[piece] >= PEDAL_INPUT)
                            | (turned >= WHEEL_INPUT_DEG))
    return int(inputs[0]) if len(inputs) else None


def _stable(times_s: FloatArray, wheel_deg: FloatArray, calm: NDArray[np.bool_],
            dt_s: float) -> float:
    """Return the beginning of the first stable second, NaN without one."""
    ends = np.searchsorted(times_s, times_s + STABLE_S - 0.5 * dt_s)
    for row, end in enumerate(ends.tolist()):
        if end == len(times_s):
            break
        within = wheel_deg[row:end + 1]
        if calm[row:end + 1].all() and np.ptp(within) <= STABLE_WHEEL_DEG:
            return float(times_s[row])
    return math.nan
