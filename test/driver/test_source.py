# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Driver sources: their names, scripted drivers in lockstep, and an external joy node."""

import math
from pathlib import Path

from crgame_ros.driver.device_map import load_device_map
from crgame_ros.driver.keyboard import KeyState
from crgame_ros.driver.source import (
    IdleDriver,
    JoyDriver,
    load_timeline,
    parse_source,
    ReplayDriver,
    ScriptedDriver,
    SourceSpec,
)
from crgame_ros.errors import InputError
from crgame_ros.vehicle.driver_command import DriverCommand, RELEASED
import numpy as np
import pytest

DT_S = 0.01
KEYS = """
keys:
  - {from: 0.5, to: 2.5, hold: [throttle]}
  - {from: 1.0, to: 1.2, hold: [left]}
  - {from: 2.0, to: 3.0, hold: [brake]}
"""
JOY = 'joy: {points: [[0, 0, 0, 0], [10, 1, 0, 1]], reverse: [{from: 4, to: 5}]}'
G29_REST = [0.0, -1.0, -1.0, -1.0]


@pytest.mark.parametrize(('text', 'spec'), [
    ('auto', SourceSpec('auto')), ('idle', SourceSpec('idle')), ('evdev', SourceSpec('evdev')),
    ('evdev:Logitech G29', SourceSpec('evdev', 'Logitech G29')), ('joy', SourceSpec('joy')),
    ('keys:a/b.yaml', SourceSpec('keys', 'a/b.yaml')),
    ('joy:c:d.yaml', SourceSpec('joy', 'c:d.yaml')),
    (' replay: runs/x/bag ', SourceSpec('replay', 'runs/x/bag'))])
def test_sources_are_read(text: str, spec: SourceSpec) -> None:
    """Every form is read and written back as the same text."""
    assert parse_source(text) == spec
    assert parse_source(str(spec)) == spec
    assert spec.has_timeline == (text[:5] in ('keys:', 'joy:c'))


@pytest.mark.parametrize('text', ['', 'wheel', 'keys', 'keys:', 'replay', 'idle:x', 'auto:', ':x',
                                  'evdev:', 'Keys:x'])
def test_other_sources_are_refused_with_the_forms(text: str) -> None:
    """The message lists the valid forms."""
    with pytest.raises(InputError, match='auto, cockpit, idle, evdev or evdev:NAME, '
                                         'keys:FILE, joy or joy:FILE, replay:BAG'):
        parse_source(text)


def test_a_recorded_value_that_is_no_switch_is_off() -> None:
    """A recording may hold any number."""
    for lights in (math.inf, math.nan, 1e300):
        driver = ReplayDriver(np.array([[0.5, 0.0, 0.0, 0.0, lights, 1.0]]))
        assert driver.command(0, 0.01) == DriverCommand(throttle=0.5, put_back=True)


def test_nobodys_home_is_a_line_of_its_own() -> None:
    with pytest.raises(InputError, match='~nobody_here/k.yaml: is in the home folder of nobody'):
        load_timeline(parse_source('keys:~nobody_here/k.yaml'), Path())


def test_timelines_are_found_beside_the_game(tmp_path: Path) -> None:
    """They are found relative to the base and are of the named kind."""
    (tmp_path / 'k.yaml').write_text(KEYS, encoding='utf-8')
    (tmp_path / 'j.yaml').write_text(JOY, encoding='utf-8')
    timeline = load_timeline(parse_source('keys:k.yaml'), tmp_path)
    assert timeline.keys_at(0.5) == KeyState(throttle=True)  # type: ignore[union-attr]
    timeline = load_timeline(parse_source(f'joy:{tmp_path}/j.yaml'), Path('elsewhere'))
    assert timeline.times_s[-1] == 10.0  # type: ignore[union-attr]
    with pytest.raises(InputError, match='timeline of joy, not of keys; name it as joy:j.yaml'):
        load_timeline(parse_source('keys:j.yaml'), tmp_path)
    with pytest.raises(InputError, match='missing.yaml: cannot read'):
        load_timeline(parse_source('keys:missing.yaml'), tmp_path)


def test_idle_is_released() -> None:
    """The idle source never presses a control."""
    assert {IdleDriver().command(n, DT_S) for n in range(10)} == {RELEASED}


def test_keys_at_the_start_of_a_cycle_drive_that_cycle() -> None:
    """Held from 0.5 s, the throttle leaves 0 in cycle 50 and is full 1/1.8 s later, at 105."""
    driver = ScriptedDriver.from_text(KEYS, 'k')
    throttle = [driver.command(n, DT_S).throttle for n in range(200)]
    assert throttle[49] == 0.0
    assert throttle[50] == pytest.approx(1.8 * DT_S)
    assert throttle[104] < 1.0 and throttle[105] == 1.0


def test_a_whole_drive_has_the_papers_closed_forms() -> None:
    """At t = 2.2 s, after 0.2 s of braking, brake is 0.5 and throttle 1 - 0.44."""
    driver = ScriptedDriver.from_text(KEYS, 'k')
    given = [driver.command(n, DT_S) for n in range(400)]
    assert given[119].steering == pytest.approx(2.0 * 0.2)  # end of 0.2 s of left
    assert given[124].steering == pytest.approx(0.4 - 3.5 * 0.05)
    assert given[219][:2] == pytest.approx((1.0 - 2.2 * 0.2, 2.5 * 0.2))
    assert given[299].brake == 1.0
    assert given[-1] == RELEASED


