# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What a run says of a planner that fails: its first traceback, then one line a minute."""

from collections.abc import Callable
from typing import TYPE_CHECKING

from crgame_ros.each_minute import EachMinute, kind_of

if TYPE_CHECKING:  # sim_node tells of refusals and has no planner.
    from crgame_ros.planner.manager import PlannerManager


class FailureLines:
    """
    The lines about the failures of one AV's planner.

    :param vehicle_id: of the AV.
    :param say: prints or logs a text.
    """

    def __init__(self, vehicle_id: str, say: Callable[[str], object]) -> None:
        self._vehicle_id, self._say = vehicle_id, say
        self._shown = ''
        self._minute = EachMinute()

    def note(self, manager: 'PlannerManager') -> None:
        """Tell what is new after a setup or an answer."""
        failure = manager.statistics.failure
        if failure != self._shown:
            self._shown = failure
            self._say(f'{self._vehicle_id}: planner {manager.name} has failed:\n'
                      + failure.rstrip())
        if manager.last_reason is not None:
            self._tell(f'brakes along its last plan, planner {manager.name}', manager.last_reason)

    def refuse(self, reason: str | None) -> None:
        """Tell that an answer was refused; None: it was not."""
        if reason is not None:
            self._tell('its planner answered, but the plan was refused', reason)

    def _tell(self, what: str, reason: str) -> None:
        line = self._minute.line(kind_of(reason), f'{self._vehicle_id}: {what}: {reason}')
        if line is not None:
            self._say(line)
