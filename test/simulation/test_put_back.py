# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""After a contact a person's vehicle is put back on its lane if the driver asks for it."""

from collections.abc import Sequence
import math
from pathlib import Path

from crgame_ros.analysis.behaviour.lane_keeping import keep_lane
from crgame_ros.analysis.scores.scored_run import score_run
from crgame_ros.driver.source import ReplayDriver
from crgame_ros.game.game import DrivabilitySpec, HumanSpec, load_game, PoseSpawn
from crgame_ros.game.objects import ObjectStates
from crgame_ros.paths import scenarios_directory
from crgame_ros.recording.export import write_scenario
from crgame_ros.recording.recorded_game import inputs_of
from crgame_ros.recording.run_record import run_record_of
from crgame_ros.scenario.loading import load_scenario, LoadedScenario
from crgame_ros.simulation.contacts import contacts_of
from crgame_ros.simulation.engine import Simulation
from crgame_ros.simulation.offline import OfflineResult, run_offline
from crgame_ros.simulation.setup import Setup
from crgame_ros.simulation.stopped_drivers import PutBack
from crgame_ros.vehicle.driver_command import DriverCommand
from crgame_ros.vehicle.state import StateColumn, VehicleState
from crgame_ros.verdict.validation import validate
import numpy as np
import pytest
import shapely
import simulation_support as support
from simulation_support import HandDriven
from test_contact_stop import footprint

GAS, IDLE = DriverCommand(throttle=1.0), DriverCommand()
BACK = DriverCommand(put_back=True)
# In the lane whose middle is y = 0, askew; the other comes from behind.
STANDS = HumanSpec('hv1', 'idle', spawn=PoseSpawn(-60.0, 1.2, 0.2, 0.0))
COMES = HumanSpec('hv0', 'idle', spawn=PoseSpawn(-90.0, 0.0, 0.0, 10.0))


def setup_of(loaded: LoadedScenario, humans: Sequence[HumanSpec] = (COMES, STANDS),
             contact: str = 'stop') -> Setup:
    """Make a run with the given effect of a contact."""
    return support.setup_of(loaded, humans, drivability=DrivabilitySpec(contact=contact))


def crashed(setup: Setup) -> HandDriven:
    """Drive the first vehicle against the second."""
    run = HandDriven(setup)
    run.drive(400, commands=lambda n: [GAS, IDLE])
    assert run.simulation.states[0].speed < 0.5
    return run


def put_back(run: HandDriven) -> VehicleState:
    """Ask as the first driver, and return the vehicle's state after that."""
    run.drive(1, commands=lambda n: [BACK, IDLE])
    return run.simulation.states[0]


def test_it_stands_free_on_the_middle_of_its_lane_behind_the_contact(
        cut_in: LoadedScenario) -> None:
    run = crashed(setup_of(cut_in))
    before = run.simulation.states[0]
    after = put_back(run)
    lane = cut_in.scenario.lanelet_network.find_lanelet_by_position(
        [np.array([after.x, after.y])])[0][0]
    middle = shapely.LineString(
        cut_in.scenario.lanelet_network.find_lanelet_by_id(lane).center_vertices)
    assert middle.distance(shapely.Point(after.x, after.y)) < 1e-6
    assert math.cos(after.yaw) > 0.99 and after.speed == after.steering_angle == 0.0
    assert before.x - 15.0 < after.x < before.x
    gap = footprint(run.simulation.setup, 0, after).distance(
        footprint(run.simulation.setup, 1, run.simulation.states[1]))
    assert 5.0 <= gap < 7.0
    contact, event = run.simulation.fired
    assert (contact.name, contact.by) == ('contact of hv0 with hv1', 'contact')
    assert (event.vehicle, event.n, event.by) == ('hv0', run.simulation.n, 'driver')
    assert run.result.fired == (event,)
    run.drive(100, commands=lambda n: [GAS, IDLE])
    assert run.simulation.states[0].speed > 1.0


