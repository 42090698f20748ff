# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The delay of inputs from a device of this machine, published on /diagnostics and so recorded."""

from collections import deque
import statistics

from crgame_ros.driver.input_delay import InputDelay
from crgame_ros.ros.diagnostics import Diagnostics
from diagnostic_msgs.msg import DiagnosticStatus

_TELL_PERIOD_S = 1.0
# Enough for the present delay; a single late input does not affect the median.
_KEPT = 21


class DeviceDelay:
    """
    The delay since an input's time stamp, on the steady clock of this machine.

    :param diagnostics: of the node.
    :param vehicle_id: of the seat.
    """

    def __init__(self, diagnostics: Diagnostics, vehicle_id: str) -> None:
        self._diagnostics = diagnostics
        self._vehicle_id = vehicle_id
        self._states = InputDelay()
        self._commands_ms: deque[float] = deque(maxlen=_KEPT)
        self._told_s = 0.0

    def published(self, input_s: float, now_s: float, n: int) -> None:
        """
        Note a command that results from an input.

        :param input_s: when the input came, steady clock [s]
        :param now_s: now, after the command was published [s]
        :param n: the cycle that the command is for.
        """
        self._commands_ms.append((now_s - input_s) * 1e3)
        self._states.changed(input_s, n)

    def stepped(self, now_s: float, n: int, device: str) -> None:
        """
        Note a new cycle, and publish the delays once a second.

        :param now_s: steady clock [s]
        :param n: the cycle, whose state is known.
        :param device: that drives.
        """
        self._states.stepped(now_s, n)
        if not self._commands_ms or now_s - self._told_s < _TELL_PERIOD_S:
            return
        self._told_s = now_s
        state_ms = self._states.turn_ms
        self._diagnostics.publish(
            f'driver_node: {self._vehicle_id} driver', DiagnosticStatus.OK, device,
            {'command_ms': round(statistics.median(self._commands_ms), 1),
             'input_delay_ms': '' if state_ms is None else round(state_ms, 1)})
