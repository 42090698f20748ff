# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The run as JSON text: round trips, and garbage from any publisher on the bus."""

from collections.abc import Callable
from dataclasses import fields, replace
import json
import math
from pathlib import Path
import random
from typing import Any

from crgame_ros.errors import InputError
from crgame_ros.game.documents import GAME, OBJECTS
from crgame_ros.game.game import DrivabilitySpec, load_game
from crgame_ros.game.objects import ObjectDescription, Role
from crgame_ros.geometry.shape import Shape
from crgame_ros.paths import scenarios_directory
from crgame_ros.scenario.loading import LoadedScenario
from crgame_ros.simulation.run_texts import describe_game
from crgame_ros.simulation.setup import build_setup, Setup
from crgame_ros.vehicle.parameters import VehicleParameters
from crgame_ros.vehicle.steering import load_steering_ratio, table_text
import pytest
import simulation_support as support


@pytest.fixture(scope='module')
def game() -> Setup:
    """Load the multi-AV game with its scripted human."""
    return build_setup(load_game(scenarios_directory() / 'two_avs.yaml'))


@pytest.fixture(scope='module')
def text(game: Setup) -> str:
    """Write the game after two resets."""
    return GAME.write(describe_game(
        game, epoch=2, clock_offset_ns=5_000_000_000, real_time_factor=0.5))


def test_game_round_trip(game: Setup, text: str) -> None:
    """Other processes read the game that the engine runs."""
    document = GAME.read(text)
    assert document.epoch == 2
    assert document.scenario_sha256 == game.loaded.sha256
    assert document.scheduler == replace(game.scheduler, clock_offset_ns=5_000_000_000)
    assert document.drivability == DrivabilitySpec()
    assert [item.id for item in document.vehicles] == ['hv0', 'av0', 'av1']
    for setup, item in zip(game.vehicles, document.vehicles, strict=True):
        assert item.state == setup.state
        assert item.vehicle == replace(
            setup.vehicle, steering_ratio=table_text(setup.vehicle.steering_ratio))
        # A pedal driver in another process needs the table itself.
        assert load_steering_ratio(item.vehicle.steering_ratio) == load_steering_ratio(
            setup.vehicle.steering_ratio)
    for av, item in zip(game.avs, document.avs, strict=True):
        assert (item.planner, dict(item.options), item.transform, item.perception) == (
            av.spec.planner, av.spec.options, av.transform, av.spec.perception)
        assert item.planning_problem == av.planning_problem.planning_problem_id
    assert document.real_time_factor == 0.5
    assert document.benchmark_id == 'C-ZAM_TwoAvs-1_1_T-1'
    assert document.duration == 20.0
    assert document.timing == game.game.timing
    assert json.loads(text)['dt_ns'] == 10_000_000


@pytest.mark.parametrize('path', sorted(
    path for path in scenarios_directory().glob('*.yaml') if path.name.count('.') == 1),
    ids=lambda path: path.stem)
def test_every_game_is_read_as_it_is_written(path: Path) -> None:
    """Traffic, perception, events, objects, tasks and all else."""
    document = describe_game(build_setup(load_game(path)), epoch=1, simulation='a')
    assert GAME.read(GAME.write(document)) == document


def test_scripted_driver_travels_as_text(game: Setup, text: str) -> None:
    """No shared file system is needed to drive the human."""
    human = GAME.read(text).humans[0]
    assert human.driver == game.game.humans[0].driver
    assert human.timeline == game.humans[0].timeline
    assert len(human.timeline) > 100


def test_vehicle_by_id(text: str) -> None:
    """Humans and AVs; None for all others."""
    document = GAME.read(text)
    assert document.av('av1') == document.avs[1]
    assert document.human('hv0') == document.humans[0]
    assert document.human('hv1') is None and document.av('hv0') is None


def test_transform_is_written(two_avs: LoadedScenario) -> None:
    """Delta psi and d of CRG 6-8, in this order."""
    moved = support.moved(two_avs, 10.0, (0.0, 0.4), 0.1)
    setup = build_setup(support.game_of(moved, avs=support.av_of('idm', spawn='lanelet')), moved)
    content = json.loads(GAME.write(describe_game(setup)))
    transform = setup.avs[0].transform
    assert not transform.is_identity
    assert content['avs'][0]['transform'] == [
        transform.yaw_offset, transform.offset_x, transform.offset_y]


def test_endless_game_and_unlimited_steering_are_valid_json(
        cut_in: LoadedScenario) -> None:
    """Infinity is no JSON: a duration and a steering rate without limit become null."""
    setup = support.setup_of(cut_in)
    free = replace(setup.avs[0], vehicle=replace(setup.avs[0].vehicle,
                                                 max_steering_rate=math.inf))
    text = GAME.write(describe_game(replace(setup, avs=(free,))))
    assert 'Infinity' not in text
    assert json.loads(text)['duration'] is None
    assert json.loads(text)['avs'][0]['vehicle']['max_steering_rate'] is None
    assert GAME.read(text).avs[0].vehicle.max_steering_rate == math.inf


