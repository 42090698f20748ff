# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Reaction times of a driver to an event: with throttle, brake and steering wheel."""

import math
from typing import NamedTuple

from crgame_ros.analysis.behaviour.driver_controls import DriverControls
import numpy as np
from numpy.typing import NDArray


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