@pytest.mark.parametrize('text', [KEYS, JOY])
def test_two_drivers_are_identical_and_a_late_one_catches_up(text: str) -> None:
    """Commands are bit-equal on every run, for late drivers and for repeated requests."""
    whole = [ScriptedDriver.from_text(text, 'k')]
    reference = [whole[0].command(n, DT_S) for n in range(300)]
    again = ScriptedDriver.from_text(text, 'k')
    assert [again.command(n, DT_S) for n in range(300) for _ in (0, 1)][::2] == reference
    for start in (0, 70, 213, 299):
        late = ScriptedDriver.from_text(text, 'k')
        assert [late.command(n, DT_S) for n in range(start, 300)] == reference[start:]
    sparse = ScriptedDriver.from_text(text, 'k')
    assert [sparse.command(n, DT_S) for n in range(0, 300, 7)] == reference[::7]


def test_the_step_does_not_change_the_drive() -> None:
    """With edges on both grids, cycles of 1 ms give the 10 ms command after each 10 ms."""
    coarse, fine = ScriptedDriver.from_text(KEYS, 'k'), ScriptedDriver.from_text(KEYS, 'k')
    for n in range(350):
        fine_command = [fine.command(10 * n + i, DT_S / 10) for i in range(10)][-1]
        assert fine_command[:3] == pytest.approx(coarse.command(n, DT_S)[:3], abs=1.1e-3)


def test_reset_begins_again() -> None:
    """The second run equals the first."""
    driver = ScriptedDriver.from_text(KEYS, 'k')
    first = [driver.command(n, DT_S) for n in range(150)]
    driver.reset()
    assert [driver.command(n, DT_S) for n in range(150)] == first


def test_scripted_axes_are_sampled_at_the_start_of_the_cycle() -> None:
    """Axes move by a tenth per second, and the gear holds in its interval."""
    driver = ScriptedDriver.from_text(JOY, 'j')
    assert driver.command(250, DT_S) == (0.25, 0.0, 0.25, False, 0, False)
    assert driver.joy() == ((0.25, 0.0, 0.25), (0, 0, 0, 0, 0))
    assert driver.command(400, DT_S) == (0.4, 0.0, 0.4, True, 0, False)
    assert driver.joy() == ((0.4, 0.0, 0.4), (1, 0, 0, 0, 0))


def test_scripted_keys_are_shown_as_buttons() -> None:
    """/<hv>/joy has the buttons throttle, brake, left, right, reverse, then lights."""
    driver = ScriptedDriver.from_text(KEYS, 'k')
    driver.command(100, DT_S)
    assert driver.joy() == ((), (1, 0, 1, 0, 0, 0, 0, 0, 0))


def test_joy_messages_are_normalised_by_the_device_map() -> None:
    """For a Logitech wheel through a joy node left is 1, and pedals go from -1 to 1."""
    driver = JoyDriver(load_device_map('logitech_g29'))
    driver.receive([0.5, -1.0, 0.0001, -0.5], [0] * 20, now_s=0.0)
    assert driver.command(0, DT_S) == pytest.approx((0.50005, 0.25, 0.5, False, 0, False))


def test_pedals_that_have_not_moved_are_released() -> None:
    """A joy node sends 0 for them, which would be half throttle and half brake."""
    driver = JoyDriver(load_device_map('logitech_g29'))
    driver.receive([0.0] * 4, [], now_s=0.0)
    assert driver.command(0, DT_S) == RELEASED
    driver.receive([0.0, 0.0, -0.9, 0.0], [], now_s=0.1)
    driver.receive([0.0] * 4, [], now_s=0.2)
    assert driver.command(1, DT_S)[:2] == (0.5, 0.0)


def test_paddles_choose_the_gear() -> None:
    """Left paddle (5) is reverse, right (4) forward; the shifter's gate (18) holds while held."""
    driver = JoyDriver(load_device_map('logitech_g29'))
    gears = []
    for pressed in ({5}, set(), {4}, set(), {18}, set()):
        driver.receive(G29_REST, [int(i in pressed) for i in range(25)], now_s=0.0)
        gears.append(driver.command(0, DT_S).reverse)
    assert gears == [True, True, False, False, True, False]


def test_a_silent_joy_node_counts_as_gone() -> None:
    """A joy node is connected from its first message until 0.5 s after the last."""
    driver = JoyDriver(load_device_map('logitech_g29'))
    assert not driver.connected
    driver.receive(G29_REST, [], now_s=10.0)
    assert driver.connected and not driver.poll(10.4)
    assert driver.poll(10.6) and not driver.connected
    driver.receive(G29_REST, [], now_s=10.7)
    assert driver.connected


def test_a_message_of_another_device_is_named() -> None:
    """A device of two axes has no pedals on 2 and 3; the seat gets no command from it."""
    driver = JoyDriver(load_device_map('logitech_g29'))
    driver.receive([0.0, 0.0], [], now_s=0.0)
    assert not driver.connected
    assert 'has 2 axes, device map logitech_g29 needs axis 3' in str(driver.problem)
    driver.receive(G29_REST, [], now_s=0.1)
    assert driver.connected and driver.problem is None


def test_a_keyboard_has_no_joy_node() -> None:
    """A keyboard's map is refused for a joy node."""
    with pytest.raises(InputError, match='keyboard: is a keyboard'):
        JoyDriver(load_device_map('keyboard'))
