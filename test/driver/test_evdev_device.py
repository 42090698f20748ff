# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Devices read through evdev: real events, really absent devices, and uinput if present."""

from collections.abc import Iterator
from contextlib import contextmanager
import os
from pathlib import Path
import select
from tempfile import TemporaryDirectory
import time

from crgame_ros.driver.device_map import load_device_map, load_device_maps
from crgame_ros.driver.evdev_device import EvdevDevice, EventDecoder, open_evdev
from crgame_ros.driver.source import EvdevDriver
from crgame_ros.driver.wheel import GearButtons
from crgame_ros.errors import InputError
from evdev import AbsInfo, ecodes, InputEvent, UInput
import pytest

DT_S = 0.01
G29 = 'Logitech G29 Driving Force Racing Wheel'
needs_uinput = pytest.mark.skipif(
    not (os.access('/dev/uinput', os.W_OK) and os.path.isdir('/dev/input')),
    reason='no writable /dev/uinput and /dev/input: virtual devices cannot be made here')


def event(kind: int, code: int, value: int) -> InputEvent:
    """Make an event as the kernel sends it."""
    return InputEvent(0, 0, kind, code, value)


def feed(decoder: EventDecoder, *events: tuple[int, int, int]) -> list[bool]:
    """Feed events and return the result of each."""
    return [decoder.feed(event(*e)) for e in events]


def absent(tmp_path: Path, name: str) -> EvdevDevice:
    """Return an absent device of a map, to be fed through its decoder."""
    device_map = load_device_map(name)
    device = EvdevDevice((device_map,), directory=tmp_path / 'none')
    device.device_map = device_map
    if device_map.keys is not None:
        device.decoder = EventDecoder(GearButtons(toggle=device_map.keys.reverse))
    else:
        device.layout = device_map.layout('evdev')
        device.decoder = EventDecoder(device.layout.gear)
    return device


def test_axes_and_buttons_are_kept() -> None:
    """The last axis values and the held buttons are kept; repeats and reports change nothing."""
    decoder = EventDecoder(GearButtons())
    changed = feed(decoder, (ecodes.EV_ABS, ecodes.ABS_X, 7), (ecodes.EV_ABS, ecodes.ABS_X, 7),
                   (ecodes.EV_ABS, ecodes.ABS_X, 8), (ecodes.EV_KEY, ecodes.KEY_W, 1),
                   (ecodes.EV_KEY, ecodes.KEY_W, 2), (ecodes.EV_KEY, ecodes.KEY_A, 1),
                   (ecodes.EV_KEY, ecodes.KEY_W, 0), (ecodes.EV_KEY, ecodes.KEY_W, 0),
                   (ecodes.EV_SYN, ecodes.SYN_REPORT, 0), (ecodes.EV_MSC, 4, 4))
    assert changed == [True, False, True, True, False, True, True, False, False, False]
    assert decoder.axes == {ecodes.ABS_X: 8}
    assert decoder.pressed == {ecodes.KEY_A}


def test_a_key_toggles_the_gear_once_a_press() -> None:
    """A press with auto-repeat and release is one change; the next press changes back."""
    decoder = EventDecoder(GearButtons(toggle=frozenset({ecodes.KEY_R})))
    gears = []
    for value in (1, 2, 2, 0, 1, 0):
        feed(decoder, (ecodes.EV_KEY, ecodes.KEY_R, value))
        gears.append(decoder.reverse)
    assert gears == [True, True, True, True, False, False]


def test_an_overrun_is_recovered_from() -> None:
    """After SYN_DROPPED events up to the report are ignored, and the state is read again."""
    decoder = EventDecoder(GearButtons(held=frozenset({706})))
    feed(decoder, (ecodes.EV_KEY, ecodes.KEY_W, 1), (ecodes.EV_SYN, ecodes.SYN_DROPPED, 0),
         (ecodes.EV_KEY, ecodes.KEY_A, 1), (ecodes.EV_ABS, 0, 9))
    assert (decoder.pressed, decoder.axes, decoder.stale) == ({ecodes.KEY_W}, {}, False)
    feed(decoder, (ecodes.EV_SYN, ecodes.SYN_REPORT, 0))
    assert decoder.stale
    decoder.synchronise({0: 5.0}, [706])
    assert (decoder.pressed, decoder.axes, decoder.stale) == ({706}, {0: 5.0}, False)
    assert decoder.reverse  # the shifter is in its gate now
    decoder.synchronise({}, ())
    assert not decoder.reverse


