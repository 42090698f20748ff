# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Device maps: the shipped ones, and the refusal of wrong ones."""

from pathlib import Path

from crgame_ros.driver.device_map import DeviceMap, load_device_map, load_device_maps
from crgame_ros.driver.keyboard import KeyState
from crgame_ros.driver.wheel import joy_state, normalize, RawInput
from crgame_ros.errors import InputError
from crgame_ros.vehicle.lights import Light
from evdev import ecodes
import pytest

WHEEL_AXES = frozenset({ecodes.ABS_X, ecodes.ABS_Y, ecodes.ABS_Z, ecodes.ABS_RZ})
WHEEL_BUTTONS = frozenset(range(ecodes.BTN_TRIGGER, ecodes.BTN_DEAD + 1))
# Reports of the kernel for these wheels and for two families of gamepads.
WHEEL_LIMITS = {ecodes.ABS_X: (0.0, 65535.0), ecodes.ABS_Y: (0.0, 255.0),
                ecodes.ABS_Z: (0.0, 255.0), ecodes.ABS_RZ: (0.0, 255.0)}
STICKS = dict.fromkeys((ecodes.ABS_X, ecodes.ABS_Y, ecodes.ABS_RX, ecodes.ABS_RY))
XBOX_LIMITS = {**dict.fromkeys(STICKS, (-32768.0, 32767.0)),
               ecodes.ABS_Z: (0.0, 1023.0), ecodes.ABS_RZ: (0.0, 1023.0)}
PLAYSTATION_LIMITS = dict.fromkeys((*STICKS, ecodes.ABS_Z, ecodes.ABS_RZ), (0.0, 255.0))
WHEELS = ['logitech_g29', 'logitech_g923', 'logitech_g923_xbox']


def find(name: str, axes: frozenset[int], buttons: frozenset[int]) -> list[str]:
    """Return the names of the shipped maps that fit a device, in order."""
    return [m.name for m in load_device_maps() if m.fits(name, axes, buttons)]


def test_wheels_come_before_gamepads_before_keyboards() -> None:
    """The order is that of the choice `auto`."""
    maps = load_device_maps()
    assert [m.rank for m in maps] == sorted(m.rank for m in maps)
    assert {m.name for m in maps} == {*WHEELS, 'generic_gamepad', 'keyboard'}


@pytest.mark.parametrize(('device', 'expected'), [
    ('Logitech G29 Driving Force Racing Wheel', 'logitech_g29'),
    ('Logitech G923 Racing Wheel for PlayStation 4 and PC', 'logitech_g923'),
    ('Logitech G923 Racing Wheel for PlayStation and PC', 'logitech_g923'),
    ('Logitech G923 Racing Wheel for Xbox One and PC', 'logitech_g923_xbox'),
    ('Logitech G920 Driving Force Racing Wheel', 'logitech_g923_xbox'),
])
def test_wheels_are_known_by_the_names_that_the_kernel_gives(device: str, expected: str) -> None:
    """Exactly one map fits each wheel; the two G923 have their pedals on different axes."""
    assert find(device, WHEEL_AXES, WHEEL_BUTTONS) == [expected]


def test_controls_are_demanded_as_well_as_names() -> None:
    """A mouse is no keyboard, a motion sensor no gamepad, a wheel without pedals no wheel."""
    letters = frozenset({getattr(ecodes, f'KEY_{key}') for key in (
        'W', 'A', 'S', 'D', 'R', 'UP', 'DOWN', 'LEFT', 'RIGHT', 'SPACE')})
    pad = frozenset({ecodes.BTN_GAMEPAD, ecodes.BTN_TL, ecodes.BTN_TR})
    assert find('AT Translated Set 2 keyboard', frozenset(), letters) == ['keyboard']
    assert find('Mouse', frozenset(), frozenset({ecodes.BTN_LEFT})) == []
    assert find('Power Button', frozenset(), frozenset({ecodes.KEY_POWER})) == []
    assert find('Xbox Wireless Controller', WHEEL_AXES, pad) == ['generic_gamepad']
    assert find('Wireless Controller Motion Sensors', WHEEL_AXES, frozenset()) == []
    assert find('Logitech G29 Driving Force Racing Wheel', frozenset({0}), WHEEL_BUTTONS) == []


