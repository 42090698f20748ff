# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What is said of a planner that fails or is slow: its first traceback, then a line a minute."""

from collections.abc import Callable
import math
from statistics import median
from typing import TYPE_CHECKING

from crgame_ros.each_minute import EachMinute, kind_of

if TYPE_CHECKING:  # sim_node tells of refusals and has no planner.
    from crgame_ros.planner.manager import PlannerManager


# A planner is slow if it takes longer than so many scenario steps: the median of so many answers.
SLOW_STEPS, RECENT = 2, 5


class FailureLines:
    """
    The lines about the failures of one AV's planner.

    :param vehicle_id: of the AV.
    :param say: prints or logs a text.
    :param step_s: scenario step, in which an answer is due [s]
    """

    def __init__(self, vehicle_id: str, say: Callable[[str], object],
                 step_s: float = math.inf) -> None:
        self._vehicle_id, self._say, self._step_s = vehicle_id, say, step_s
        self._timed_out = 0
        self._shown = ''
        self._minute = EachMinute()

    def note(self, manager: 'PlannerManager') -> None:
        """Tell what is new after a setup or an answer."""
        recent = manager.statistics.durations_s[-RECENT:]
        if len(recent) == RECENT and (took_s := median(recent)) > SLOW_STEPS * self._step_s:
            self._tell(f'planner {manager.name} is slow',
                       f'{took_s:.2f} s for a plan, a scenario step is {self._step_s:g} s')
        failure = manager.statistics.failure
        if failure != self._shown:
            self._shown = failure
            self._say(f'{self._vehicle_id}: planner {manager.name} has failed:\n'
                      + failure.rstrip())
        if manager.last_reason is not None:
            self._tell(f'brakes along its last plan, planner {manager.name}', manager.last_reason)

    def wait(self, timed_out: int, limit_s: float) -> None:
        """
        Tell that requests stayed without an answer.

        :param timed_out: number of them so far.
        :param limit_s: for which the planner was waited for each time [s]
        """
        if timed_out > self._timed_out:
            self._tell('its planner is slow or gone',
                       f'no answer in {limit_s:g} s, requests so far without one: {timed_out}')
        self._timed_out = timed_out

    def refuse(self, reason: str | None) -> None:
        """Tell that an answer was refused; None: it was not."""
        if reason is not None:
            self._tell('its planner answered, but the plan was refused', reason)

    def _tell(self, what: str, reason: str) -> None:
        text = f'{what}: {reason}'
        line = self._minute.line(kind_of(text), f'{self._vehicle_id}: {text}')
        if line is not None:
            self._say(line)