def test_a_chosen_gear_outlives_a_synchronisation() -> None:
    """Only a shifter gate follows the buttons; a gear chosen by paddle stays."""
    decoder = EventDecoder(GearButtons(on=frozenset({293}), held=frozenset({706})))
    feed(decoder, (ecodes.EV_KEY, 293, 1), (ecodes.EV_KEY, 293, 0))
    decoder.synchronise({}, ())
    assert decoder.reverse


def test_a_wheel_drives_through_its_map(tmp_path: Path) -> None:
    """Real events give half throttle and 225 of 450 degrees to the left at once."""
    device = absent(tmp_path, 'logitech_g29')
    driver = EvdevDriver(device)
    assert driver.command(0, DT_S) == (0.0, 0.0, 0.0, False, 0, False)
    feed(device.decoder, (ecodes.EV_ABS, ecodes.ABS_X, 16384), (ecodes.EV_ABS, ecodes.ABS_Z, 51),
         (ecodes.EV_KEY, ecodes.BTN_PINKIE, 1))
    command = driver.command(1, DT_S)
    assert command == pytest.approx((0.8, 0.0, 0.5, True, 0, False), abs=2e-5)
    feed(device.decoder, (ecodes.EV_ABS, ecodes.ABS_RZ, 0), (ecodes.EV_KEY, ecodes.BTN_TOP2, 1))
    assert driver.command(1, DT_S)[1:4:2] == (1.0, False)


def test_a_keyboard_drives_through_the_filter(tmp_path: Path) -> None:
    """W and A in cycle 0; A again without W within cycle 1 replaces that cycle's command."""
    device = absent(tmp_path, 'keyboard')
    driver = EvdevDriver(device)
    feed(device.decoder, (ecodes.EV_KEY, ecodes.KEY_W, 1), (ecodes.EV_KEY, ecodes.KEY_A, 1))
    assert driver.command(0, DT_S) == (1.8 * DT_S, 0.0, 2.0 * DT_S, False, 0, False)
    assert driver.command(1, DT_S)[:3] == pytest.approx((0.036, 0.0, 0.04))
    feed(device.decoder, (ecodes.EV_KEY, ecodes.KEY_W, 0), (ecodes.EV_KEY, ecodes.KEY_R, 1))
    assert driver.command(1, DT_S) == (0.0, 0.0, pytest.approx(0.04), True, 0, False)
    assert device.joy == ((), (0, 0, 1, 0, 1, 0, 0, 0, 0))
    driver.reset()
    assert driver.command(0, DT_S)[:3] == (0.0, 0.0, 2.0 * DT_S)


def test_no_input_directory_is_explained(tmp_path: Path) -> None:
    """No call raises an exception; the message names the remedy, the command is released."""
    device = open_evdev(directory=tmp_path / 'input')
    driver = EvdevDriver(device)
    assert [driver.poll(now_s) for now_s in (0.0, 0.5, 1.0, 5.0)] == [False] * 4
    assert (driver.connected, driver.fileno(), driver.joy()) == (False, None, None)
    assert isinstance(driver.problem, InputError)
    assert 'this machine has no input devices; drive with keys:FILE' in str(driver.problem)
    assert driver.command(0, DT_S) == (0.0, 0.0, 0.0, False, 0, False)
    driver.close()


def test_no_fitting_device_is_explained(tmp_path: Path) -> None:
    """For an empty directory the message names the maps that were tried."""
    problem = open_evdev('logitech_g29', tmp_path).problem
    assert 'no device fits logitech_g29; found: none' in str(problem)
    assert 'generic_gamepad' not in str(problem)


def test_a_file_that_is_no_device_is_named(tmp_path: Path) -> None:
    """The kernel refuses its ioctl; the scan continues and names the file."""
    (tmp_path / 'event3').write_bytes(b'no device')
    (tmp_path / 'mouse0').write_bytes(b'never opened')
    problem = str(open_evdev(directory=tmp_path).problem)
    assert 'not readable: event3 (Inappropriate ioctl for device)' in problem
    assert 'mouse0' not in problem


