# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Drivers that need no person: what the offline runner can put behind the wheel."""

from crgame_ros.drivability.monitor import road_transforms
from crgame_ros.driver.source import DriverSource, IdleDriver, parse_source, ScriptedDriver
from crgame_ros.errors import InputError
from crgame_ros.simulation.setup import Setup


def offline_driver(setup: Setup, index: int) -> DriverSource:
    """
    Make the driver that a game names for a human.

    :param index: of the human.
    :raises InputError: if it needs a person, a device or a recording that isn't at hand.
    """
    human = setup.humans[index]
    source = parse_source(human.driver)
    if human.timeline:
        return ScriptedDriver.from_text(human.timeline, f'{human.id}: {human.driver}')
    if source.kind in ('idle', 'auto'):
        return IdleDriver()
    if source.kind == 'policy':
        # Few games have one, and others should not wait for what it needs.
        from crgame_ros.policy.policy_driver import DrivenSeat, PolicyDriver
        from crgame_ros.policy.policy_file import load_policy
        transforms = road_transforms(len(setup.humans), [av.transform for av in setup.avs])
        return PolicyDriver(load_policy(source.argument, human.id), DrivenSeat(
            index, setup.vehicle_descriptions, setup.obstacles.descriptions,
            setup.loaded.scenario, human.vehicle, human.state, transforms[index],
            setup.scheduler.steps_per_tick))
    raise InputError(f'driver "{human.driver}" needs a person or a device', human.id,
                     'offline, use keys:FILE, joy:FILE, policy:FILE.py:load, replay:BAG or idle')