def without(key: str) -> Callable[[dict[str, Any]], None]:
    """Remove a key."""
    return lambda content: content.pop(key)


def with_value(key: str, value: Any) -> Callable[[dict[str, Any]], None]:
    """Set a key."""
    return lambda content: content.update({key: value})


@pytest.mark.parametrize('spoil', [
    *(without(key) for key in ('epoch', 'scenario_sha256', 'dt_c_ns', 'steps_per_tick', 'k0',
                               'clock_offset_ns', 'humans', 'avs', 'drivability')),
    with_value('epoch', 'soon'), with_value('dt_c_ns', 0), with_value('steps_per_tick', -1),
    with_value('k0', math.nan), with_value('clock_offset_ns', math.inf), with_value('avs', 7),
    with_value('humans', ['hv0']), with_value('humans', [{'id': 'hv0'}]),
    with_value('drivability', {'colour': 'red'}), with_value('drivability', None)])
def test_spoilt_game_is_refused(text: str, spoil: Callable[[dict[str, Any]], None]) -> None:
    """It raises one error that names the topic, never another exception."""
    content = json.loads(text)
    spoil(content)
    with pytest.raises(InputError, match='/scenario/game: (is no game document|drivability: )'):
        GAME.read(json.dumps(content))


STRANGE = (None, True, -1, 1e308, 'x', '', [], {}, [[]], 2**70, '9' * 5000, [1] * 1000,
           {'hv0': [{}]}, '\ud800', [[[[[1]]]]])


def test_whatever_is_written_into_a_game_is_read_or_refused(text: str) -> None:
    """One value or key is another one, anywhere; what is read can be written."""
    rng = random.Random(5)
    read = 0
    for _ in range(1500):
        content = json.loads(text)
        inner: Any = content
        while True:
            key = rng.choice(list(inner) if isinstance(inner, dict) else range(len(inner)))
            if not isinstance(inner[key], dict | list) or not inner[key] or rng.random() < 0.3:
                break
            inner = inner[key]
        if rng.random() < 0.2:
            del inner[key]
        else:
            inner[key] = rng.choice(STRANGE)
        try:
            game = GAME.read(json.dumps(content).replace('1e+308', '1e999'))
        except InputError as error:
            assert str(error).startswith('/scenario/game: ')
        else:
            assert GAME.read(GAME.write(game)) == game
            read += 1
    assert 50 < read < 1200


GARBAGE = ['', 'no json', '[]', '7', 'null', '{}', '"text"', '[' * 100_000, '\x00', '[[[]]]',
           '[{}]', '[null]']


@pytest.mark.parametrize('garbage', GARBAGE, ids=range(len(GARBAGE)))
def test_garbage_is_refused(garbage: str) -> None:
    """For any text on either topic."""
    with pytest.raises(InputError, match='/scenario/game'):
        GAME.read(garbage)
    if garbage not in ('[]', '{}', '"text"'):
        with pytest.raises(InputError, match='/scenario/objects'):
            OBJECTS.read(garbage)


def test_objects_round_trip(traffic: LoadedScenario) -> None:
    """Every description, and a polygon and a circle as well."""
    described = (
        *support.setup_of(traffic, [support.BESIDE]).descriptions,
        ObjectDescription('o7', 'building', Role.STATIC,
                          Shape.polygon(((0.0, 0.0), (2.0, 0.1), (1.0, 3.3)))),
        ObjectDescription('o8', 'pedestrian', Role.RECORDED, Shape.circle(0.3)))
    assert OBJECTS.read(OBJECTS.write(described)) == described
    entry = json.loads(OBJECTS.write(described))[0]
    assert (entry['id'], entry['role'], entry['reference_point']) == ('hv0', 'human', 'rear_axle')
    assert entry['rear_to_center'] == pytest.approx(1.4227, abs=1e-4)
    assert json.loads(OBJECTS.write(described))[-1]['reference_point'] == 'center'


@pytest.mark.parametrize(('key', 'value'), [
    ('role', 'ghost'), ('shape', {}), ('shape', None), ('rear_to_center', 'far'),
    ('shape', {'kind': 'rectangle', 'length': -1.0, 'width': 2.0, 'vertices': []}),
    ('shape', {'kind': 'polygon', 'length': 1.0, 'width': 2.0, 'vertices': [[1.0]]})])
def test_spoilt_objects_are_refused(key: str, value: Any) -> None:
    """For an object that could not be drawn or avoided."""
    item = ObjectDescription('o1', 'car', Role.RECORDED, Shape.rectangle(4.0, 2.0))
    entries = json.loads(OBJECTS.write((item,)))
    entries[0][key] = value
    with pytest.raises(InputError):
        OBJECTS.read(json.dumps(entries))


def test_vehicle_entry_has_every_parameter(text: str) -> None:
    """A planner in another process rebuilds the parameters from the text alone."""
    entry = json.loads(text)['avs'][0]['vehicle']
    assert entry.keys() == {field.name for field in fields(VehicleParameters)}
    # A path on this machine means nothing on another one.
    assert str(Path.cwd()) not in json.dumps(entry)
