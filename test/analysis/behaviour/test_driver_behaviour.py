# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""All measures of whole offline runs: present, correct by hand, and the same on turned maps."""

from collections.abc import Sequence
from dataclasses import replace
from functools import cache
import json
import math
from typing import Any

from crgame_ros.analysis.behaviour.driver import DriverBehaviour, measure_behaviour
from crgame_ros.analysis.behaviour.measures import MEASURES
from crgame_ros.analysis.scores.scored_drive import drive_of
from crgame_ros.driver.source import ReplayDriver
from crgame_ros.game.game import load_game
from crgame_ros.geometry.angles import wrap_pi_array
from crgame_ros.geometry.rigid_transform import RigidTransform
from crgame_ros.paths import scenarios_directory
from crgame_ros.recording.recorded_game import recorded_inputs
from crgame_ros.recording.run_record import run_record_of, RunRecord, SeatOrder
from crgame_ros.simulation.offline import run_offline
from crgame_ros.simulation.setup import build_setup
from crgame_ros.vehicle.state import StateColumn
from lxml import etree
import numpy as np
from numpy.typing import NDArray
import pytest

OF_VEHICLES = [
    *(f'{name}_{key}' for name in ('speed', 'acceleration', 'jerk', 'throttle', 'brake')
      for key in ('mean', 'sd', 'min', 'max')),
    'time_above_limit', 'time_with_limit', 'sdlp', 'lane_offset_mean', 'lane_changes',
    'srr_visual', 'srr_cognitive', 'tlc_min', 'tlc_linear_min',
    *(f'{pedal}_{key}' for pedal in ('throttle', 'brake') for key in ('share', 'applications'))]
OF_OTHERS = ['tlc', 'tlc_linear', 'reaction_throttle', 'reaction_brake', 'reaction_steering',
             'gap_to_leader', 'gap_accepted_leader', 'gap_to_follower', 'gap_accepted_follower',
             'take_over_hands_on', 'take_over_stable']


@cache
def _play(name: str, duration_s: float, triggers: tuple[tuple[int, str], ...] = ()) -> RunRecord:
    setup = build_setup(load_game(scenarios_directory() / f'{name}.yaml'))
    drivers, intervals_s = recorded_inputs(setup)
    return run_record_of(run_offline(
        setup, duration_s=duration_s, drivers=drivers, intervals_s=intervals_s,
        check_drivability=False, triggers=triggers))


@pytest.fixture(scope='module')
def changed() -> tuple[DriverBehaviour, ...]:
    """Measure the human that changes lanes in a bend, in front of the AV."""
    return measure_behaviour(_play('lane_change', 12.0))


@pytest.mark.slow
@pytest.mark.parametrize('name', OF_VEHICLES)
def test_every_measure_of_a_vehicle_is_there(
        name: str, changed: tuple[DriverBehaviour, ...]) -> None:
    """The human has finite values, with definitions; the AV those that need no commands."""
    human, av = changed
    assert math.isfinite(human.values[name])
    assert human.as_dict()['measures'][name] == {
        'value': human.values[name], 'unit': MEASURES[name].unit}
    commanded = name.startswith(('throttle', 'brake', 'srr'))
    assert math.isnan(av.values[name]) is commanded
    assert (av.as_dict()['measures'][name]['value'] is None) is not math.isfinite(av.values[name])


@pytest.mark.parametrize('name', OF_OTHERS)
def test_every_measure_of_something_else_is_defined(name: str) -> None:
    """Each column of events, lane changes, take-overs and steps has its entry."""
    assert MEASURES[name].per != 'vehicle'


def test_the_data_dictionary_is_whole() -> None:
    """No entry lacks a text, and none is superfluous; all units are SI units, or degrees."""
    assert [name for name, each in MEASURES.items() if each.per == 'vehicle'] == list(
        dict.fromkeys([name for name in MEASURES if name in OF_VEHICLES]))
    assert sorted(MEASURES) == sorted([*OF_VEHICLES, *OF_OTHERS])
    for each in MEASURES.values():
        assert each.unit in ('1', 's', 'm', 'm/s', 'm/s^2', 'm/s^3', '1/min')
        assert each.definition and each.variant and each.reference_point
        assert each.per in ('vehicle', 'event', 'lane change', 'take-over', 'step')


