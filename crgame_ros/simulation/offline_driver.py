# Copyright 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.
"""Drivers that need no person: what the offline runner can put behind the wheel."""

from crgame_ros.driver.source import DriverSource, IdleDriver, parse_source, ScriptedDriver
from crgame_ros.errors import InputError
from crgame_ros.simulation.setup import HumanSetup


def offline_driver(human: HumanSetup) -> DriverSource:
    """
    Make the driver that a game names for a human.

    :raises InputError: if it needs a person, a device or a recording that isn't at hand.
    """
    source = parse_source(human.driver)
    if human.timeline:
        return ScriptedDriver.from_text(human.timeline, f'{human.id}: {human.driver}')
    if source.kind in ('idle', 'auto'):
        return IdleDriver()
    raise InputError(f'driver "{human.driver}" needs a person or a device', human.id,
                     'offline, use keys:FILE, joy:FILE, replay:BAG or idle')