def test_nothing_happens_without_a_contact_twice_or_elsewhere(cut_in: LoadedScenario) -> None:
    run = HandDriven(setup_of(cut_in))
    run.drive(50, commands=lambda n: [BACK, BACK])
    assert not run.simulation.fired
    run = crashed(setup_of(cut_in))
    first = put_back(run)
    assert put_back(run) == first and [event.by for event in run.simulation.fired] == [
        'contact', 'driver']
    through = HandDriven(setup_of(cut_in, contact='through'))
    through.drive(400, commands=lambda n: [GAS._replace(put_back=n > 300), IDLE])
    assert not through.simulation.fired


def test_a_vehicle_that_has_driven_on_is_not_put_back(cut_in: LoadedScenario) -> None:
    run = crashed(setup_of(cut_in))
    backwards = DriverCommand(throttle=1.0, reverse=True)
    start = run.simulation.states[0]
    while math.dist(run.simulation.states[0][:2], start[:2]) < 21.0:
        run.drive(1, commands=lambda n: [backwards, IDLE])
    put_back(run)
    assert [event.by for event in run.simulation.fired] == ['contact']


def test_a_place_is_passed_over_where_another_vehicle_is(cut_in: LoadedScenario) -> None:
    """A third vehicle stands beside the place where the vehicle would be put."""
    free = put_back(crashed(setup_of(cut_in)))
    alongside = HumanSpec('hv2', 'idle', spawn=PoseSpawn(free.x - 1.0, free.y + 2.0, 0.0, 0.0))
    run = crashed(setup_of(cut_in, (COMES, STANDS, alongside)))
    assert footprint(run.simulation.setup, 2, run.simulation.states[2]).distance(
        footprint(run.simulation.setup, 0, free)) < 0.5
    after = put_back(run)
    assert after.x < free.x - 3.0
    for other in (1, 2):
        assert footprint(run.simulation.setup, 0, after).distance(
            footprint(run.simulation.setup, other, run.simulation.states[other])) >= 0.5


def test_a_place_is_passed_over_where_another_vehicle_comes(cut_in: LoadedScenario) -> None:
    """An AV at 14 m/s, 20 m behind the place, reaches it within two seconds."""
    run = crashed(setup_of(cut_in))
    setup, states = run.simulation.setup, list(run.simulation.states)
    places = PutBack(setup)
    nobody = ObjectStates(*(np.full((len(setup.obstacles.descriptions), 3), np.nan),) * 2)
    places.note(0, states[0])
    free = places.place(0, 0.0, states, nobody)
    assert free is not None
    for speed, is_free in ((14.0, False), (0.0, True)):
        states[2] = VehicleState(free.x - 20.0, free.y, 0.0, speed)
        places.note(0, states[0])
        assert (places.place(0, 0.0, states, nobody) == free) is is_free


def test_places_that_were_taken_are_asked_for_again(cut_in: LoadedScenario) -> None:
    """While a car at 60 m/s covers the lane there is none, after that the same as at once."""
    run = crashed(setup_of(cut_in))
    stopped, other, av = run.simulation.states
    places, objects = PutBack(run.simulation.setup), run.simulation.objects
    places.note(0, stopped)
    fast = VehicleState(stopped.x - 60.0, 0.0, 0.0, 60.0)
    for _ in range(2):
        assert places.place(0, 0.0, [stopped, fast, av], objects) is None
    assert places.place(0, 0.0, [stopped, other, av], objects) == put_back(run)


def test_in_the_oncoming_lane_it_is_put_on_its_own() -> None:
    loaded = load_scenario(load_game(
        scenarios_directory() / 'occluded_pedestrian.yaml').scenario)
    network = support.setup_of(loaded).network
    own = next(lane for lane in network.lanelet_ids if network.opposite_of(lane) is not None)
    s = 0.5 * network.line(own).length
    x, y, yaw = network.pose_on(own, s)
    oncoming = network.opposite_of(own)
    assert oncoming is not None
    there = network.pose_on(oncoming, network.locate(oncoming, x, y)[0])
    setup = setup_of(loaded, (HumanSpec('hv0', 'idle', spawn=PoseSpawn(*there[:2], yaw, 0.0)),))
    places = PutBack(setup)
    places.note(0, setup.humans[0].state)
    states = Simulation(setup).states
    nobody = ObjectStates(*(np.full((len(setup.obstacles.descriptions), 3), np.nan),) * 2)
    found = places.place(0, 0.0, states, nobody)
    assert found is not None and math.cos(found.yaw - yaw) > 0.99
    assert network.lanelet_at(found.x, found.y) == own


