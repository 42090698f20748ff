# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The standard's callbacks on a real run and its control, with stand-ins for the messages.

`test/live/test_simulation_interfaces.py` calls them over DDS where the real ones are installed.
"""

from collections.abc import Callable, Coroutine, Iterator
from importlib.util import find_spec
import math
from pathlib import Path
from typing import Any

from crgame_ros.game.game import load_game
from crgame_ros.game.objects import ObjectStates
from crgame_ros.messages.contract import load_contract
from crgame_ros.nodes.sim.control import SimControl
from crgame_ros.nodes.sim.entities import Entities, Region
from crgame_ros.nodes.sim.simulation_interfaces import (
    offer_simulation_interfaces,
    SimulationInterfaces,
)
from crgame_ros.simulation.engine import Simulation
from crgame_ros.simulation.setup import build_setup
from crgame_ros.vehicle.driver_command import DriverCommand
from geometry_msgs.msg import Vector3
import numpy as np
import pytest
import rclpy
from rclpy.context import Context
from rclpy.parameter import Parameter
from ros_domains import own_domain_id
import shapely
from standard_messages import PARTS, stand_in_modules, StandIn, use_stand_ins

GAME = Path(__file__).resolve().parents[2] / 'scenarios' / 'crossing.yaml'
OFFSET_NS = 7_000_000_000
DT_S = 0.01
N = 17
GAS = DriverCommand(throttle=0.6, steering=0.2)


@pytest.fixture(scope='module')
def simulation() -> Simulation:
    """Return a run in which everybody has moved, between two scenario steps."""
    simulation = Simulation(build_setup(load_game(GAME)), OFFSET_NS)
    simulation.begin()
    for _ in range(N):
        simulation.step(DT_S, [GAS])
    return simulation


class Desk:
    """The standard's callbacks on the node of a test, and the loop's part of its control."""

    def __init__(self, node: object, simulation: Simulation, package: Any) -> None:
        self.control = SimControl(node)
        self.interfaces = SimulationInterfaces(node, self.control)
        self.interfaces.show(simulation)
        self.control.begun = True
        self.n = simulation.n
        self.package, self.msg = package, package.msg

    def start(self, name: str, **fields: object) -> 'Call':
        """Call a service by the name of its type."""
        kind = getattr(self.package.srv, name)
        row, = (row for row in load_contract().services.values()
                if row.type_name == f'simulation_interfaces/srv/{name}')
        return Call(self.interfaces.callbacks[row.name](kind.Request(**fields), kind.Response()))

    def ask(self, name: str, **fields: object) -> Any:
        """Return the answer of a service that answers at once."""
        return self.start(name, **fields).answer

    def set_state(self, name: str) -> 'Call':
        """Ask for a state by its name."""
        states = self.msg.SimulationState
        return self.start('SetSimulationState', state=states(state=getattr(states, name)))

    @property
    def state(self) -> str:
        """Name of the present state."""
        answer = self.ask('GetSimulationState')
        assert answer.result.result == self.msg.Result.RESULT_OK
        states = vars(self.msg.SimulationState)
        return next(name for name, value in states.items()
                    if name.startswith('STATE_') and value == answer.state.state)

    def cycle(self) -> None:
        """Do what the loop does for its control after a step."""
        assert not self.control.stands_still
        self.n += 1
        self.control.count_step(10, self.n)


class Call:
    """A call that may wait; as rclpy does, each look at its answer lets it go on."""

    def __init__(self, work: object) -> None:
        self._work, self._answer = work, None if isinstance(work, Coroutine) else work

    @property
    def answer(self) -> Any:
        """Return the answer; None before there is one."""
        if self._answer is None:
            try:
                self._work.send(None)
            except StopIteration as end:
                self._answer = end.value
        return self._answer


@pytest.fixture
def desk(simulation: Simulation, monkeypatch: pytest.MonkeyPatch) -> Iterator[Desk]:
    """Return the callbacks, with stand-ins for the messages."""
    package = use_stand_ins(monkeypatch)
    context = Context()
    rclpy.init(context=context, domain_id=own_domain_id())
    node = rclpy.create_node('sim_node', context=context)
    yield Desk(node, simulation, package)
    node.destroy_node()
    context.try_shutdown()


def test_parameters_that_are_refused_together_choose_nothing(desk: Desk) -> None:
    """A scenario that comes with an unusable factor is not what the next reset loads."""
    node = desk.interfaces._node
    assert desk.control.choice == ('game', '')
    for factor, chosen in (('fast', 'game'), (2.0, 'scenario')):
        done = node.set_parameters_atomically([
            Parameter('scenario', value='ZAM_CutIn-1_1_T-1'),
            Parameter('real_time_factor', value=factor)])
        assert done.successful is (chosen == 'scenario')
        assert desk.control.choice[0] == chosen
    assert desk.control.choice[1] == 'ZAM_CutIn-1_1_T-1'


def test_stand_ins_have_the_fields_of_the_real_messages() -> None:
    """Each field and constant is one of the installed package."""
    if find_spec('simulation_interfaces') is None:
        pytest.skip('the package simulation_interfaces is not installed')
    import importlib
    for kind, parts in PARTS.items():
        real = importlib.import_module(f'simulation_interfaces.{kind}')
        for name, stand_in in vars(stand_in_modules()[f'simulation_interfaces.{kind}']).items():
            if not isinstance(stand_in, type):
                continue
            for part in parts:
                ours, theirs = (getattr(item, part) if part else item
                                for item in (stand_in, getattr(real, name)))
                fields = [f'sequence<{text[:-2]}>' if text.endswith('[]') else text
                          for text in ours.FIELDS.values()]
                told = [text.replace('simulation_interfaces/', '').replace('boolean', 'bool')
                        for text in theirs.get_fields_and_field_types().values()]
                assert (list(ours.FIELDS), fields) == (list(
                    theirs.get_fields_and_field_types()), told), (name, part)
                constants = {key: value for key, value in vars(ours).items() if key.isupper()
                             and isinstance(value, int)}
                assert constants == {key: getattr(theirs, key) for key in constants}


def test_offered_where_the_package_is(desk: Desk, monkeypatch: pytest.MonkeyPatch) -> None:
    """Each service of the contract has a callback; without the package there is none."""
    contract = load_contract()
    optional = {row.name for row in contract.services.values() if row.optional}
    assert optional == set(desk.interfaces.callbacks) and set(contract.actions) == {
        '/simulate_steps'}
    monkeypatch.delattr(desk.msg, 'WorldResource')
    assert offer_simulation_interfaces(desk.interfaces._node, desk.control) is None
    monkeypatch.undo()
    if find_spec('simulation_interfaces') is None:
        assert offer_simulation_interfaces(desk.interfaces._node, desk.control) is None


def test_features_are_those_that_are_served(desk: Desk) -> None:
    """None of what there is not: scopes of time, convex filters."""
    features = desk.ask('GetSimulatorFeatures').features
    kind = desk.msg.SimulatorFeatures
    names = {name for name, value in vars(kind).items()
             if name.isupper() and value in features.features}
    assert len(names) == len(features.features) and not features.spawn_formats
    assert {'SIMULATION_STATE_PAUSE', 'STEP_SIMULATION_ACTION', 'ENTITY_BOUNDS_BOX'} <= names
    assert not names & {'SIMULATION_RESET_TIME', 'ENTITY_BOUNDS_CONVEX'}
    assert 'rear axle' in features.custom_info


def test_entities_are_told_by_what_passes_the_filters(desk: Desk, simulation: Simulation) -> None:
    """Names, categories, tags and volumes; what has not come yet is none."""
    msg, ok = desk.msg, desk.msg.Result.RESULT_OK
    everybody = ['hv0', 'av0', 'o200', 'o201']
    kinds = msg.EntityCategory
    x, y, _ = simulation.objects.poses[1].tolist()
    # The pedestrian is a circle of 0.35 m, 1.75 m tall.
    cases: list[tuple[dict[str, object], list[str]]] = [
        ({}, everybody), ({'filter': 'o.*'}, ['o200', 'o201']), ({'filter': 'o'}, []),
        ({'categories': [kinds(category=kinds.CATEGORY_HUMAN)]}, ['o201']),
        ({'categories': [kinds(category=kinds.CATEGORY_ROBOT)], 'filter': '[^h].*'}, ['av0']),
        ({'categories': [kinds(category=kinds.CATEGORY_OBJECT)]}, []),
        ({'tags': msg.TagsFilter(tags=['car', 'pedestrian'])}, everybody),
        ({'tags': msg.TagsFilter(tags=['car', 'recorded'], filter_mode=1)}, ['o200']),
        # Nothing is left of which a volume could be asked.
        ({'filter': 'o', 'bounds': msg.Bounds(type=1, points=[Vector3(), Vector3()])}, [])]
    cases += [({'bounds': msg.Bounds(type=kind, points=[Vector3(x=a, y=b, z=c)
                                                        for a, b, c in points])}, expected)
              for kind, points, expected in (
                  (0, (), everybody),
                  (1, ((x + 1.0, y + 1.0, 1.0), (x - 1.0, y - 1.0, 0.5)), ['o201']),
                  (1, ((x - 1.0, y - 1.0, 0.5), (x - 0.36, y + 1.0, 1.0)), []),
                  (1, ((x + 1.0, y + 1.0, 3.0), (x - 1.0, y - 1.0, 1.8)), []),
                  (3, ((x + 2.0, y, 1.0), (1.64, 0.0, 0.0)), []),
                  (3, ((x + 2.0, y, 1.0), (1.66, 0.0, 0.0)), ['o201']),
                  # 3 m above its head, 4 m beside it: at a distance of 5 m.
                  (3, ((x + 4.35, y, 4.75), (4.99, 0.0, 0.0)), []),
                  (3, ((x + 4.35, y, 4.75), (5.01, 0.0, 0.0)), ['o201']))]
    for fields, expected in cases:
        answer = desk.ask('GetEntities', filters=msg.EntityFilters(**fields))
        assert (answer.result.result, answer.entities) == (ok, expected), fields
        states = desk.ask('GetEntitiesStates', filters=msg.EntityFilters(**fields))
        assert states.entities == expected and len(states.states) == len(expected)
    assert desk.ask('GetEntityState', entity='e_roadworks').result.result \
        == msg.Result.RESULT_NOT_FOUND


def test_filters_that_cannot_be_used_are_refused(desk: Desk) -> None:
    """With the standard's codes, a reason, and nothing found."""
    msg = desk.msg
    failed = msg.Result.RESULT_OPERATION_FAILED
    for fields, code, reason in (
            ({'filter': '('}, failed, 'filter'),
            ({'tags': msg.TagsFilter(filter_mode=2)}, failed, 'mode 2'),
            ({'bounds': msg.Bounds(type=1)}, failed, '0 points'),
            ({'bounds': msg.Bounds(type=9)}, failed, 'type 9'),
            ({'bounds': msg.Bounds(type=3, points=[Vector3(x=math.nan), Vector3(x=1.0)])},
             failed, 'finite'),
            ({'bounds': msg.Bounds(type=3, points=[Vector3(), Vector3(x=-1.0)])}, failed, '-1'),
            ({'bounds': msg.Bounds(type=2)}, msg.Result.RESULT_FEATURE_UNSUPPORTED, 'boxes')):
        answer = desk.ask('GetEntities', filters=msg.EntityFilters(**fields))
        assert answer.result.result == code and reason in answer.result.error_message, fields
        assert answer.entities == []


