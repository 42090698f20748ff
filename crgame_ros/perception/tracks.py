# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A short memory of what was seen, and where it is taken to go."""

from crgame_ros.geometry.angles import wrap_pi_array
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Index = NDArray[np.intp]

# What a road vehicle turns at most: the tightest curve [1/m] and the force that its tyres and
# passengers bear [m/s^2]. Recorded headings are too rough to be trusted beyond that.
MAX_CURVATURE = 0.2
MAX_LATERAL_ACCELERATION = 4.0


class Tracks:
    """
    The last seen state of each thing that can appear.

    Which thing it was is known: identities are kept, no measurement is attributed to another.
    Things move on at constant velocity, vehicles that are seen turning at constant turn rate.

    :param turning: (T) whether a thing turns as vehicles do
    :param dt_s: simulation step [s]
    """

    def __init__(self, turning: NDArray[np.bool_], dt_s: float) -> None:
        count = len(turning)
        self._turning = turning
        self._dt_s = dt_s
        self._poses: Array = np.full((count, 3), np.nan)
        self._velocities: Array = np.full((count, 3), np.nan)
        self._seen_n = np.full(count, -1, dtype=np.int64)
        self._until_n = np.full(count, -1, dtype=np.int64)

    def update(self, things: Index, n: int, until_n: int, poses: Array,
               velocities: Array) -> None:
        """
        Take what was seen at step n; an older view does not replace a newer one.

        :param things: (D) which things
        :param until_n: the step at which they are forgotten, unless they are seen again
        :param poses: (D, 3) poses of their reference points
        :param velocities: (D, 3)
        """
        newer = n >= self._seen_n[things]
        chosen = things[newer]
        self._poses[chosen] = poses[newer]
        self._velocities[chosen] = velocities[newer]
        self._seen_n[chosen] = n
        self._until_n[things] = np.maximum(self._until_n[things], until_n)

    def known(self, n: int) -> NDArray[np.bool_]:
        """Return which things (T) are seen or remembered at step n."""
        found: NDArray[np.bool_] = n < self._until_n
        return found

    def predict(self, things: Index, n: int, times_s: Array) -> tuple[Array, Array]:
        """
        Return where known things are at step n and go from there.

        :param things: (D) which things
        :param times_s: (P) from n on [s]
        :return: poses and velocities, both (P, D, 3)
        """
        poses, velocities = self._poses[things], self._velocities[things]
        age = self._dt_s * (n - self._seen_n[things])
        time = age + times_s[:, None]
        speed = np.hypot(velocities[:, 0], velocities[:, 1])
        limit = np.minimum(MAX_CURVATURE * speed,
                           MAX_LATERAL_ACCELERATION / np.maximum(speed, 1e-3))
        rate = np.where(self._turning[things], np.clip(velocities[:, 2], -limit, limit), 0.0)
        turn = rate * time
        # A chord of an arc is v t sinc(half the turn) long.
        chord = time * np.sinc(turn / (2.0 * np.pi))
        moved = chord[..., None] * _rotated(velocities, 0.5 * turn)
        ahead = np.concatenate((poses[:, :2] + moved, (poses[:, 2] + turn)[..., None]), axis=-1)
        ahead[..., 2] = wrap_pi_array(ahead[..., 2])
        onward = np.concatenate(
            (_rotated(velocities, turn), np.broadcast_to(rate, turn.shape)[..., None]), axis=-1)
        return ahead, onward


def _rotated(velocities: Array, turn: Array) -> Array:
    """Rotate velocities (D, 3) by angles (P, D); gives (P, D, 2)."""
    cos, sin = np.cos(turn), np.sin(turn)
    x, y = velocities[:, 0], velocities[:, 1]
    return np.stack((cos * x - sin * y, sin * x + cos * y), axis=-1)
