# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Force feedback: the limits of the torque, and the conditions that end it."""

import errno
import math
import os
from pathlib import Path
import random
import select
import signal
import socket
import struct
import subprocess
import sys
import threading
import time

from crgame_ros.driver.device_map import (
    ForceLimits,
    load_device_map,
    load_device_maps,
    TorqueLimiter,
)
from crgame_ros.driver.evdev_device import open_evdev
from crgame_ros.driver.force_feedback import (
    ForceFeedback,
    FULL_LEVEL,
    LENGTH_MS,
    RENEWAL_S,
    STATE_TIMEOUT_S,
    SteeringTorque,
)
from crgame_ros.errors import InputError
from crgame_ros.vehicle.parameters import load_vehicle_parameters
from evdev import AbsInfo, ecodes, ff, UInput
import numpy as np
from pushed_wheel import EFFECT_SIZE, ERASE, Motor, PushedWheel, raw_of, UPLOAD, wheel_at
import pytest

CAR = load_vehicle_parameters()
MODEL = SteeringTorque(CAR)
# Of a bend of 20 m/s at 5 m/s^2 [rad].
WHEEL = wheel_at(20.0, 0.25)
ROOT = Path(__file__).parents[2]
STEP_S = 0.008
G29 = 'Logitech G29 Driving Force Racing Wheel'
needs_uinput = pytest.mark.skipif(
    not (os.access('/dev/uinput', os.W_OK) and os.path.isdir('/dev/input')),
    reason='no writable /dev/uinput and /dev/input: virtual devices cannot be made here')


def test_cap_and_slew_hold_whatever_is_asked() -> None:
    """Cap and slew rate hold for random torques, also NaN and infinite, at random intervals."""
    draw = random.Random(11)
    for _ in range(50):
        limits = ForceLimits(max_torque=draw.uniform(0.5, 20.0), strength=draw.uniform(0.0, 5.0),
                             cap=draw.random(), slew=draw.uniform(1.0, 200.0))
        limiter, before = TorqueLimiter(limits), 0.0
        for _ in range(200):
            wanted = draw.choice((draw.gauss(0.0, 30.0), math.inf, -math.inf, math.nan, 0.0))
            dt_s = draw.choice((0.0, -1.0, draw.uniform(0.0, 0.3)))
            now = limiter.step(wanted, dt_s)
            assert abs(now) <= limits.cap * limits.max_torque + 1e-12
            assert abs(now - before) <= limits.slew * max(0.0, dt_s) + 1e-9
            before = now


class Drive:
    """A wheel, and a vehicle in a bend of 20 m/s at 5 m/s^2."""

    def __init__(self, limits: ForceLimits | None = None) -> None:
        self.motor = Motor()
        self.wheel = PushedWheel(self.motor, limits)
        self.wheel.turn(WHEEL)
        self.force = ForceFeedback(self.wheel, CAR)
        self.now_s = 100.0

    def go(self, seconds: float, *, seen: bool = True, driving: bool = True) -> float:
        """Advance time, with or without new states; return the last torque, 0 without a motor."""
        torque = 0.0
        for _ in range(round(seconds / STEP_S)):
            self.now_s += STEP_S
            if seen:
                self.force.see_motion(self.now_s, self.now_s - 99.0, 20.0, 0.25)
            felt = self.force.step(self.now_s, driving)
            torque = 0.0 if felt is None else felt.torque
        return torque


def test_a_bend_pushes_back_through_one_effect() -> None:
    """One upload makes the effect, others change it; it is renewed long before it expires."""
    drive = Drive()
    torque = drive.go(1.0)
    assert torque == pytest.approx(MODEL.aligning(20.0, 0.25, WHEEL), abs=1e-3)
    assert drive.motor.levels[-1] == round(FULL_LEVEL * torque / 2.1) < 0
    assert len(drive.motor.levels) == 126 and drive.motor.effects == {7}
    plays = [event for event in drive.motor.events if event[1:] == (7, 1)]
    assert len(plays) >= 1.0 / (RENEWAL_S + STEP_S) > 2 * 1000.0 / LENGTH_MS
    assert (ecodes.EV_FF, ecodes.FF_AUTOCENTER, 0) in drive.motor.events
    drive.force.close()
    assert not drive.motor.effects and drive.motor.events[-1] == (ecodes.EV_FF, 7, 0)