@pytest.mark.parametrize('name', WHEELS)
def test_wheel_endpoints(name: str) -> None:
    """Raw 0 is full left (450 degrees), 65535 full right; pedals rest at 255 and end at 0."""
    layout = load_device_map(name).layout('evdev', WHEEL_LIMITS)
    gas, brake = {'logitech_g923_xbox': (ecodes.ABS_Y, ecodes.ABS_Z)}.get(
        name, (ecodes.ABS_Z, ecodes.ABS_RZ))
    rest = {ecodes.ABS_X: 32767.5, ecodes.ABS_Y: 255, ecodes.ABS_Z: 255, ecodes.ABS_RZ: 255}
    assert normalize(RawInput(rest), layout) == (0.0, 0.0, 0.0, False, 0, False)
    assert normalize(RawInput({**rest, 0: 0, gas: 0}), layout) == (1.0, 0.0, 1.0, False, 0, False)
    assert normalize(RawInput({**rest, 0: 65535, brake: 0}), layout) == (
        0.0, 1.0, -1.0, False, 0, False)


@pytest.mark.parametrize(('name', 'limits'), [
    *((name, WHEEL_LIMITS) for name in WHEELS), ('generic_gamepad', XBOX_LIMITS),
    ('generic_gamepad', PLAYSTATION_LIMITS)])
def test_evdev_and_joy_agree(name: str, limits: dict[int, tuple[float, float]]) -> None:
    """A device gives the same commands through evdev and through a joy node."""
    device = load_device_map(name)
    for share in [i / 20 for i in range(21)]:
        axes = {code: low + ((share + 0.37 * code) % 1.0) * (high - low)
                for code, (low, high) in limits.items()}
        joy = joy_state(axes, (), limits, ())
        by_joy = normalize(RawInput(dict(enumerate(joy.axes))), device.layout('joy'))
        by_evdev = normalize(RawInput(axes), device.layout('evdev', limits))
        assert by_joy == pytest.approx(by_evdev, abs=1e-9)


def test_gear_buttons_agree_in_evdev_and_joy() -> None:
    """The joy index of a button is its place among the device's buttons."""
    g29 = load_device_map('logitech_g29')
    buttons = [*range(ecodes.BTN_TRIGGER, ecodes.BTN_DEAD + 1),
               *range(ecodes.BTN_TRIGGER_HAPPY1, ecodes.BTN_TRIGGER_HAPPY9 + 1)]
    for action in ('on', 'off', 'held'):
        codes = getattr(g29.layout('evdev').gear, action)
        joy = joy_state({}, codes, {}, buttons)
        assert {i for i, value in enumerate(joy.buttons) if value} == getattr(
            g29.layout('joy').gear, action) != set()


def test_keyboard_has_the_papers_keys() -> None:
    """W/Up, S/Down/Space, A/Left, D/Right of CRG III-C1."""
    keys = load_device_map('keyboard').keys
    assert keys is not None
    e = ecodes
    assert [set(each) for each in (keys.throttle, keys.brake, keys.left, keys.right)] == [
        {e.KEY_W, e.KEY_UP}, {e.KEY_S, e.KEY_DOWN, e.KEY_SPACE}, {e.KEY_A, e.KEY_LEFT},
        {e.KEY_D, e.KEY_RIGHT}]
    assert keys.held({e.KEY_SPACE, e.KEY_LEFT}, True)[:5] == (False, True, True, False, True)
    assert keys.held({e.KEY_UP, e.KEY_D}, False, Light.RIGHT | Light.HORN) == (
        True, False, False, True, False, False, True, True, False)
    assert keys.held({e.KEY_BACKSPACE}, False) == KeyState(put_back=True)


COMBINED = """
title: Old wheel
kind: wheel
match: [Old]
steering: {evdev: {axis: ABS_WHEEL}, joy: {axis: 0, inverted: true}, deadzone: 0.1}
pedals: {evdev: {axis: ABS_GAS, inverted: true}, joy: {axis: 1}}
buttons: {reverse_toggle: [{evdev: BTN_A, joy: 2}]}
"""


def parse_device_map(text: str, folder: Path) -> DeviceMap:
    """Read a map from a file old.yaml."""
    path = folder / 'old.yaml'
    path.write_text(text, encoding='utf-8')
    return load_device_map(str(path))