def test_states_are_of_the_reference_point_in_map(desk: Desk, simulation: Simulation) -> None:
    """Driven vehicles by their rear axle at n, objects by their centre at the scenario step."""
    human = simulation.states[0]
    told = desk.ask('GetEntityState', entity='hv0').state
    assert (told.header.frame_id, told.header.stamp.sec, told.header.stamp.nanosec) == (
        'map', 7, N * 10_000_000)
    assert (told.pose.position.x, told.pose.position.y) == (human.x, human.y)
    turn = told.pose.orientation
    assert math.atan2(2.0 * turn.w * turn.z, 1.0 - 2.0 * turn.z ** 2) == pytest.approx(human.yaw)
    speed = complex(told.twist.linear.x, told.twist.linear.y)
    assert speed == pytest.approx(human.speed * np.exp(1j * human.yaw))
    assert told.twist.angular.z == human.yaw_rate != 0.0
    # The derivative of v e^(i yaw): along the vehicle a, across it v times the yaw rate.
    pushed = complex(told.acceleration.linear.x, told.acceleration.linear.y)
    assert pushed * np.exp(-1j * human.yaw) == pytest.approx(
        complex(human.acceleration, human.speed * human.yaw_rate))
    assert math.isnan(told.acceleration.angular.z)

    told = desk.ask('GetEntityState', entity='o200').state
    assert told.header.stamp.nanosec == 100_000_000
    assert [told.pose.position.x, told.pose.position.y] == simulation.objects.poses[0, :2].tolist()
    assert [told.twist.linear.x, told.twist.linear.y, told.twist.angular.z] \
        == simulation.objects.velocities[0].tolist()
    assert math.isnan(told.acceleration.linear.x)


