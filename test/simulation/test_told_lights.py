# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Requests hold others' indicators and horn only for planners that ask for them."""

from dataclasses import replace
import importlib.util
from pathlib import Path
from typing import Any

from crgame_ros.driver.source import DriverSource
from crgame_ros.game.game import parse_game
from crgame_ros.messages.joints import JointSeries
from crgame_ros.paths import scenarios_directory
from crgame_ros.planner.registry import BUILT_IN, planner_class
from crgame_ros.planner.request_reader import RequestReader
from crgame_ros.simulation.av_models import published_states
from crgame_ros.simulation.engine import Simulation, StepResult
from crgame_ros.simulation.offline import OfflineResult, perceive, PlannerSeat, run_offline
from crgame_ros.simulation.setup import build_setup, Setup
from crgame_ros.vehicle.driver_command import DriverCommand
from crgame_ros.vehicle.lights import HAZARD, Light
from crgame_ros.vehicle.state import StateColumn
import numpy as np
import pytest
from signalling import expected_bits, signalling_vehicle
import yaml

COURTEOUS = '''
from crgame_ros.planner.constant_velocity import ConstantVelocityPlanner
from crgame_ros.vehicle.lights import Light


class Courteous(ConstantVelocityPlanner):
    """Hold the speed, but brake while somebody indicates to the left."""

    name = 'courteous'
    wants_lights = True

    def plan(self, request):
        lit = any(light & Light.LEFT for light in request.lights.values())
        return self.answer(request, self.follower.drive(
            request.ego, self.locate(request), 30, request.time_step_s,
            lambda i, s, speed: -2.0 if lit else 0.0))


class Blind(Courteous):
    name = 'blind'
    wants_lights = False
'''
ALL_ROUND = {'localisation': None, 'memory': 1.0, 'sensors': [
    {'name': 'roof', 'field_of_view': 6.283, 'rays': 720, 'horizon': 200.0}]}
SHORT = {'localisation': None, 'sensors': [
    {'name': 'short', 'horizon': 2.0, 'field_of_view': 0.1, 'rays': 3}]}


@pytest.fixture(scope='module')
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp('planner') / 'courteous.py'
    path.write_text(COURTEOUS)
    return path


def game(planner: str, events: Any = (), **av: Any) -> Setup:
    """Make a game of an AV and an idle human."""
    values = yaml.safe_load((scenarios_directory() / 'cut_in.yaml').read_text())
    values['humans'][0]['driver'] = 'idle'
    values['events'] = list(events)
    values['avs'][0] |= {'planner': planner} | av
    return build_setup(parse_game(values, 'cut_in', scenarios_directory()))


class Indicating(DriverSource):
    """A driver that only moves the lever, from 1 s on."""

    def __init__(self, lights: int) -> None:
        self._lights = lights

    def command(self, n: int, dt_s: float) -> DriverCommand:
        return DriverCommand(lights=self._lights if n >= 100 else 0)

    def see(self, n: int, states: Any, objects: Any) -> None:
        """Ignore the observation."""


def driven(setup: Setup, lights: int) -> OfflineResult:
    return run_offline(setup, duration_s=3.0, drivers={'hv0': Indicating(lights)})


def first_request(setup: Setup, lights: int) -> tuple[Simulation, StepResult]:
    """Step to the first tick at which the human's lights are on; it has a request to the AV."""
    simulation = Simulation(setup)
    simulation.begin()
    result = None
    for _ in range(100):
        result = simulation.step(0.01, [DriverCommand(lights=lights)])
    assert result is not None and 'av0' in result.requests
    return simulation, result


def told(setup: Setup, request: JointSeries, simulation: Simulation) -> dict[str, Light]:
    objects = {item.id: item for item in setup.descriptions}
    return dict(RequestReader('av0', objects, simulation.scheduler).read(request).lights)


def test_a_planner_that_asks_reacts_to_an_indicator(file: Path) -> None:
    """It brakes at 2 m/s^2 from the first plan after 1 s on; not for the right, or uninformed."""
    speeds = {
        (name, lights): driven(game(f'{file}:{name}', **av), lights).states_of('av0')[
            :, StateColumn.SPEED]
        for name, lights, av in [
            ('Courteous', int(Light.LEFT), {}), ('Courteous', int(Light.RIGHT), {}),
            ('Blind', int(Light.LEFT), {})]}
    braking = speeds['Courteous', int(Light.LEFT)]
    np.testing.assert_allclose(braking[:100], braking[0], atol=1e-9)
    assert braking[300] == pytest.approx(braking[0] - 2.0 * 1.9, abs=0.3)
    for other in (('Courteous', int(Light.RIGHT)), ('Blind', int(Light.LEFT))):
        np.testing.assert_allclose(speeds[other], braking[0], atol=1e-9)