def test_motion_is_that_of_the_states(changed: tuple[DriverBehaviour, ...]) -> None:
    """Speed, jerk and time above the limit by hand from the run's states."""
    record = _play('lane_change', 12.0)
    human = changed[0].values
    speed = record.log.vehicle_states[:, 0, StateColumn.SPEED]
    jerk = np.diff(record.log.vehicle_states[:, 0, StateColumn.ACCELERATION]) / 0.1
    assert human['speed_sd'] == pytest.approx(speed.std(ddof=1))
    assert (human['jerk_min'], human['jerk_max']) == pytest.approx((jerk.min(), jerk.max()))
    # 80 km/h, as on the signs.
    assert human['time_above_limit'] == pytest.approx(
        0.1 * (speed[:-1] > 80.0 / 3.6).sum())
    assert human['time_with_limit'] == pytest.approx(12.0)
    assert changed[0].driven_s == pytest.approx(12.0) and changed[1].driven_s == 0.0


def test_the_gap_before_the_av(changed: tuple[DriverBehaviour, ...]) -> None:
    """One change to the right; the gap is that of the arc lengths, to some centimetres."""
    record = _play('lane_change', 12.0)
    change, = changed[0].lane_changes
    assert (change.side, change.leader, change.follower) == ('right', None, 'av0')
    row = round(change.time_s / 0.1)
    human, av = record.log.vehicle_states[row]
    vehicle = record.log.game.vehicles[0].vehicle
    away = math.dist(human[:2], av[:2]) - vehicle.length
    assert change.gap.follower is not None
    # The chord of 28 m of a bend of 400 m, at two lateral offsets.
    assert change.gap.follower.gap == pytest.approx(away, abs=0.25)
    assert change.gap.follower.time_gap_s == pytest.approx(
        change.gap.follower.gap / av[StateColumn.SPEED], rel=1e-3)


def test_events_reactions_and_limits() -> None:
    """One event sets a limit, and the driver brakes a second after another event."""
    record = _play('crossing', 8.0, ((200, 'slow-zone'), (400, 'pedestrian')))
    commands = record.commands.copy()
    commands[:, 0, :3] = (0.3, 0.0, 0.0)
    commands[500:, 0, :3] = (0.0, 0.5, 0.0)
    found = measure_behaviour(replace(record, commands=commands))[0]
    speed = record.log.vehicle_states[:, 0, StateColumn.SPEED]
    assert found.values['time_above_limit'] == pytest.approx(
        0.1 * (speed[20:-1] > 8.3333).sum()) != 0.0
    slow, pedestrian = found.reactions
    assert (slow.event, pedestrian.event) == ('slow-zone', 'pedestrian')
    assert pedestrian.reaction.brake_s == pytest.approx(1.01)
    assert pedestrian.reaction.throttle_s == pytest.approx(1.01)
    assert math.isnan(pedestrian.reaction.steering_s)
    assert found.as_dict()['reactions'][0]['reaction_brake'] == pytest.approx(3.01)


def _taken_over(record: RunRecord) -> RunRecord:
    """Make a take-over of the AV: asked at 2 s, driven from 3 s to 7 s, hands on at 3.5 s."""
    commands = record.commands.copy()
    driven = (record.times_s >= 3.0 - 1e-9) & (record.times_s <= 7.0 + 1e-9)
    commands[driven, 1] = 0.0
    commands[driven & (record.times_s >= 3.5 - 1e-9), 1, 0] = 0.3
    return replace(record, commands=commands, orders=(
        SeatOrder(100, 'av0', 'game'), SeatOrder(150, 'hv0', 'cockpit'),
        SeatOrder(200, 'av0', 'cockpit'), SeatOrder(700, 'av0', 'game')))


def test_a_take_over_of_an_av() -> None:
    """Only orders of the AV's seat are requests, or a named event."""
    record = _taken_over(_play('crossing', 8.0, ((200, 'slow-zone'), (400, 'pedestrian'))))
    human, av = measure_behaviour(record)
    take_over, = av.take_overs
    assert not human.take_overs and take_over.request == (2.0, 'order')
    assert (take_over.to_hands_on_s, take_over.to_stable_s) == pytest.approx((1.5, 1.5))
    assert av.driven_s == pytest.approx(4.01)
    named = measure_behaviour(replace(record, orders=()), requests=['slow-zone'])[1]
    assert named.as_dict()['take_overs'][0]['request'] == 'slow-zone'
    unnamed = measure_behaviour(replace(record, orders=()))[1].as_dict()['take_overs'][0]
    assert unnamed['take_over_hands_on'] is None and unnamed['hands_on_s'] == pytest.approx(3.5)