def test_bounds_and_info_describe_the_body(desk: Desk, simulation: Simulation) -> None:
    """A box around the reference point: the centre is ahead of the rear axle."""
    vehicle = simulation.setup.humans[0].vehicle
    one, other = desk.ask('GetEntityBounds', entity='hv0').bounds.points
    assert (one.x + other.x) / 2.0 == pytest.approx(vehicle.rear_to_center)
    assert (one.x - other.x, one.y, other.y) == pytest.approx(
        (vehicle.length, vehicle.width / 2.0, -vehicle.width / 2.0))
    assert (one.z, other.z) == (1.5, 0.0)
    one, other = desk.ask('GetEntityBounds', entity='o201').bounds.points
    assert (one.x, one.y, one.z) == pytest.approx((0.35, 0.35, 1.75))
    assert (other.x, other.y, other.z) == pytest.approx((-0.35, -0.35, 0.0))
    info = desk.ask('GetEntityInfo', entity='av0').info
    assert info.category.category == desk.msg.EntityCategory.CATEGORY_ROBOT
    assert info.tags == ['autonomous', 'car'] and 'rear_axle' in info.description
    for name in ('GetEntityInfo', 'GetEntityBounds'):
        assert desk.ask(name, entity='hv7').result.result == desk.msg.Result.RESULT_NOT_FOUND


