# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""How soon a driver responds to an event: with the throttle, the brake and the steering wheel."""

import math
from typing import NamedTuple

from crgame_ros.analysis.behaviour.driver_controls import DriverControls
import numpy as np
from numpy.typing import NDArray


class ResponseLimits(NamedTuple):
    """
    What counts as a response.

    :param window_s: after the event in which one is looked for [s]
    :param throttle_release: by which the throttle is below where it was at the event [share]
    :param brake_press: from which travel on the brake is pressed [share]
    :param wheel_rate_deg: at which the steering wheel is turned, either way [degrees/s]
    """

    window_s: float = 5.0
    throttle_release: float = 0.1
    brake_press: float = 0.05
    wheel_rate_deg: float = 20.0


USUAL_LIMITS = ResponseLimits()


class Reaction(NamedTuple):
    """
    The time from an event to the first response of each kind, NaN without one [s].

    :param throttle_s: until the throttle was released.
    :param brake_s: until the brake was pressed.
    :param steering_s: until the steering wheel was turned.
    """

    throttle_s: float
    brake_s: float
    steering_s: float


def reaction_to(event_s: float, controls: DriverControls,
                limits: ResponseLimits = USUAL_LIMITS) -> Reaction:
    """
    Find the first responses to an event.

    A response begins after the event: who is braking or steering already responds when he does it
    anew, and a throttle that is pressed by less than the stated amount cannot be released by it.
    All NaN where nobody drove at the event.

    :param event_s: when it took effect, since the run's start [s]
    """
    times_s = controls.times_s
    # The first command comes of the first step: an event at the start lies before it.
    at = max(int(np.searchsorted(times_s, event_s + 1e-9)) - 1, 0)
    if not len(times_s) or abs(times_s[at] - event_s) > 1.5 * controls.dt_s:
        return Reaction(math.nan, math.nan, math.nan)
    end = int(np.searchsorted(times_s, event_s + limits.window_s + 1e-9))
    turned = np.abs(np.diff(controls.wheel_deg[:end])) / np.diff(times_s[:end])
    rates = np.concatenate(([0.0], turned))[at:]
    throttle = controls.throttle[at:end]
    low = throttle[0] - limits.throttle_release
    released = throttle <= low + 1e-9 if low >= -1e-9 else np.zeros(len(throttle), dtype=bool)
    return Reaction(*(
        _first_onset(responds, times_s[at:end]) - event_s for responds in (
            released, controls.brake[at:end] >= limits.brake_press,
            rates >= limits.wheel_rate_deg)))


def _first_onset(responds: NDArray[np.bool_], times_s: NDArray[np.float64]) -> float:
    """Return the time of the first that responds after one that does not; NaN without one."""
    onsets = np.flatnonzero(responds[1:] & ~responds[:-1])
    return float(times_s[onsets[0] + 1]) if len(onsets) else math.nan