def _turned(record: RunRecord, angle: float) -> RunRecord:
    """Turn a run with its roads about the origin."""
    cos, sin = math.cos(angle), math.sin(angle)

    def turn(x: Any, y: Any) -> tuple[Any, Any]:
        return cos * x - sin * y, sin * x + cos * y
    root = etree.fromstring(record.log.xml_text.encode())
    for point in root.iter():
        x, y = point.find('x'), point.find('y')
        if x is not None and y is not None and x.text and y.text:
            x.text, y.text = (repr(each) for each in turn(float(x.text), float(y.text)))
    states, poses = record.log.vehicle_states.copy(), record.log.object_poses.copy()
    velocities = record.log.object_velocities.copy()
    for array in (states, poses):
        array[..., 0], array[..., 1] = turn(array[..., 0], array[..., 1])
        array[..., 2] = wrap_pi_array(array[..., 2] + angle)
    velocities[..., 0], velocities[..., 1] = turn(velocities[..., 0], velocities[..., 1])
    return replace(record, log=replace(
        record.log, xml_text=etree.tostring(root).decode(), vehicle_states=states,
        object_poses=poses, object_velocities=velocities))


def _numbers(found: Sequence[DriverBehaviour]) -> NDArray[np.float64]:
    numbers: list[float] = []
    for each in found:
        numbers += [*each.values.values(), *each.tlc_s, *each.tlc_linear_s]
        for change in each.lane_changes:
            assert change.gap.follower is not None
            numbers += [change.time_s, *change.gap.follower]
    return np.array(numbers)


@pytest.mark.matrix('2.3')
@pytest.mark.slow
@pytest.mark.parametrize('angle', [0.5, math.pi / 2, 2.3, -2.9])
def test_nothing_depends_on_the_maps_axes(
        angle: float, changed: tuple[DriverBehaviour, ...]) -> None:
    """All values and series of a turned run are those of the run, to 1e-9."""
    expected = _numbers(changed)
    found = _numbers(measure_behaviour(_turned(_play('lane_change', 12.0), angle)))
    finite = np.isfinite(expected)
    assert finite.sum() > 200 and np.array_equal(expected[~finite], found[~finite],
                                                 equal_nan=True)
    np.testing.assert_allclose(found[finite], expected[finite], rtol=1e-9, atol=1e-9)


def test_all_are_measured_where_their_road_is(changed: tuple[DriverBehaviour, ...]) -> None:
    """The AV drives elsewhere than it plans (CRG 9), the human with it: values as on the road."""
    record = _play('lane_change', 12.0)
    transform = RigidTransform(0.7, 120.0, -40.0)
    states = record.log.vehicle_states.copy()
    states[..., :3] = transform.to_simulation(states[..., :3])
    game = replace(record.log.game, avs=(
        replace(record.log.game.avs[0], transform=transform),))
    log = replace(record.log, game=game, vehicle_states=states)
    for number, (moved, found) in enumerate(zip(
            measure_behaviour(replace(record, log=log)), changed, strict=True)):
        assert moved.values == pytest.approx(found.values, rel=1e-8, abs=1e-9, nan_ok=True)
        assert np.isfinite(found.tlc_s).any()
        assert moved.tlc_s == pytest.approx(found.tlc_s, rel=1e-6)
        assert drive_of(log, number).poses == pytest.approx(drive_of(record.log, number).poses)


def test_json_holds_no_number_that_is_none(changed: tuple[DriverBehaviour, ...]) -> None:
    """It has no NaN and no Infinity."""
    for each in changed:
        text = json.dumps(each.as_dict(), allow_nan=False)
        assert json.loads(text)['measures'].keys() == each.values.keys()
        assert len(each.tlc_s) == len(each.times_s) == 121


def test_the_same_record_gives_the_same_bits(changed: tuple[DriverBehaviour, ...]) -> None:
    """Deterministic."""
    again = measure_behaviour(_play('lane_change', 12.0))
    assert _numbers(again).tobytes() == _numbers(changed).tobytes()


def test_a_driver_of_nothing_but_noise_is_measured() -> None:
    """A human drives off the road: no lane, no failure."""
    setup = build_setup(load_game(scenarios_directory() / 'lane_change.yaml'))
    commands = np.zeros((600, 4))
    commands[:, 0], commands[:, 2] = 0.3, 0.6
    result = run_offline(setup, duration_s=6.0, drivers={'hv0': ReplayDriver(commands)},
                         check_drivability=False)
    human = measure_behaviour(run_record_of(result))[0]
    assert np.isnan(human.tlc_s).any() and human.values['lane_changes'] <= 1.0