@pytest.mark.parametrize('how', [{'seen': False}, {'driving': False}], ids=['pause', 'seat'])
def test_the_force_ends_with_the_states_or_the_seat(how: dict[str, bool]) -> None:
    """After 0.2 s without a state (pause, lost simulation) the force falls at the slew rate."""
    drive = Drive()
    torque = drive.go(1.0)
    fall_s = abs(torque) / 60.0
    assert drive.go(STATE_TIMEOUT_S + fall_s + 3 * STEP_S, **how) == 0.0
    assert drive.motor.levels[-1] == 0
    if how == {'driving': False}:
        return
    # The simulation's clock stands: messages of the same stamp are no new states.
    drive.force.see_motion(drive.now_s, drive.force._time_s, 20.0, 0.25)
    assert drive.go(0.1, **how) == 0.0
    assert drive.go(1.0) == pytest.approx(torque)


def test_strength_direction_and_cap_are_the_maps() -> None:
    """The map sets twice the strength, an inverted motor of 1 N m, and a cap of 60 %."""
    limits = ForceLimits(max_torque=1.0, strength=2.0, cap=0.6, inverted=True)
    drive = Drive(limits)
    assert drive.go(1.0) == pytest.approx(-0.6)
    assert drive.motor.levels[-1] == round(0.6 * FULL_LEVEL)
    still = Drive(ForceLimits(max_torque=1.0, strength=0.0))
    assert still.go(0.1) == 0.0 and still.motor.levels == []


def test_unplugged_and_plugged_in_again() -> None:
    """The error ends the effect; another device gets a new one, which starts without force."""
    drive = Drive()
    torque = drive.go(1.0)
    drive.motor.error = OSError(errno.ENODEV, 'No such device')
    assert drive.go(STEP_S) == 0.0 and 'No such device' in drive.force.problem
    drive.wheel.motor = None
    assert drive.go(0.5) == 0.0
    drive.wheel.motor = second = Motor()
    drive.go(1.5)
    assert second.levels[:2] == [0, 0] and second.effects == {7}
    assert drive.go(0.5) == pytest.approx(torque) and drive.force.problem == ''


def test_the_road_and_collisions_are_felt() -> None:
    """Off the road the torque swings around the aligning one; a collision gives a fading jolt."""
    drive = Drive()
    torque = drive.go(1.0)
    drive.force.see_drivability(False, True)
    rough = [drive.go(STEP_S) for _ in range(125)]
    assert max(rough) > torque + 0.25 and min(rough) < torque - 0.05
    drive.force.see_drivability(True, False)
    jolts = [drive.go(STEP_S) for _ in range(250)]
    assert max(np.abs(np.array(jolts[:30]) - torque)) > 0.5
    assert jolts[-1] == pytest.approx(torque, abs=1e-3), 'while they still touch'


def test_a_killed_process_leaves_no_force() -> None:
    """Only the process has the file: kill -9 closes it, and the kernel then ends the effect."""
    here, there = socket.socketpair()
    process = subprocess.Popen([sys.executable, str(Path(__file__).with_name('pushed_wheel.py')),
                                str(there.fileno())], pass_fds=(there.fileno(),),
                               cwd=ROOT)
    there.close()
    here.settimeout(60.0)
    stream = here.makefile('rb')
    level, length, erased = 0, 0, False
    try:
        while True:
            head = stream.read(2)
            if not head:
                break
            data = stream.read(struct.unpack('H', head)[0])
            if data[:1] == UPLOAD and len(data) == 1 + EFFECT_SIZE:
                effect = ff.Effect.from_buffer_copy(data[1:])
                level, length = effect.u.ff_constant_effect.level, effect.ff_replay.length
                if level < -0.5 * FULL_LEVEL:
                    process.send_signal(signal.SIGKILL)
            erased = erased or data[:1] == ERASE
    finally:
        process.kill()
        assert process.wait() == -signal.SIGKILL
    assert level < -0.5 * FULL_LEVEL and not erased, 'it was killed while it pushed'
    assert length == LENGTH_MS, 'and one that is stopped pushes no longer than this'


