# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The setups of a game's episodes: the effects of a seed, and variations of the start."""

from collections.abc import Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, ClassVar, TypeVar

from crgame_ros.drivability.monitor import road_transforms
from crgame_ros.errors import InputError
from crgame_ros.game.driven_vehicle import DrivenHuman
from crgame_ros.game.file import load_game
from crgame_ros.game.game import Game, HumanSpec
from crgame_ros.geometry.rigid_transform import RigidTransform
from crgame_ros.library.lookup import find_scenario
from crgame_ros.paths import scenarios_directory
from crgame_ros.policy.route_guide import RouteGuide
from crgame_ros.schema.declaration import Form
from crgame_ros.schema.marks import Within
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


class EpisodeSetups:
    """
    A factory of episodes' setups from their seeds.

    :param game: game of all episodes.
    :param vary: variation of the start.
    :param worlds: number of traffic placements that the seeds share; None makes one for each
        seed, which takes 0.1 s and more.
    """

    def __init__(self, game: Game, vary: StartVariation, worlds: int | None = None) -> None:
        if worlds is not None and not worlds >= 1:
            raise InputError(f'"worlds" is {worlds}', 'environment', 'give a number from 1')
        self.base = build_setup(game)
        self._vary, self._worlds = vary, worlds
        self._placed: dict[int, Setup] = {}

    def make(self, seed: int, guides: Mapping[str, RouteGuide]) -> Setup:
        """
        Return the setup of an episode; equal seeds give equal setups.

        :param guides: routes of the vehicles whose start varies, by id.
        """
        setup = self.base
        if setup.traffic is not None:
            setup = self._with_traffic(seed)
        setup = replace(setup, game=replace(setup.game, seed=seed))
        if self._vary == StartVariation():
            return setup
        random = np.random.Generator(np.random.PCG64(seed))
        drawn = {vehicle: random.uniform(-1.0, 1.0, 2).tolist() for vehicle in guides}
        transforms = dict(zip(setup.vehicle_ids, road_transforms(
            len(setup.humans), [av.transform for av in setup.avs]), strict=True))

        def varied(vehicle: Vehicle) -> Vehicle:
            if vehicle.id not in guides:
                return vehicle
            return replace(vehicle, state=self._moved(
                vehicle.state, guides[vehicle.id], transforms[vehicle.id], *drawn[vehicle.id]))

        return replace(setup, humans=tuple(map(varied, setup.humans)),
                       avs=tuple(map(varied, setup.avs)))

    def _moved(self, state: VehicleState, guide: RouteGuide, transform: RigidTransform,
               speed_share: float, along_share: float) -> VehicleState:
        """Return a start that is varied by shares in [-1, 1] of the largest changes."""
        speed = max(0.0, state.speed + speed_share * self._vary.speed)
        if not self._vary.along:
            return state._replace(speed=speed)
        x, y, yaw = transform.to_scenario(np.array(state[:3])).tolist()
        path, s = guide.driving.path, guide.driving.start_s
        s, d, heading = path.locate(x, y, s)
        moved = path.poses(np.array([s + along_share * self._vary.along]), np.array([d]))[0]
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


def chosen_game(game: Game | Path | str | None, scenario: Path | str | None,
                seats: Sequence[str], drivers: Mapping[str, str], planners: Mapping[str, str],
                duration: float | None) -> Game:
    """
    Return the game of an environment.

    :param game: a game, its file, or the name of a shipped one, such as `cut_in`.
    :param scenario: a CommonRoad file, or a benchmark id, instead: each planning problem is an
        AV, and the only humans are agents.
    :param seats: seats of the agents.
    :param drivers: driver sources that replace the game's, by human.
    :param planners: planners that replace the game's, by AV.
    :param duration: time until an episode is truncated, instead of the game's [s]
    :raises InputError: if neither game nor scenario is given, or both are.
    """
    if (game is None) == (scenario is None):
        raise InputError('name a game or a scenario, one of them', 'environment',
                         "such as game='cut_in'")
    if scenario is not None:
        chosen = Game(find_scenario(Path(scenario).expanduser()), humans=tuple(
            HumanSpec(seat, 'idle') for seat in seats if seat.startswith('hv')))
    elif isinstance(game, Game):
        chosen = game
    else:
        assert game is not None
        chosen = load_game(_file(game))
    chosen = replace(chosen, humans=tuple(
        replace(human, driver=drivers.get(human.id, human.driver)) for human in chosen.humans))
    if planners:
        if chosen.avs is None:
            raise InputError('the game does not list its AVs', 'planners',
                             'list them in a game file')
        chosen = replace(chosen, avs=tuple(
            replace(av, planner=planners[av.id], options={}) if av.id in planners else av
            for av in chosen.avs))
    known = {human.id for human in chosen.humans} | {av.id for av in chosen.avs or ()}
    for name in (*drivers, *planners):
        if name not in known:
            raise InputError(f'there is no "{name}" in the game', 'drivers or planners',
                             'use ' + ', '.join(sorted(known)))
    if duration is not None:
        if not 0.0 < duration < float('inf'):
            raise InputError(f'"duration" is {duration}', 'environment',
                             'give a positive number of seconds')
        chosen = replace(chosen, duration=float(duration))
    return chosen


def _file(game: Path | str) -> Path:
    """Return the file of a game; a shipped one is found by its name."""
    shipped = scenarios_directory() / f'{game}.yaml'
    if isinstance(game, str) and '/' not in game and shipped.is_file():
        return shipped
    return Path(game).expanduser()
