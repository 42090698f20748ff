# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
A driver's use of pedals and steering wheel: evenly sampled, presses, and reversals.

G. Markkula, J. Engstroem: A steering wheel reversal rate metric for assessing effects of visual
and cognitive secondary task load. ITS World Congress, London, 2006.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
import math
from typing import NamedTuple

from crgame_ros.filters import low_passed, PADDING
from crgame_ros.recording.run_record import RunRecord
import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

# Recording gaps up to this length are interpolated linearly; a longer gap begins a new piece [s].
LONGEST_GAP_S = 0.1
# A shorter piece cannot show reversals of 0.6 Hz [s].
SHORTEST_S = 2.0


@dataclass(frozen=True)
class DriverControls:
    """
    The controls of one driver, at rising times; rows at which no human drove are left out.

    :param times_s: (R) of the commands since the run's start [s]
    :param throttle: (R) 0 to 1
    :param brake: (R) 0 to 1
    :param wheel_deg: (R) angle of the steering wheel, positive to the left [degrees]
    :param dt_s: nominal step between them [s]
    """

    times_s: FloatArray
    throttle: FloatArray
    brake: FloatArray
    wheel_deg: FloatArray
    dt_s: float

    @classmethod
    def from_commands(cls, times_s: FloatArray, commands: FloatArray, max_wheel_angle: float,
                      dt_s: float) -> 'DriverControls':
        """
        Build the controls from commands.

        :param commands: (R, 4) throttle, brake, steering in [-1, 1] and reverse; NaN where no
            human drove.
        :param max_wheel_angle: angle of the steering wheel at a steering of 1:
            theta_sw = s theta_sw,max (CRG III-C2b) [rad]
        """
        known = np.isfinite(commands[:, :3]).all(axis=1)
        throttle, brake, steering = commands[known, :3].T
        return cls(times_s[known], throttle, brake, math.degrees(max_wheel_angle) * steering, dt_s)

    @classmethod
    def of_vehicle(cls, record: RunRecord, number: int) -> 'DriverControls':
        """Build the controls of a driven vehicle of a run, by its number."""
        game = record.log.game
        return cls.from_commands(
            record.times_s, record.commands[:, number],
            game.vehicles[number].vehicle.max_steering_wheel_angle, game.scheduler.dt_s)

    def pieces(self) -> Iterator[slice]:
        """Yield the pieces in which the driver drove without a gap."""
        longest_s = max(LONGEST_GAP_S, self.dt_s) + 0.5 * self.dt_s
        gaps = np.flatnonzero(np.diff(self.times_s) > longest_s) + 1
        bounds = [0, *gaps.tolist(), len(self.times_s)]
        for first, end in zip(bounds[:-1], bounds[1:], strict=True):
            if end > first:
                yield slice(first, end)

    @property
    def driven_s(self) -> float:
        """Return the time driven by a human: each command counts as one step [s]."""
        return sum((self.times_s[piece][-1] - self.times_s[piece][0] + self.dt_s
                    for piece in self.pieces()), 0.0)

    def even_pieces(self, values: FloatArray) -> list[FloatArray]:
        """Resample values (R) at `times_s` linearly, each piece at the nominal step."""
        found = []
        for piece in self.pieces():
            times_s = self.times_s[piece]
            count = round((times_s[-1] - times_s[0]) / self.dt_s) + 1
            found.append(np.interp(times_s[0] + self.dt_s * np.arange(count), times_s,
                                   values[piece]))
        return found


class Spread(NamedTuple):
    """
    Statistics of values; NaN where there are none.

    :param sd: standard deviation with N - 1; NaN for fewer than two values.
    """

    mean: float
    sd: float
    least: float
    most: float


def spread_of(values: NDArray[np.float64]) -> Spread:
    """Return the spread of the finite values."""
    known = values[np.isfinite(values)]
    if not len(known):
        return Spread(math.nan, math.nan, math.nan, math.nan)
    return Spread(float(known.mean()), float(known.std(ddof=1)) if len(known) > 1 else math.nan,
                  float(known.min()), float(known.max()))