def test_combined_pedals_are_read(tmp_path: Path) -> None:
    """One axis serves both pedals, with the device's ranges."""
    device = parse_device_map(COMBINED, tmp_path)
    assert (device.name, device.kind) == ('old', 'wheel')
    layout = device.layout('evdev', {ecodes.ABS_WHEEL: (0, 100), ecodes.ABS_GAS: (-50, 50)})
    raw = RawInput({ecodes.ABS_WHEEL: 55, ecodes.ABS_GAS: 25})
    assert normalize(raw, layout) == (0.0, 0.5, 0.0, False, 0, False)
    assert layout.gear.toggle == {ecodes.BTN_A}


@pytest.mark.parametrize(('old', 'new', 'key'), [
    ('kind: wheel', 'kind: boat', '"kind" is .boat'),
    ('title: Old wheel', '', '"title" is missing'),
    ('match: [Old]', 'match: []', 'match: has 0 entries; give 1 or more'),
    ('match: [Old]', "match: ['(']", 'no regular expression'),
    ('ABS_WHEEL', 'ABS_STEER', 'steering: evdev: "axis" is .ABS_STEER'),
    ('ABS_WHEEL', 'KEY_W', 'steering: evdev: "axis" is .KEY_W'),
    ('joy: {axis: 1}', 'joy: {axis: -1}', 'pedals: joy: "axis" is -1'),
    ('joy: {axis: 1}', 'joy: {axis: 1, min: 1, max: -1}', 'pedals: joy: "max" is -1'),
    ('joy: {axis: 1}', 'joy: {axis: 1, min: .nan}', 'pedals: joy: "min" is nan'),
    ('joy: {axis: 1}', 'joy: {axis: 1, rest: 2}', 'pedals: joy: "rest" is 2'),
    ('joy: {axis: 1}', 'joy: {axis: 1, inverted: maybe}', '"inverted" is .maybe'),
    ('joy: {axis: 1}', 'joy: {axis: 1, scale: 2}', '"scale" is unknown'),
    ('deadzone: 0.1', 'deadzone: 0.9', 'steering: "deadzone" is 0.9'),
    ('pedals:', 'throttle:', '"brake" is missing'),
    ('buttons:', 'knobs:', '"knobs" is unknown for kind wheel with "pedals"; .*buttons'),
    ('evdev: BTN_A', 'evdev: BTN_ZZ', 'reverse_toggle.0.: "evdev" is .BTN_ZZ'),
    ('buttons:', 'buttons: 3 #', 'buttons: is no mapping; see docs/driving'),
    ('title: Old wheel', 'title: &a [*a]', 'alias'),
    ('title: Old wheel', 'title: [', 'is no YAML'),
])
def test_wrong_maps_name_file_and_key(
        old: str, new: str, key: str, tmp_path: Path) -> None:
    """Each message names the file, the key and the value."""
    assert old in COMBINED
    with pytest.raises(InputError, match=key) as caught:
        parse_device_map(COMBINED.replace(old, new), tmp_path)
    assert str(caught.value).startswith(f'{tmp_path}/old.yaml')


def test_a_missing_map_lists_the_known_ones(tmp_path: Path) -> None:
    """A directory in place of a file gives the same list."""
    with pytest.raises(InputError, match='generic_gamepad, keyboard, logitech_g29'):
        load_device_map('logitech_g30')
    (tmp_path / 'x.yaml').mkdir()
    with pytest.raises(InputError, match='is a directory'):
        load_device_map(str(tmp_path / 'x.yaml'))


def test_maps_of_another_directory(tmp_path: Path) -> None:
    """A user's folder is read the same way."""
    (tmp_path / 'old.yaml').write_text(COMBINED, encoding='utf-8')
    maps: tuple[DeviceMap, ...] = load_device_maps(tmp_path)
    assert [m.title for m in maps] == ['Old wheel']


def test_the_documented_example_is_the_g29(tmp_path: Path) -> None:
    """The example of docs/driving.md is valid and drives like a G29 without a shifter."""
    text = (Path(__file__).parents[2] / 'docs' / 'driving.md').read_text(encoding='utf-8')
    block = next(b for b in text.split('```yaml')[1:] if b.startswith('\ntitle:'))
    device = parse_device_map(block.split('```')[0], tmp_path)
    g29 = load_device_map('logitech_g29')
    assert device.layout('evdev', WHEEL_LIMITS).ranges \
        == g29.layout('evdev', WHEEL_LIMITS).ranges
