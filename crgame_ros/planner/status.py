# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The status `planner_node: <av>`: what a planner has answered so far."""

from crgame_ros.messages.plan import Plan
from crgame_ros.messages.status_values import BRAKING, OK, Status, WARN
from crgame_ros.planner.manager import PlannerManager

# Answers from one report of the counts to the next.
_REPORTED = 10


def planner_status(av: str, k: int, plan: Plan, manager: PlannerManager) -> Status | None:
    """
    Return what is told after an answer: each braking plan, and the counts at every tenth answer.

    :param av: its id.
    :param k: scenario step of the request.
    :param plan: the answer.
    :param manager: of the planner; without a clock, its status has no planning time.
    :return: None if there is nothing to tell.
    """
    statistics = manager.statistics
    if not plan.fallback and statistics.plans % _REPORTED:
        return None
    took_s = statistics.durations_s[-1:]
    return Status.of(
        f'planner_node: {av}', WARN if plan.fallback else OK,
        f'{BRAKING}{manager.last_reason}' if plan.fallback else 'planning',
        {'k': k, 'plans': statistics.plans, 'fallbacks': statistics.fallbacks,
         **({'plan_time_ms': f'{took_s[0] * 1e3:.3f}'} if took_s else {}),
         'planner': manager.name})
