# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A person at the page: opens it in a browser, takes a seat and drives with the keyboard."""

from collections.abc import Sequence
from itertools import pairwise
import math
import sys
import time

from crgame_ros.paths import share_directory
import numpy as np
from numpy.typing import NDArray

sys.path.insert(0, str(share_directory() / 'test' / 'browser'))

from browser_support import Browser, open_browser  # noqa: E402, I100 - importable from here on

__all__ = ['Browser', 'Person', 'open_browser']

# code, key and Windows key code, as the browser's input pipeline wants them.
KEYS = {'throttle': ('KeyW', 'w', 87), 'brake': ('KeyS', 's', 83),
        'left': ('KeyA', 'a', 65), 'right': ('KeyD', 'd', 68)}
# Look-ahead of a person [s], and at least [m].
LOOK_AHEAD_S, LOOK_AHEAD_M = 1.1, 8.0
# Keys are coarse: a value nearer than this to the wanted one is good enough.
STEERING_TOLERANCE_DEG, SPEED_TOLERANCE = 0.25, 0.6
POINTS_PER_PIECE = 40
# Of a passenger car [m].
WHEELBASE = 2.6
POLL_S = 0.02
STATE = """
const { store, driving } = window.crgame;
const index = store.vehicleIndex(driving.seat ?? store.scene.vehicles[0].id);
const { t, vehicles } = store.latest;
return [t, ...vehicles.slice(12 * index, 12 * index + 5)];
"""
LANES = """
return crgame.store.scene.lanelets.map(({ id, center }) => [id, center]);
"""
FloatArray = NDArray[np.float64]


class Person:
    """A person at a page that is open."""

    def __init__(self, browser: Browser) -> None:
        self.browser = browser
        self._held: set[str] = set()
        self._lanes: dict[str, FloatArray] = {}

    def take_seat(self, seat: str) -> None:
        """Press the button that claims a seat, and wait for it."""
        self.click(f'[data-seat="{seat}"] [data-action="claim"]')
        self.browser.wait(f"crgame.driving.seat === '{seat}'", 'the seat')
        self._lanes = {str(name): np.reshape(center, (-1, 2))
                       for name, center in self.browser.run(LANES)}

    def click(self, selector: str) -> None:
        """Click what a CSS selector finds, when it can be clicked."""
        self.browser.wait(f'document.querySelector({selector!r})?.disabled === false', selector)
        self.browser.run(f'document.querySelector({selector!r}).click()')

    def state(self) -> tuple[float, ...]:
        """Return t [s], x, y [m], yaw [rad], speed [m/s] and steering angle [rad]."""
        values: Sequence[float] = self.browser.run(STATE)
        return tuple(values)

    def drive(self, lanes: Sequence[int], speed: float, until_s: float) -> None:
        """
        Follow lanes with the keys.

        :param lanes: ids of lanelets, one after the other
        :param speed: wanted [m/s]
        :param until_s: simulation time at which it returns, the keys still held [s]
        """
        path = np.concatenate([self._lanes[str(lane)] for lane in lanes])
        while True:
            t, x, y, yaw, now, angle = self.state()
            if t >= until_s:
                return
            wanted = wheel_angle(path, (x, y, yaw), max(now, 0.0))
            off_deg = math.degrees(wanted - angle)
            self.hold({name for name, pressed in (
                ('left', off_deg > STEERING_TOLERANCE_DEG),
                ('right', off_deg < -STEERING_TOLERANCE_DEG),
                ('throttle', now < speed - SPEED_TOLERANCE),
                ('brake', now > speed + 3.0 * SPEED_TOLERANCE)) if pressed})
            time.sleep(POLL_S)

    def hold(self, names: set[str]) -> None:
        """Hold these keys and no others."""
        for name in self._held - names:
            self._key('keyUp', name)
        for name in names - self._held:
            self._key('keyDown', name)
        self._held = set(names)

    def wait_until(self, t: float) -> None:
        """Wait for a simulation time [s]."""
        self.browser.wait(f'crgame.store.latest?.t >= {t}', f't = {t} s', 60.0)

    def _key(self, kind: str, name: str) -> None:
        code, key, number = KEYS[name]
        self.browser.driver.execute_cdp_cmd('Input.dispatchKeyEvent', {
            'type': kind, 'code': code, 'key': key, 'windowsVirtualKeyCode': number})


def wheel_angle(path: FloatArray, pose: tuple[float, float, float], speed: float) -> float:
    """
    Return the angle of the front wheels that leads onto a path: pure pursuit [rad].

    :param path: (N, 2) points [m]
    :param pose: x, y [m] and yaw [rad] of the rear axle
    :param speed: by which the look-ahead grows [m/s]
    """
    x, y, yaw = pose
    along = np.linspace(0.0, 1.0, POINTS_PER_PIECE)[:, None]
    points = np.concatenate([a + along * (b - a) for a, b in pairwise(path)]) - (x, y)
    ahead = points @ np.array((math.cos(yaw), math.sin(yaw)))
    side = points @ np.array((-math.sin(yaw), math.cos(yaw)))
    distance = np.hypot(ahead, side)
    reach = max(LOOK_AHEAD_M, LOOK_AHEAD_S * speed)
    aim = int(np.argmin(np.where(ahead > 0.0, np.abs(distance - reach), np.inf)))
    return math.atan2(2.0 * WHEELBASE * float(side[aim]), float(distance[aim]) ** 2)