def run_with_put_back(loaded: LoadedScenario) -> OfflineResult:
    """Crash, be put back after 4 s, and drive on, as commands of a recording."""
    rows = np.zeros((800, 6))
    rows[:, 0] = 1.0
    rows[400:402, 5] = 1.0
    rows[410:, 1] = 0.2
    return run_offline(setup_of(loaded), duration_s=8.0, drivers={'hv0': ReplayDriver(rows)})


def test_the_same_commands_lead_to_the_same_states(cut_in: LoadedScenario) -> None:
    result = run_with_put_back(cut_in)
    events = [event for event in result.fired if event.vehicle is not None]
    assert [(event.vehicle, event.n) for event in events] == [('hv0', 401)]
    jump = np.hypot(*np.diff(result.states_of('hv0')[400:402, :2], axis=0)[0])
    assert jump > 2.0
    again = run_offline(result.setup, duration_s=8.0, drivers=inputs_of(result).drivers)
    assert again.state_hash == result.state_hash
    # While it was placed there was no contact: the first one ends there.
    assert not [item for item in result.violations
                if item.vehicle_id == 'hv0' and item.n >= 401 and item.collision]


def test_the_contact_is_named_once_with_the_speed_before_it(cut_in: LoadedScenario) -> None:
    """No verdict has it, because there is no overlap; braking in time would have avoided it."""
    result = run_with_put_back(cut_in)
    event = next(item for item in result.fired if item.touching == ('hv0', 'hv1'))
    (contact,) = contacts_of(result)
    assert (contact.vehicle_id, contact.other_id, contact.n) == ('hv0', 'hv1', event.n)
    before = result.states_of('hv0')[event.n - 1, StateColumn.SPEED]
    assert contact.speed == before > 5.0
    assert (contact.side, contact.kind) == ('front', 'stopped track')


def test_the_jump_is_no_change_of_lane(cut_in: LoadedScenario) -> None:
    """A vehicle moved to a neighbouring lane counts as newly on that lane."""
    record = run_record_of(run_with_put_back(cut_in))
    (row,) = record.jumps(0)
    states = record.log.vehicle_states[:, 0].copy()
    steps = np.hypot(*np.diff(states[:, :2], axis=0).T)
    assert row == 1 + int(np.argmax(steps))
    roads = support.setup_of(cut_in).network
    lane = roads.lanelet_at(*states[row, :2])
    assert lane is not None
    found = roads.lanelet_network.find_lanelet_by_id(lane)
    beside = found.adj_left if found.adj_left is not None else found.adj_right
    # As if the contact had been in the lane beside.
    width = roads.locate(beside, *states[row, :2])[1]
    side = np.array((-np.sin(states[row, 2]), np.cos(states[row, 2])))
    states[:row, :2] -= width * side
    vehicle = record.log.game.vehicles[0].vehicle
    keeping = [keep_lane(roads, states, vehicle, 0.1, jumps) for jumps in ((), (row,))]
    assert [len(each.changes) for each in keeping] == [1, 0]


@pytest.mark.slow
def test_score_way_and_export_know_of_the_jump(cut_in: LoadedScenario, tmp_path: Path) -> None:
    result = run_with_put_back(cut_in)
    record = run_record_of(result)
    assert record.put_back == {'hv0': (40,)}
    xs = result.states_of('hv0')[:, 0]
    by_hand = np.abs(np.diff(xs)).sum() - abs(xs[401] - xs[400])
    assert record.ways()[0] == pytest.approx(by_hand, abs=0.2)
    scored = score_run(record).vehicles[0]
    assert any('put back' in remark and '4.0 s' in remark for remark in scored.remarks)
    assert scored.commonroad is not None
    assert scored.commonroad.feasibility.feasible
    assert scored.commonroad.feasibility.transitions <= 40
    write_scenario(record.log, tmp_path / 'run.xml')
    assert not validate(tmp_path / 'run.xml').faults