@contextmanager
def without_privileges() -> Iterator[None]:
    """Drop root for a while, if the test runs as root: root is denied nothing."""
    user = os.geteuid()
    if user == 0:
        os.seteuid(65534)
    try:
        yield
    finally:
        os.seteuid(user)


def test_missing_permission_is_explained() -> None:
    """The remedy is the group input."""
    maps = load_device_maps()
    with TemporaryDirectory() as name:
        folder = Path(name)
        folder.chmod(0o755)
        (folder / 'event0').touch(mode=0o000)
        with without_privileges():
            problem = str(EvdevDevice(maps, directory=folder).problem)
    assert 'event0 (Permission denied)' in problem
    assert 'usermod -aG input' in problem


def test_a_lost_device_is_looked_for_once_a_second(tmp_path: Path) -> None:
    """The message follows changes of the directory only when a scan is due."""
    device = open_evdev(directory=tmp_path / 'later')
    device.poll(100.0)
    (tmp_path / 'later').mkdir()
    device.poll(100.9)
    assert 'no input devices' in str(device.problem)
    device.poll(101.0)
    assert 'found: none' in str(device.problem)


def test_a_wrong_map_is_refused_at_once(tmp_path: Path) -> None:
    """A file that is no device map is an error and not a missing device."""
    path = tmp_path / 'mine.yaml'
    path.write_text('title: 3', encoding='utf-8')
    with pytest.raises(InputError, match='"kind" is missing'):
        open_evdev(str(path))


def virtual_wheel(name: str = G29, pedal: int = 255) -> UInput:
    """Make a virtual wheel that the kernel presents like a real one."""
    axis = {ecodes.ABS_X: AbsInfo(32767, 0, 65535, 0, 0, 0)}
    for code in (ecodes.ABS_Y, ecodes.ABS_Z, ecodes.ABS_RZ):
        axis[code] = AbsInfo(pedal, 0, 255, 0, 0, 0)
    return UInput({ecodes.EV_ABS: list(axis.items()),
                   ecodes.EV_KEY: list(range(ecodes.BTN_TRIGGER, ecodes.BTN_DEAD + 1))
                   + [ecodes.BTN_TRIGGER_HAPPY3]}, name=name)


def wait_for(device: EvdevDevice, connected: bool, start_s: float) -> float:
    """Poll once a simulated second until the device appears or disappears."""
    now_s = start_s
    while device.connected != connected:
        time.sleep(0.05)
        now_s += 1.0
        assert device.poll(now_s) or now_s < start_s + 200.0
    return now_s


@needs_uinput
def test_a_real_device_survives_unplug_and_replug() -> None:
    """A virtual wheel works again after it was found, driven, unplugged and plugged in."""
    wheel = virtual_wheel()
    device = open_evdev(G29)
    now_s = wait_for(device, True, 0.0)
    driver = EvdevDriver(device)
    wheel.write(ecodes.EV_ABS, ecodes.ABS_Z, 0)
    wheel.syn()
    fd = driver.fileno()
    assert fd is not None and select.select([fd], [], [], 5.0)[0] == [fd]
    assert driver.poll(now_s) and driver.command(0, DT_S).throttle == 1.0
    assert not driver.poll(now_s)
    wheel.close()
    now_s = wait_for(device, False, now_s)
    assert driver.command(1, DT_S).throttle == 0.0 and not driver.connected
    assert 'was unplugged' in str(device.problem)
    wheel = virtual_wheel()
    wait_for(device, True, now_s + 1.0)
    assert device.problem is None and driver.command(2, DT_S).throttle == 0.0
    device.close()
    wheel.close()


@needs_uinput
def test_a_wheel_is_preferred_to_a_keyboard() -> None:
    """`auto` prefers a wheel on real devices too."""
    codes = load_device_map('keyboard').keys
    assert codes is not None
    keyboard = UInput({ecodes.EV_KEY: sorted(codes.codes)}, name='crgame test keys')
    wheel = virtual_wheel()
    device = open_evdev()
    wait_for(device, True, 0.0)
    assert device.device_map is not None and device.device_map.name == 'logitech_g29'
    for closing in (device, wheel, keyboard):
        closing.close()