@pytest.mark.parametrize('av', [{}, {'perception': ALL_ROUND}], ids=['truth', 'perceived'])
def test_signals_of_recorded_vehicles_are_told(file: Path, tmp_path: Path, av: Any) -> None:
    """The request at 1 s has those of time step 10, also for an AV whose sensors see all."""
    text = (scenarios_directory() / 'ZAM_CutIn-1_1_T-1.xml').read_text()
    (tmp_path / 'scenario.xml').write_text(text.replace(
        '<planningProblem', signalling_vehicle(900, 9.0) + '<planningProblem', 1))
    setup = game(f'{file}:Courteous', **av)
    setup = build_setup(replace(setup.game, scenario=tmp_path / 'scenario.xml'))
    simulation, result = first_request(setup, 0)
    request = result.requests['av0']
    if av:
        seat = PlannerSeat(setup, 0, simulation, 0, None)
        assert seat.perception is not None
        perceive(simulation, [seat.perception])
        request = seat.perception.perceive(request)
    assert told(setup, request, simulation) == {
        'hv0': Light(0), 'o900': Light(expected_bits(10))}


def test_the_game_may_say_otherwise(file: Path) -> None:
    """In both directions; the written game has the same setting."""
    untold = game(f'{file}:Courteous', lights=False)
    assert np.ptp(driven(untold, HAZARD).states_of('av0')[:, StateColumn.SPEED]) < 1e-9
    setup = game('external', lights=True)
    simulation, result = first_request(setup, HAZARD)
    assert told(setup, result.requests['av0'], simulation) == {'hv0': HAZARD}
    assert yaml.safe_load(setup.game.dump())['avs'][0]['lights'] is True
    assert 'lights' not in yaml.safe_load(game('idm').game.dump())['avs'][0]


def test_a_planner_that_an_event_brings_in_is_told(file: Path) -> None:
    swap = {'name': 'swap', 'when': {'time': 5.0},
            'planner': {'av': 'av0', 'planner': f'{file}:Courteous'}}
    setup = game('idm', events=[swap])
    simulation, result = first_request(setup, int(Light.HORN))
    assert told(setup, result.requests['av0'], simulation) == {'hv0': Light.HORN}


def test_all_else_of_a_request_stays_as_it_is() -> None:
    """To the bit; the light's joint is last, and absent for planners that do not ask for it."""
    plain, lit = (first_request(game('idm', **av), HAZARD)[1].requests['av0']
                  for av in ({}, {'lights': True}))
    assert lit.names == (*plain.names, 'hv0/lights')
    for name in ('positions', 'velocities', 'accelerations'):
        before, after = getattr(plain, name), getattr(lit, name)
        assert np.ascontiguousarray(after[:, :-1]).tobytes() == before.tobytes()
    # The future lights of no vehicle are known.
    assert lit.positions[0, -1] == HAZARD and np.isnan(lit.positions[1:, -1]).all()
    hashes = {driven(game('idm', **av), bits).state_hash
              for av, bits in (({}, HAZARD), ({}, 0), ({'lights': True}, HAZARD))}
    assert len(hashes) == 1


def test_only_lights_of_vehicles_in_view_are_told() -> None:
    """The lights of a vehicle that is out of sight, or only remembered, are unknown."""
    found = {}
    for name, perception in (('seen', ALL_ROUND), ('unseen', SHORT),
                             ('all', {'localisation': {}, 'sensors': []})):
        setup = game('idm', lights=True, perception=perception)
        simulation = Simulation(setup)
        seat = PlannerSeat(setup, 0, simulation, 0, None)
        simulation.begin()
        assert seat.perception is not None
        for n in range(101):
            if n:
                result = simulation.step(0.01, [DriverCommand(lights=HAZARD)])
            objects = simulation.objects
            seat.perception.observe(n, published_states(simulation.states), objects.poses,
                                    objects.velocities)
        request = seat.perception.perceive(result.requests['av0'])
        assert request.names[-1] == 'hv0/lights'
        found[name] = told(setup, request, simulation)
        if name == 'seen':
            # It drives beyond the horizon: it is remembered for a second, its lights not at all.
            states = published_states(simulation.states)
            states[0, 0] += 1000.0
            for n in range(101, 121):
                seat.perception.observe(n, states, objects.poses, objects.velocities)
            request = seat.perception.perceive(result.requests['av0'])
            x = request.positions[0, request.names.index('hv0/x')]
            assert np.isfinite(x)
            found['remembered'] = told(setup, request, simulation)
    assert found == {'seen': {'hv0': HAZARD}, 'unseen': {}, 'all': {'hv0': HAZARD},
                     'remembered': {}}


def test_no_planner_of_ours_asks_for_lights() -> None:
    """So the simulation need not import them to find out."""
    for target in {*BUILT_IN.values(), 'crgame_ros.policy.planner:PolicyPlanner'}:
        spec = importlib.util.find_spec(target.partition(':')[0])
        assert spec is not None and spec.origin is not None
        # Read, not imported: some need packages that are not installed everywhere.
        assert 'wants_lights' not in Path(spec.origin).read_text(encoding='utf-8')
    assert not planner_class('idm').wants_lights
