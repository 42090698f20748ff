# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A planner that answers late, for runs of the whole graph."""

import time

from crgame_ros import Plan, Planner, PlannerContext, PlanRequest
from crgame_ros.planner.registry import create_planner


class LatePlanner(Planner):
    """
    Another planner, whose answers wait.

    :param planner: name of the other planner.
    :param latency: how long an answer waits [s].
    """

    name = 'late'

    def __init__(self, planner: str = 'idm', latency: float = 0.0) -> None:
        self._planner, self._latency_s = create_planner(planner, {}), latency

    def setup(self, context: PlannerContext) -> None:
        """Prepare the other planner."""
        self._planner.setup(context)

    def plan(self, request: PlanRequest) -> Plan:
        """Return its plan, later."""
        plan = self._planner.plan(request)
        time.sleep(self._latency_s)
        return plan
