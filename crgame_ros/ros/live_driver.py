# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The driver source that a live seat uses, from its text in the game."""

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from crgame_ros.driver.device_map import load_device_map
from crgame_ros.driver.evdev_device import open_evdev
from crgame_ros.driver.source import (
    COCKPIT,
    DriverSource,
    EvdevDriver,
    IdleDriver,
    JoyDriver,
    load_timeline,
    parse_source,
    ScriptedDriver,
)
from crgame_ros.errors import InputError

if TYPE_CHECKING:
    from crgame_ros.ros.live_policy import PolicyWorld


def live_driver(text: str, timeline: str, vehicle_id: str, joy_map: str,
                say: Callable[[str], object], world: 'Callable[[], PolicyWorld]') -> DriverSource:
    """
    Build a driver source.

    :param text: source as the game or the parameter names it.
    :param timeline: text of the timeline, if the game carries it.
    :param vehicle_id: for messages.
    :param joy_map: device map for an external joy node.
    :param say: logs a line for the user.
    :param world: returns the world of a policy.
    :raises InputError: if the source is unusable, or is a recording: recorded commands belong to
        fixed cycles, while messages arrive at any time.
    """
    source = parse_source(text)
    if source.has_timeline:
        if timeline:
            return ScriptedDriver.from_text(timeline, f'{vehicle_id}: {text}')
        return ScriptedDriver(load_timeline(source, Path('.')))
    if source.kind == 'replay':
        raise InputError('a recording is repeated by the simulation itself', vehicle_id,
                         f'name it as the driver in the game: {text}')
    if source.kind == 'policy':
        # Imported here, so that other drivers do not wait for its imports.
        from crgame_ros.ros.live_policy import LivePolicyDriver
        return LivePolicyDriver(source.argument, vehicle_id, world())
    if source.kind == 'joy':
        return JoyDriver(load_device_map(joy_map))
    if source.kind in ('idle', COCKPIT):
        return IdleDriver()
    device = open_evdev(source.argument)
    if source.kind == 'auto' and device.problem is not None:
        say(f'{vehicle_id}: not driven: {device.problem}')
        device.close()
        return IdleDriver()
    # A named device may be plugged in later; until then the seat's watchdog stops the car.
    return EvdevDriver(device)
