# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Indicators and horn: the lever; its keys in scripts, maps and pages; and the messages."""

import json
from pathlib import Path

from crgame_ros.cockpit.page_messages import parse_message
from crgame_ros.cockpit.seat_table import HeldSeat
from crgame_ros.driver.device_map import load_device_maps
from crgame_ros.driver.source import JoyDriver, ReplayDriver, ScriptedDriver
from crgame_ros.driver.timeline import parse_timeline, timeline_text
from crgame_ros.driver.watchdog import SeatWatchdog
from crgame_ros.driver.wheel import GearButtons, IndicatorLever, LightButtons
from crgame_ros.errors import InputError
from crgame_ros.vehicle.driver_command import DriverCommand
from crgame_ros.vehicle.lights import HAZARD, Light, lights_of, signals_document
import numpy as np
import pytest

DT_S = 0.01
LEFT, RIGHT, HAZARDS, HORN = range(4)
BUTTONS = LightButtons(*(frozenset({i}) for i in range(4)))


def lever(*presses: int) -> IndicatorLever:
    """Return a lever after presses and releases of buttons, one after the other."""
    made = IndicatorLever(BUTTONS)
    for button in presses:
        made.hold({button})
        made.hold(())
    return made


@pytest.mark.parametrize(('presses', 'lights'), [
    ((), 0), ((LEFT,), Light.LEFT), ((LEFT, LEFT), 0), ((LEFT, RIGHT), Light.RIGHT),
    ((RIGHT, RIGHT, LEFT), Light.LEFT), ((HAZARDS,), HAZARD), ((HAZARDS, HAZARDS), 0),
    ((LEFT, HAZARDS), HAZARD), ((LEFT, HAZARDS, HAZARDS), Light.LEFT), ((HORN,), 0)])
def test_a_press_switches(presses: tuple[int, ...], lights: int) -> None:
    """Pressing the other side switches over; hazard lights do not move the lever."""
    assert lever(*presses).lights == lights


def test_the_horn_sounds_while_held() -> None:
    made = lever(LEFT)
    made.hold({HORN})
    made.hold({HORN, LEFT})
    assert made.lights == Light.HORN
    made.hold({LEFT})
    assert made.lights == 0


def test_a_held_button_switches_once() -> None:
    made = lever()
    for _ in range(5):
        made.hold({LEFT})
    assert made.lights == Light.LEFT
    made.overlook({RIGHT})
    made.hold({RIGHT})
    assert made.lights == Light.LEFT, 'a press that was missed is none'


@pytest.mark.parametrize(('button', 'way', 'after'), [
    (LEFT, (0.1, 0.3, 0.12), Light.LEFT), (LEFT, (0.1, 0.3, 0.05), 0),
    (LEFT, (0.15, 0.05), Light.LEFT), (LEFT, (-0.9, 0.0), Light.LEFT),
    (RIGHT, (-0.3, 0.0), 0), (RIGHT, (0.3, 0.0), Light.RIGHT), (HAZARDS, (0.9, 0.0), HAZARD)])
def test_an_indicator_is_off_after_its_turn(button: int, way: tuple[float, ...],
                                            after: int) -> None:
    """It ends after steering past 0.2 and back below 0.1; small or opposite turns keep it on."""
    made = lever(button)
    for steering in way:
        made.turn(steering)
    assert made.lights == after


def test_a_new_turn_needs_a_new_press() -> None:
    made = lever(LEFT)
    made.turn(0.3)
    made.hold({LEFT})
    made.hold(())
    made.hold({LEFT})
    made.turn(0.0)
    assert made.lights == Light.LEFT, 'what was turned before the press does not count'


SCRIPT = """
keys:
  - {from: 0.0, to: 3.0, hold: [throttle, left_indicator]}
  - {from: 1.0, to: 2.0, hold: [right_indicator, horn]}
"""
AXES = """
joy:
  points: [[0.0, 0.5, 0.0, 0.0]]
  reverse: [{from: 2.0, to: 3.0}]
  right_indicator: [{from: 0.5, to: 2.5}]
  horn: [{from: 2.0, to: 2.5}]
"""


@pytest.mark.parametrize(('text', 'given'), [
    (SCRIPT, {0: 1, 99: 1, 100: 7, 199: 7, 200: 1, 299: 1, 300: 0}),
    (AXES, {0: 0, 49: 0, 50: 2, 199: 2, 200: 6, 249: 6, 250: 0})])
def test_scripts_switch_lights_for_their_intervals(text: str, given: dict[int, int]) -> None:
    """They are on while held, to the nanosecond; the timeline's text round-trips."""
    for source in (text, timeline_text(parse_timeline(text, 't'))):
        driver = ScriptedDriver.from_text(source, 't')
        assert {n: driver.command(n, DT_S).lights for n in given} == given