def test_an_object_that_comes_is_static(simulation: Simulation) -> None:
    """Roadworks are present once they have a pose, and stand still."""
    entities = Entities(simulation)
    place = next(index for index, item in enumerate(entities.descriptions)
                 if item.id == 'e_roadworks')
    poses, velocities = simulation.objects.poses.copy(), simulation.objects.velocities.copy()
    poses[place - 2], velocities[place - 2] = (10.0, 3.0, 0.5), 0.0
    world = simulation._world
    before, world.objects = world.objects, ObjectStates(poses, velocities)
    try:
        assert entities.find('e_roadworks') == place and place in entities.present()
        assert entities.motion(place).acceleration == (0.0, 0.0, 0.0)
        # Its corner at half of 8 m ahead and 2.5 m to the left, by shapely's own rotation.
        corner = shapely.affinity.translate(
            shapely.affinity.rotate(shapely.Point(4.0, 1.25), 0.5, (0, 0), use_radians=True),
            10.0, 3.0)
        for radius, expected in ((0.09, False), (0.11, True)):
            found = entities.select(region=Region.sphere((
                corner.x + 0.1 * math.cos(0.5), corner.y + 0.1 * math.sin(0.5), 0.0), radius))
            assert (place in found) == expected
    finally:
        world.objects = before


