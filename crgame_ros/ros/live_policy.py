# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A driver source that lets a policy drive a human's seat in a live run."""

from crgame_ros.driver.source import DriverSource
from crgame_ros.errors import CrgameError, InputError
from crgame_ros.policy.driver import DrivenSeat, PolicyDriver
from crgame_ros.policy.policy_file import load_policy
from crgame_ros.ros.world_follower import WorldFollower
from crgame_ros.vehicle.driver_command import DriverCommand, RELEASED


class LivePolicyDriver(DriverSource):
    """
    The driver of `policy:FILE.py:load`, whose policy acts on the states that sim_node publishes.

    A policy that fails is reported as a problem of the seat, which then brakes as for a lost
    device.

    :param name: `FILE.py:load`.
    :raises InputError: if there is no such policy.
    """

    is_looking = True

    def __init__(self, name: str, vehicle_id: str, world: WorldFollower) -> None:
        self._policy = load_policy(name, vehicle_id)
        self._vehicle_id, self._world = vehicle_id, world
        self._driver: PolicyDriver | None = None
        self._latest_n = -1
        world.begin = self._begin
        if world.scenario is not None:
            self._begin()

    @property
    def connected(self) -> bool:
        """Return whether the policy has received the run and can drive."""
        return self._driver is not None and self._latest_n >= 0 and self.problem is None

    def poll(self, now_s: float) -> bool:
        """Observe the new steps, and choose an action at scenario steps."""
        decided = False
        try:
            self._world.look()
            if self._world.scenario is None:
                self._world.drop()
            for step in self._world.steps():
                if self._driver is not None:
                    self._driver.see(step.n, step.states, step.objects if step.tick else None)
                    self._latest_n, decided = step.n, decided or step.tick
                    self.problem = self._driver.problem
        except CrgameError as error:
            self.problem = InputError(f'cannot follow the run ({error})', self._vehicle_id,
                                      'reset the run')
        return decided

    def command(self, n: int, dt_s: float) -> DriverCommand:
        """Return the command of the action in force."""
        return RELEASED if self._driver is None else self._driver.command(n, dt_s)

    def _begin(self) -> None:
        """Begin to drive the seat in a run."""
        scenario = self._world.scenario
        assert scenario is not None
        self._driver, self._latest_n, self.problem = None, -1, None
        game, ids = scenario.game, [item.id for item in scenario.driven]
        human = game.human(self._vehicle_id)
        if human is None:
            return
        row = ids.index(human.id)
        self._driver = PolicyDriver(self._policy, DrivenSeat(
            row, scenario.driven, scenario.others, scenario.loaded.scenario, human.vehicle,
            human.state, game.road_transforms[row], game.scheduler.steps_per_tick))
