# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A trained policy as an AV's planner: `planner: policy:FILE.py:load` in a game."""

from typing import ClassVar

from crgame_ros.messages.plan import Plan, PlanRequest
from crgame_ros.planner.interface import Planner, PlannerContext
from crgame_ros.planner.path_planner import initial_state
from crgame_ros.policy.actions import checked_action, planned_states
from crgame_ros.policy.manoeuvres import Manoeuvres
from crgame_ros.policy.observation import Observation, ObservationHistory, Observed
from crgame_ros.policy.policy_file import load_policy
from crgame_ros.policy.route_guide import RouteGuide
from crgame_ros.policy.seat_view import RequestView
from crgame_ros.vehicle.state import VehicleState
import numpy as np

# Simulation step of a vehicle driven by pedals, as in live games [s].
DRIVEN_STEP_S = 0.01


class PolicyPlanner(Planner):
    """
    A planner that gets an action from a policy at each request and plans its motion.

    :param policy: `FILE.py:load`.
    """

    name: ClassVar[str] = 'policy'

    def __init__(self, policy: str) -> None:
        self._policy = load_policy(policy)

    def setup(self, context: PlannerContext) -> None:
        """Plan the route, and run the policy once, because its first call may take long."""
        self._context = context
        self._view = RequestView(context.vehicle_id, context.objects)
        self._observation = Observation(self._policy.spec, context.vehicle, context.scenario)
        self._history = ObservationHistory(self._policy.spec)
        start = initial_state(context)
        self._guide = RouteGuide(context.scenario, context.planning_problem, start,
                                 context.vehicle)
        self._manoeuvres = None if self._policy.action != 'manoeuvre' else Manoeuvres(
            context.scenario, context.planning_problem, start, context.vehicle)
        self._decided_k: int | None = None
        self._policy.begin()
        self.plan(PlanRequest(0, context.k0, context.time_step_s, start))
        self._guide.restart(start)
        if self._manoeuvres is not None:
            self._manoeuvres.restart(start)
        self._history.begin()
        self._policy.begin()
        self._decided_k = None

    def plan(self, request: PlanRequest) -> Plan:
        """Plan a new action, or the held one, from the vehicle's present state."""
        decided, place = self._decided_k, self._guide.follow(request.ego)
        if decided is None or not 0 < request.k - decided < self._policy.ticks:
            seen = self._observation.observe_one(self._view.observe(request), place, self._guide)
            self._decide(request.ego, self._history.add(seen))
            # After it, so that a policy that fails is asked again and its last action not held.
            self._decided_k = request.k
        if self._manoeuvres is not None:
            return Plan(request.stamp_ns, self._manoeuvres.plan(request.ego, request.time_step_s))
        states = planned_states(
            self._policy.action, self._action, request.ego, self._context.vehicle,
            request.time_step_s, max(1, round(request.time_step_s / DRIVEN_STEP_S)))
        return Plan(request.stamp_ns, states)

    def _decide(self, ego: VehicleState, seen: Observed) -> None:
        if self._manoeuvres is not None:
            seen['mask'] = self._manoeuvres.mask(ego).astype(np.float32)
        self._action = checked_action(self._policy.action, self._policy.act(seen))
        if self._manoeuvres is not None:
            self._manoeuvres.decide(int(self._action), ego)
