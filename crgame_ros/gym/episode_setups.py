# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The setups of a game's episodes: the effects of a seed, and variations of the start."""

from collections.abc import Mapping
from copy import deepcopy
from dataclasses import dataclass, replace
import math
from typing import Annotated, ClassVar, TypeVar

from crgame_ros.errors import InputError
from crgame_ros.game.documents import DrivenHuman
from crgame_ros.game.game import Game
from crgame_ros.geometry.rigid_transform import RigidTransform
from crgame_ros.gym.episode_options import Start
from crgame_ros.policy.route_guide import RouteGuide
from crgame_ros.scenario.loading import LoadedScenario
from crgame_ros.schema.declaration import Form
from crgame_ros.schema.marks import Within
from crgame_ros.simulation.offline import DEFAULT_DURATION_S
from crgame_ros.simulation.setup import AvSetup, build_setup, Setup
from crgame_ros.simulation.traffic_setup import TrafficSetup
from crgame_ros.vehicle.state import VehicleState
import numpy as np

Vehicle = TypeVar('Vehicle', AvSetup, DrivenHuman)
# Upper bound of the seeds that an environment draws for games.
SEEDS = 2**31


@dataclass(frozen=True)
class StartVariation:
    """
    The variation of the start of agents' vehicles, uniform to both sides.

    :param speed: largest change of the speed [m/s]; no vehicle starts backwards
    :param along: largest change of the position along the route [m]
    """

    FORM: ClassVar[Form] = Form('see docs/gym.md for the keys')

    speed: Annotated[float, Within(0.0, 50.0)] = 0.0
    along: Annotated[float, Within(0.0, 100.0)] = 0.0


def check_count(name: str, value: object, remedy: str = 'give a whole number from 1') -> None:
    """Refuse a keyword of an environment that is no whole number from 1."""
    if not (isinstance(value, int | np.integer) and value >= 1):
        raise InputError(f'"{name}" is {value!r}', 'environment', remedy)


class EpisodeSetups:
    """
    A factory of episodes' setups from their seeds.

    :param worlds: number of traffic placements that the seeds share; None makes one for each
        seed, which takes 0.1 s and more.
    :param loaded: scenario of the game, if it is loaded already.
    """

    def __init__(self, game: Game, vary: StartVariation, worlds: int | None = None,
                 loaded: LoadedScenario | None = None) -> None:
        if worlds is not None:
            check_count('worlds', worlds)
        self.base = build_setup(game, loaded)
        self._vary, self._worlds = vary, worlds
        self._placed: dict[int, Setup] = {}

    @property
    def duration_s(self) -> float:
        """Return the simulated time after which an episode is truncated [s]."""
        duration = self.base.game.duration
        return DEFAULT_DURATION_S if math.isinf(duration) else duration

    def make(self, seed: int, guides: Mapping[str, RouteGuide], start: Start | None = None,
             difficulty: float = 1.0) -> Setup:
        """
        Return the setup of an episode; equal seeds give equal setups.

        :param guides: routes of the vehicles whose start varies, by id.
        :param start: stated start, in place of one that varies.
        :param difficulty: share of the variation that is used.
        """
        setup = self.base
        if setup.traffic is not None:
            setup = self._with_traffic(seed)
        setup = replace(setup, game=replace(setup.game, seed=seed))
        if start is None and self._vary == StartVariation():
            return setup
        random = np.random.Generator(np.random.PCG64(seed))
        most = difficulty * self._vary.speed, difficulty * self._vary.along
        changes = {vehicle: (start.speed, start.along) if start is not None else tuple(
            share * size for share, size in zip(random.uniform(-1.0, 1.0, 2).tolist(), most,
                                                strict=True)) for vehicle in guides}
        transforms = dict(zip(setup.vehicle_ids, setup.road_transforms, strict=True))

        def varied(vehicle: Vehicle) -> Vehicle:
            if vehicle.id not in guides:
                return vehicle
            return replace(vehicle, state=self._moved(
                vehicle.state, guides[vehicle.id], transforms[vehicle.id], *changes[vehicle.id]))

        return replace(setup, humans=tuple(map(varied, setup.humans)),
                       avs=tuple(map(varied, setup.avs)))

    def _moved(self, state: VehicleState, guide: RouteGuide, transform: RigidTransform,
               faster: float, along: float) -> VehicleState:
        """Return a start with another speed [m/s], shifted along the route [m]."""
        speed = max(0.0, state.speed + faster)
        if not along:
            return state._replace(speed=speed)
        x, y, yaw = transform.to_scenario(np.array(state[:3])).tolist()
        path, s = guide.first.path, guide.first.start_s
        s, d, heading = path.locate(x, y, s)
        moved = path.poses(np.array([s + along]), np.array([d]))[0]
        moved[2] += yaw - heading
        x, y, yaw = transform.to_simulation(moved).tolist()
        return state._replace(x=x, y=y, yaw=yaw, speed=speed)

    def _with_traffic(self, seed: int) -> Setup:
        """Return the setup with traffic placed by the seed, or with an earlier placement."""
        world = seed if self._worlds is None else seed % self._worlds
        if world in self._placed:
            return self._placed[world]
        game, spec = self.base.game, self.base.game.traffic
        assert spec is not None
        placed = build_setup(replace(game, seed=world, traffic=replace(spec, seed=None)),
                             self.base.loaded)
        if self._worlds is not None:
            assert placed.traffic is not None
            fresh = placed.traffic.make()
            placed = replace(placed, traffic=TrafficSetup(
                placed.traffic.descriptions, lambda: deepcopy(fresh)))
            self._placed[world] = placed
        return placed
