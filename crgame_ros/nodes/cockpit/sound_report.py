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
"""What people in the seats hear and feel, told on /diagnostics and so recorded."""

from collections.abc import Iterable, Mapping
import time

from crgame_ros.cockpit.client import Client
from crgame_ros.cockpit.held_seat import HeldSeat
from crgame_ros.ros.diagnostics import Diagnostics
from diagnostic_msgs.msg import DiagnosticStatus

PERIOD_S = 1.0


class SoundReport:
    """
    Tells of each held seat whether its page sounds, and how loudly: once a second and at a change.

    :param diagnostics: of the node.
    """

    def __init__(self, diagnostics: Diagnostics) -> None:
        self._diagnostics = diagnostics
        self._told: dict[str, tuple[object, float]] = {}

    def tell(self, seats: Iterable[HeldSeat], clients: Mapping[str, Client],
             stamp_ns: int) -> None:
        """
        Publish what has changed, and what has not been told for a second.

        :param clients: by id.
        :param stamp_ns: simulation time [ns]
        """
        now_s = time.monotonic()
        told = {}
        for seat in seats:
            client = clients.get(seat.holder)
            if client is None:
                continue
            sound, (before, told_s) = client.sound, self._told.get(seat.id, (None, 0.0))
            told[seat.id] = (before, told_s)
            if sound != before or now_s - told_s >= PERIOD_S:
                told[seat.id] = (sound, now_s)
                self._diagnostics.publish(
                    f'cockpit_node: {seat.id} sound', DiagnosticStatus.OK,
                    'sounds' if sound.on else 'is silent',
                    {'on': sound.on, 'volume': f'{sound.volume:.2f}',
                     'rumble': f'{sound.rumble:.2f}'}, stamp_ns)
        self._told = told