# Hysteresis: a pedal is applied from the first travel on, until it is back at the second [share].
PRESSED, RELEASED_AGAIN = 0.05, 0.02


class PedalUse(NamedTuple):
    """
    The use of a pedal.

    :param travel: pedal travel, 0 to 1.
    :param share: share of the time in which it was applied.
    :param per_minute: applications [1/min]
    """

    travel: Spread
    share: float
    per_minute: float


def applied(travel: FloatArray, pressed: float = PRESSED,
            released: float = RELEASED_AGAIN) -> NDArray[np.bool_]:
    """
    Return at each sample whether a pedal is applied, with hysteresis; it begins as released.

    :param travel: (N) 0 to 1, without a gap.
    :param pressed: travel at which it becomes applied.
    :param released: travel down to which it stays applied.
    """
    tells = (travel >= pressed) | (travel <= released)
    latest = np.maximum.accumulate(np.where(tells, np.arange(len(travel)), -1))
    return (latest >= 0) & (travel[latest] >= pressed)


def use_of_pedal(pieces: Sequence[FloatArray], dt_s: float) -> PedalUse:
    """
    Return how a pedal was used.

    :param pieces: pedal travel at intervals of dt, each piece without a gap; a piece that begins
        with the pedal pressed counts as one application there.
    """
    if not pieces:
        return PedalUse(spread_of(np.empty(0)), math.nan, math.nan)
    states = [applied(piece) for piece in pieces]
    count = sum(int(np.count_nonzero(np.diff(state, prepend=False) & state)) for state in states)
    lapse_s = dt_s * sum(map(len, pieces))
    return PedalUse(spread_of(np.concatenate(pieces)), float(np.concatenate(states).mean()),
                    60.0 * count / lapse_s)


class ReversalSetting(NamedTuple):
    """
    Settings of the reversal rate.

    :param cutoff_hz: cut-off frequency of the low pass [Hz]
    :param gap_deg: the wheel must turn by more than this angle [degrees]
    """

    cutoff_hz: float
    gap_deg: float


VISUAL = ReversalSetting(0.6, 3.0)
COGNITIVE = ReversalSetting(2.0, 0.1)


def stationary_points(angles_deg: FloatArray) -> FloatArray:
    """
    Return the angles at which the difference changes sign, or the previous one is zero.

    The first sample counts as one, as in the code of the authors.
    """
    steps = np.diff(angles_deg)
    before, after = steps[:-1], steps[1:]
    turns = (np.sign(before) * np.sign(after) < 0.0) | (before == 0.0)
    return np.concatenate((angles_deg[:1], angles_deg[1:-1][turns]))


def count_reversals(points_deg: FloatArray, gap_deg: float) -> int:
    """Count the reversals among stationary points, upwards and downwards."""
    return _upwards(points_deg, gap_deg) + _upwards(-points_deg, gap_deg)


def _upwards(points_deg: FloatArray, gap_deg: float) -> int:
    count, kept = 0, math.inf
    for point in points_deg.tolist():
        if point - kept > gap_deg:
            count, kept = count + 1, point
        elif point <= kept:
            kept = point
    return count


def reversal_rate(pieces: Sequence[FloatArray], dt_s: float, setting: ReversalSetting) -> float:
    """
    Return the reversals of a steering wheel per minute.

    :param pieces: angles of the steering wheel, each dt apart and without a gap; those shorter
        than `SHORTEST_S` are left out [degrees]
    :return: NaN if no piece is left, or the cut-off is beyond half the sampling rate [1/min]
    """
    long = [piece for piece in pieces
            if len(piece) * dt_s >= SHORTEST_S and len(piece) > PADDING]
    if not long or setting.cutoff_hz >= 0.5 / dt_s:
        return math.nan
    count = sum(count_reversals(stationary_points(low_passed(piece, dt_s, setting.cutoff_hz)),
                                setting.gap_deg) for piece in long)
    return 60.0 * count / (dt_s * sum(len(piece) - 1 for piece in long))