def test_an_unknown_key_is_refused_with_the_known_ones() -> None:
    with pytest.raises(InputError, match='left_indicator, right_indicator, horn'):
        parse_timeline('keys: [{from: 0.0, to: 1.0, hold: [hoot]}]', 't')


def test_every_shipped_map_has_indicators_and_horn() -> None:
    """Each map has all four functions, each once, and on no button that changes the gear."""
    for device_map in load_device_maps():
        keys, buttons = device_map.keys, device_map.buttons
        functions: list[tuple[LightButtons, GearButtons | None]] = \
            [(keys.lights, None)] if keys is not None else []
        if buttons is not None:
            functions += [(buttons.lights('evdev'), buttons.gears('evdev')),
                          (buttons.lights('joy'), buttons.gears('joy'))]
        assert functions
        for lights, gear_buttons in functions:
            groups = [*vars(lights).values()]
            assert all(groups), device_map.name
            if gear_buttons is not None:
                gear = vars(gear_buttons).values()
                assert len(frozenset().union(*groups, *gear)) == sum(map(len, [*groups, *gear]))
        assert keys is None or not frozenset().union(*vars(keys.lights).values()) & keys.codes


def test_a_joy_node_works_the_lever() -> None:
    """Button 7 of a G29 is L2; turning the wheel there and back switches the indicator off."""
    driver = JoyDriver(next(m for m in load_device_maps() if m.name == 'logitech_g29'))
    pressed = [int(i == 7) for i in range(20)]
    driver.receive([0.0, -1.0, -1.0, -1.0], pressed, 0.0)
    assert driver.command(0, DT_S).lights == Light.LEFT
    for n, steering in enumerate((0.5, 0.0), 1):
        driver.receive([steering, -1.0, -1.0, -1.0], [0] * 20, 0.0)
        driver.command(n, DT_S)
    assert driver.command(3, DT_S) == DriverCommand()


def test_a_page_works_the_lever() -> None:
    """A page sends the held buttons; hands off keeps the indicators and stops the horn."""
    seat = HeldSeat('hv0', 'c1')

    def say(**hands: object) -> int:
        seat.apply_input(parse_message(json.dumps({'type': 'input', 'seat': 'hv0', **hands})), 0.0)
        return seat.command(0, DT_S).lights

    assert say(keys=[0, 0, 0, 0]) == 0
    assert say(keys=[0, 0, 0, 0], lights=[0, 1, 0, 1]) == Light.RIGHT | Light.HORN
    assert say(axes=[0.5, 0.0, 0.0], lights=[0, 0, 0, 1]) == Light.RIGHT | Light.HORN
    assert say(away=True) == Light.RIGHT
    with pytest.raises(InputError, match='lights'):
        say(keys=[0, 0, 0, 0], lights=[1, 2])


def test_a_lost_driver_no_longer_sounds_the_horn() -> None:
    """The watchdog passes lights on; after the driver falls silent only the indicators stay."""
    watchdog = SeatWatchdog()
    last = DriverCommand(0.5, 0.0, 0.1, lights=Light.LEFT | Light.HORN)
    assert watchdog.filter(last, 0.0, DT_S, 10.0).lights == Light.LEFT | Light.HORN
    assert watchdog.filter(last, 1.0, DT_S, 10.0).lights == Light.LEFT


def test_replays_repeat_lights_and_know_recordings_without() -> None:
    """Recordings of earlier versions have four or five columns."""
    rows = np.array([[0.5, 0.0, 0.1, 0.0, 6.0], [0.5, 0.0, 0.1, 1.0, 0.0], [np.nan] * 5])
    assert [ReplayDriver(rows).command(n, DT_S).lights for n in range(2)] == [6, 0]
    assert not ReplayDriver(rows).drives(2)
    assert ReplayDriver(rows[:, :4]).command(1, DT_S) == (0.5, 0.0, 0.1, True, 0, False)
    asks = np.column_stack((rows, [1.0, 0.0, np.nan]))
    assert [ReplayDriver(asks).command(n, DT_S).put_back for n in range(2)] == [True, False]


def test_signals_are_told_in_words() -> None:
    """The words are those of /vehicles/signals."""
    lights = {'hv0': lights_of(True, False, True), 'hv1': HAZARD, 'av0': 0}
    assert json.loads(signals_document(12, lights)) == {'n': 12, 'vehicles': {
        'hv0': {'indicator': 'left', 'horn': True}, 'hv1': {'indicator': 'hazard', 'horn': False},
        'av0': {'indicator': 'off', 'horn': False}}}


def test_keys_of_the_documents_are_the_maps() -> None:
    """docs/driving.md names the keys of config/devices/keyboard.yaml."""
    text = (Path(__file__).parents[2] / 'docs/driving.md').read_text()
    for row in ('| , | left indicator', '| . | right indicator', '| J | hazard lights',
                '| G | horn', '| Backspace | after a contact'):
        assert row in text, row
