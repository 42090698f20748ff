# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Inputs of local devices have stamps, and their delay is published once a second."""

import os
from typing import Any

from crgame_ros.driver.device_map import load_device_map
from crgame_ros.driver.evdev_device import EventDecoder, stamp_by_steady_clock
from crgame_ros.driver.source import JoyDriver
from crgame_ros.driver.wheel import GearButtons
from crgame_ros.ros.live_driver import DeviceDelay
from evdev import ecodes, InputEvent
import pytest


class Told:
    """Keeps the statuses that are published on /diagnostics."""

    def __init__(self) -> None:
        self.statuses: list[tuple[str, str, dict[str, Any]]] = []

    def publish(self, name: str, level: object, text: str, values: dict[str, Any]) -> None:
        """Store a status."""
        self.statuses.append((name, text, values))


def event(kind: int, code: int, value: int, time_ms: int) -> InputEvent:
    """Make an event as the kernel stamps it."""
    return InputEvent(time_ms // 1000, time_ms % 1000 * 1000, kind, code, value)


def test_the_first_event_that_changes_something_dates_the_input() -> None:
    decoder = EventDecoder(GearButtons())
    assert not decoder.feed(event(ecodes.EV_KEY, ecodes.KEY_W, 2, 500))
    assert decoder.changed_s is None
    decoder.feed(event(ecodes.EV_KEY, ecodes.KEY_W, 1, 1250))
    decoder.feed(event(ecodes.EV_ABS, ecodes.ABS_X, 7, 1300))
    assert decoder.changed_s == pytest.approx(1.25)


def test_a_message_of_a_joy_node_is_dated_by_its_arrival() -> None:
    driver = JoyDriver(load_device_map('generic_gamepad'))
    driver.receive([0.0, 0.0, 1.0, 0.0, 0.0, 1.0], [0] * 11, 3.0)
    driver.input_s = None
    driver.receive([0.0, 0.0, 1.0, 0.0, 0.0, 1.0], [0] * 11, 3.5)
    assert driver.input_s is None
    driver.receive([0.4, 0.0, 1.0, 0.0, 0.0, 1.0], [0] * 11, 4.0)
    driver.receive([0.5, 0.0, 1.0, 0.0, 0.0, 1.0], [0] * 11, 4.1)
    assert driver.input_s == 4.0 and driver.name == 'generic_gamepad'


def test_medians_are_told_once_a_second() -> None:
    told = Told()
    delay = DeviceDelay(told, 'hv0')  # type: ignore[arg-type]
    delay.stepped(99.0, 0, 'Wheel')
    assert not told.statuses
    for n, (input_s, command_s, state_s) in enumerate((
            (100.000, 100.002, 100.011), (100.020, 100.023, 100.034),
            (100.040, 100.044, 100.052))):
        delay.published(input_s, command_s, n)
        delay.stepped(state_s, n + 1, 'Wheel')
    delay.stepped(101.5, 4, 'Wheel')
    assert told.statuses[0] == ('driver_node: hv0 driver', 'Wheel', {
        'command_ms': 2.0, 'input_delay_ms': 11.0})
    assert told.statuses[1:] == [('driver_node: hv0 driver', 'Wheel', {
        'command_ms': 3.0, 'input_delay_ms': 12.0})]


def test_what_is_no_device_has_no_clock() -> None:
    reader, writer = os.pipe()
    assert not stamp_by_steady_clock(reader)
    os.close(reader)
    os.close(writer)