def test_steps_are_answered_when_they_are_done(desk: Desk) -> None:
    """Steps are those of the simulation; others' orders wait for their turn."""
    ok, failed = desk.msg.Result.RESULT_OK, desk.msg.Result.RESULT_OPERATION_FAILED
    assert desk.ask('StepSimulation', steps=1).result.result == failed
    assert desk.set_state('STATE_PAUSED').answer.result.result == ok
    assert desk.control.stands_still
    assert desk.ask('StepSimulation', steps=0).result.result == ok
    first, second = desk.start('StepSimulation', steps=3), desk.start('StepSimulation')
    assert first.answer is None and second.answer is None
    for _ in range(3):
        assert first.answer is None
        desk.cycle()
    assert first.answer.result.result == ok and second.answer is None
    desk.cycle()
    assert second.answer.result.result == ok and desk.control.stands_still
    # Somebody lets the run go on.
    third = desk.start('StepSimulation', steps=2 ** 63)
    assert third.answer is None
    desk.cycle()
    assert desk.set_state('STATE_PLAYING').answer.result.result == ok
    desk.cycle()
    assert third.answer.result.result == failed
    assert f'1 of {2 ** 63} steps' in third.answer.result.error_message


class Goal:
    """A goal of the action, as rclpy hands it over."""

    def __init__(self, steps: int) -> None:
        self.request = StandInGoal(steps)
        self.goal_id = type('Id', (), {'uuid': np.arange(16, dtype=np.uint8)})
        self.feedback: list[tuple[int, int]] = []
        self.is_cancel_requested, self.ended = False, ''
        self.succeed, self.canceled, self.abort = map(
            self._end, ('succeeded', 'cancelled', 'aborted'))

    def _end(self, name: str) -> Callable[[], None]:
        return lambda: setattr(self, 'ended', name)

    def publish_feedback(self, feedback: StandIn) -> None:
        """Keep the feedback."""
        self.feedback.append((feedback.completed_steps, feedback.remaining_steps))


class StandInGoal:
    """The request of a goal."""

    def __init__(self, steps: int) -> None:
        self.steps = steps


def test_action_tells_each_step_and_can_be_cancelled(desk: Desk) -> None:
    """Feedback after each step; a cancelled goal leaves the run paused."""
    result = desk.msg.Result
    goal = Goal(2)
    assert Call(desk.interfaces.on_simulate_steps(goal)).answer.result.result \
        == result.RESULT_OPERATION_FAILED
    assert goal.ended == 'aborted'
    desk.set_state('STATE_PAUSED').answer  # noqa: B018 - lets the call be served
    goal = Goal(2)
    call = Call(desk.interfaces.on_simulate_steps(goal))
    assert call.answer is None
    desk.cycle()
    desk.cycle()
    assert call.answer.result.result == result.RESULT_OK and goal.ended == 'succeeded'
    assert goal.feedback == [(1, 1), (2, 0)]
    assert not desk.interfaces.on_cancel(goal)
    goal = Goal(5)
    call = Call(desk.interfaces.on_simulate_steps(goal))
    assert call.answer is None
    desk.cycle()
    assert desk.interfaces.on_cancel(goal)
    goal.is_cancel_requested = True
    assert desk.control.stands_still
    assert '1 of 5' in call.answer.result.error_message and goal.ended == 'cancelled'


