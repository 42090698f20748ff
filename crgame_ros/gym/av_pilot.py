# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""An AV for which an agent plans, in place of its planner."""

from crgame_ros.messages.joints import plan_to_joints
from crgame_ros.messages.plan import Plan
from crgame_ros.planner.request_reader import RequestReader
from crgame_ros.policy.seat_view import RequestView, SeatView, Surrounded
from crgame_ros.simulation.engine import Simulation, StepResult
from crgame_ros.simulation.offline import perception_of
from crgame_ros.simulation.setup import Setup
from crgame_ros.vehicle.state import STATE_WIDTH, VehicleState
import numpy as np
from numpy.typing import NDArray


class AvPilot:
    """
    The link between an agent and an AV: observes the world, and passes plans without latency.

    An AV with perfect perception gets no planning request: its predictions, which no observation
    uses, would cost more than the rest of the step. An AV with a perception model gets the same
    data as its planner would.

    :param view: view of the true world.
    """

    def __init__(self, setup: Setup, index: int, simulation: Simulation, view: SeatView) -> None:
        av = setup.avs[index]
        self.id = av.id
        self._simulation, self._av, self._view = simulation, simulation.avs[index], view
        self.perception = perception_of(setup, index)
        self.around: Surrounded
        self._stamp_ns = 0
        if self.perception is None:
            self._av.planner_running = False
            return
        objects = {item.id: item for item in setup.descriptions}
        self._reader = RequestReader(av.id, objects, simulation.scheduler)
        self._request_view = RequestView(av.id, objects)

    def observe(self, result: StepResult, states: NDArray[np.float64]) -> Surrounded:
        """
        Return the surroundings for the agent at a tick.

        :param states: (V, 8) of all driven vehicles, rear axle, simulation coordinates
        """
        simulation = self._simulation
        if self.perception is None:
            self._stamp_ns = simulation.scheduler.stamp_ns(simulation.n)
            self.around = self._view.observe(states, simulation.objects)
        elif self.id in result.requests:
            request = self.perception.perceive(result.requests[self.id])
            simulation.request_perceived(self.id, request)
            self._stamp_ns = request.stamp_ns
            self.around = self._request_view.observe(self._reader.read(request))
        return self.around

    def offer(self, states: NDArray[np.float64]) -> str | None:
        """
        Offer a plan to the AV.

        :param states: (S, 8) states of the plan, from the one that `observe` returned on.
        :return: why the engine refuses the plan, or None.
        """
        simulation = self._simulation
        if self.perception is None:
            self._av.request_sent(simulation.n, self._stamp_ns, self.around.state)
        return simulation.offer_plan(self.id, plan_to_joints(
            Plan(self._stamp_ns, states), self.id, simulation.scheduler.time_step_ns))


def stacked(states: list[VehicleState]) -> NDArray[np.float64]:
    """Return the states (V, 8) of driven vehicles as an array."""
    return np.array(states, dtype=np.float64).reshape(-1, STATE_WIDTH)