def test_maps_say_what_their_motor_holds(tmp_path: Path) -> None:
    """Only maps of shipped wheels have a motor; values out of bounds are refused."""
    for device_map in load_device_maps():
        assert (device_map.force_feedback is not None) == (device_map.kind == 'wheel')
    text = (ROOT / 'config/devices/logitech_g29.yaml').read_text()
    path = tmp_path / 'm.yaml'
    for wrong in ('max_torque: 0', 'max_torque: 2.1, cap: 1.5', 'max_torque: 2.1, slew: 0',
                  'strength: 1.0'):
        path.write_text(text.replace('max_torque: 2.1', wrong), encoding='utf-8')
        with pytest.raises(InputError, match='force_feedback'):
            load_device_map(str(path))


class VirtualMotor:
    """A wheel that the kernel presents like a real one, with a motor that records requests."""

    def __init__(self) -> None:
        axes = [(ecodes.ABS_X, AbsInfo(32767, 0, 65535, 0, 0, 0)), *(
            (code, AbsInfo(255, 0, 255, 0, 0, 0))
            for code in (ecodes.ABS_Y, ecodes.ABS_Z, ecodes.ABS_RZ))]
        self.device = UInput({
            ecodes.EV_ABS: axes, ecodes.EV_FF: [ecodes.FF_CONSTANT, ecodes.FF_GAIN],
            ecodes.EV_KEY: list(range(ecodes.BTN_TRIGGER, ecodes.BTN_DEAD + 1))
            + [ecodes.BTN_TRIGGER_HAPPY3]}, name=G29, max_effects=1)
        self.levels: list[int] = []
        self.erased = threading.Event()
        self._ended = False
        self._thread = threading.Thread(target=self._serve)
        self._thread.start()

    def _serve(self) -> None:
        while not self._ended:
            if not select.select([self.device.fd], [], [], 0.05)[0]:
                continue
            for item in self.device.read():
                if item.type == ecodes.EV_UINPUT and item.code == ecodes.UI_FF_UPLOAD:
                    upload = self.device.begin_upload(item.value)
                    self.levels.append(upload.effect.u.ff_constant_effect.level)
                    upload.retval = 0
                    self.device.end_upload(upload)
                elif item.type == ecodes.EV_UINPUT and item.code == ecodes.UI_FF_ERASE:
                    erase = self.device.begin_erase(item.value)
                    erase.retval = 0
                    self.device.end_erase(erase)
                    self.erased.set()

    def turn(self, angle: float) -> None:
        """Turn the wheel to an angle [rad]."""
        self.device.write(ecodes.EV_ABS, ecodes.ABS_X, raw_of(angle))
        self.device.syn()

    def close(self) -> None:
        """Unplug the wheel."""
        self._ended = True
        self._thread.join()
        self.device.close()


@needs_uinput
def test_the_kernel_takes_the_force_and_ends_it() -> None:
    """Uploads through evdev's ioctls arrive, and the kernel erases leftover effects."""
    motor = VirtualMotor()
    try:
        wheel = open_evdev(G29)
        until_s = time.monotonic() + 20.0
        while not wheel.connected and time.monotonic() < until_s:
            time.sleep(0.05)
            wheel.poll(time.monotonic())
        motor.turn(WHEEL)
        force = ForceFeedback(wheel, CAR)
        for n in range(100):
            wheel.poll(time.monotonic())
            force.see_motion(time.monotonic(), 0.01 * n, 20.0, 0.25)
            force.step(time.monotonic())
            time.sleep(0.008)
        assert motor.levels[-1] < -0.5 * FULL_LEVEL
        # Any end of the process does this, without a command to the motor.
        wheel.close()
        assert motor.erased.wait(10.0)
    finally:
        motor.close()