def test_states_and_their_transitions(desk: Desk) -> None:
    """A stop needs a reset once the run has begun; at its first step a run may be paused."""
    ok, control, kind = desk.msg.Result.RESULT_OK, desk.control, \
        desk.package.srv.SetSimulationState.Response
    assert desk.state == 'STATE_PLAYING'
    assert desk.set_state('STATE_PLAYING').answer.result.result == kind.ALREADY_IN_TARGET_STATE
    for name in ('STATE_NO_WORLD', 'STATE_LOADING_WORLD'):
        assert desk.set_state(name).answer.result.result == kind.INCORRECT_TRANSITION
    stop = desk.set_state('STATE_STOPPED')
    assert stop.answer is None and control.reset_wanted
    # What the node does between two runs.
    control.begun = False
    control.end_reset(None)
    assert stop.answer.result.result == ok
    assert desk.state == 'STATE_STOPPED' and control.stands_still and not control.started
    assert 'not paused' in desk.ask('StepSimulation').result.error_message
    assert desk.set_state('STATE_PAUSED').answer.result.result == ok
    assert desk.state == 'STATE_PAUSED'
    control.awaited = ('hv0',)
    assert desk.ask('StepSimulation').result.result == desk.msg.Result.RESULT_INCORRECT_STATE
    control.awaited = ()
    assert desk.set_state('STATE_STOPPED').answer.result.result == ok
    assert desk.state == 'STATE_STOPPED' and not control.reset_wanted
    assert desk.set_state('STATE_PLAYING').answer.result.result == ok
    assert not control.paused and control.started
    # A run that is over stands stopped, and begins anew.
    control.over = True
    assert desk.state == 'STATE_STOPPED'
    again = desk.set_state('STATE_PLAYING')
    assert again.answer is None and control.reset_wanted and control.started
    control.over = False
    control.end_reset('cut_in.yaml: is gone')
    assert again.answer.result.result == kind.STATE_TRANSITION_ERROR
    assert 'is gone' in again.answer.result.error_message
    assert desk.set_state('STATE_QUITTING').answer.result.result == ok
    assert control.stop_wanted and not control.stays and desk.state == 'STATE_QUITTING'
    assert desk.set_state('STATE_PLAYING').answer.result.result == kind.INCORRECT_TRANSITION


def test_reset_takes_the_scopes_that_there_are(desk: Desk) -> None:
    """Time never goes back, and nothing is spawned: in any combination these are refused."""
    result = desk.msg.Result
    for scope in (1, 4, 2 | 1, 2 | 4, 8):
        assert desk.ask('ResetSimulation', scope=scope).result.result \
            == result.RESULT_FEATURE_UNSUPPORTED
    assert not desk.control.reset_wanted
    for scope, problem, code in ((0, None, result.RESULT_OK), (2, None, result.RESULT_OK),
                                 (255, 'no game', result.RESULT_OPERATION_FAILED)):
        call = desk.start('ResetSimulation', scope=scope)
        assert call.answer is None and desk.control.reset_wanted
        desk.control.end_reset(problem)
        assert call.answer.result.result == code
        assert not desk.control.reset_wanted


def test_worlds_are_scenarios_and_games_of_the_configured_folders(desk: Desk) -> None:
    """The world that is told can be loaded; a failure leaves the choice of before."""
    result, kind = desk.msg.Result, desk.package.srv.LoadWorld.Response
    world = desk.ask('GetCurrentWorld').world
    assert world.name == 'ZAM_Crossing-1_1_T-1' and 'urban' in world.tags
    assert world.world_resource.uri.endswith('/scenarios/ZAM_Crossing-1_1_T-1.xml')
    for fields, code in (
            ({}, kind.NO_RESOURCE),
            ({'resource_string': '<commonRoad/>'}, result.RESULT_FEATURE_UNSUPPORTED),
            ({'uri': 'file:///w.sdf'}, kind.UNSUPPORTED_FORMAT),
            ({'uri': 'file:///etc/w.xml'}, result.RESULT_NOT_FOUND),
            ({'uri': world.world_resource.uri, 'fail_on_unsupported_element': True},
             result.RESULT_FEATURE_UNSUPPORTED)):
        answer = desk.ask('LoadWorld', **fields)
        assert answer.result.result == code, fields
        assert not desk.control.reset_wanted
    for uri, problem, code, choice in (
            (world.world_resource.uri, None, result.RESULT_OK,
             ('scenario', world.world_resource.uri.removeprefix('file://'))),
            ('merge.yaml', 'cut off', kind.RESOURCE_PARSE_ERROR,
             ('scenario', world.world_resource.uri.removeprefix('file://'))),
            ('merge.yaml', None, result.RESULT_OK, ('game', 'merge.yaml'))):
        call = desk.start('LoadWorld', uri=uri)
        assert call.answer is None
        desk.control.begun = False
        desk.control.end_reset(problem)
        assert call.answer.result.result == code
        assert desk.control.choice == choice and desk.state == 'STATE_STOPPED'
