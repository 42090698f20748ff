# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Events in the engine: triggers and conditions, once each, at ticks, visible to all."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

from crgame_ros.errors import InputError
from crgame_ros.game.documents import EVENTS, FiredEvents, GAME
from crgame_ros.game.events import EventList, EventSpec, FiredEvent
from crgame_ros.game.game import AvSpec, HumanSpec, load_game, PoseSpawn
from crgame_ros.paths import scenarios_directory
from crgame_ros.scenario.loading import load_scenario, LoadedScenario
from crgame_ros.schema.reading import read
from crgame_ros.simulation.engine import Simulation
from crgame_ros.simulation.run_texts import describe_game
from crgame_ros.simulation.setup import Setup
import numpy as np
import pytest
import simulation_support as support
from simulation_support import HandDriven

HUMAN = HumanSpec('hv0', 'idle', spawn=PoseSpawn(80.0, 1.75, 0.0, 10.0))
RELEASE = {'name': 'walk', 'release': {'object': 201}}
BRAKE = {'name': 'brake', 'brake': {'object': 200}}
CONE = {'name': 'cone', 'obstacle': {'x': 300.0, 'y': -1.75}}


@pytest.fixture(scope='module')
def street() -> LoadedScenario:
    """Load a street with a leader (200) at 12.5 m/s and a pedestrian (201)."""
    return load_scenario(scenarios_directory() / 'ZAM_Crossing-1_1_T-1.xml')


def events_of(*entries: dict[str, Any]) -> tuple[EventSpec, ...]:
    """Read events as a game file has them."""
    return read(EventList, list(entries), 'events')


def setup_of(street: LoadedScenario, *entries: dict[str, Any], **fields: Any) -> Setup:
    """Make a run with events."""
    return support.setup_of(street, [HUMAN], events=events_of(*entries), **fields)


def column(run: HandDriven, object_id: str) -> int:
    """Find an object's row."""
    return run.simulation.setup.obstacles.ids.index(object_id)


def test_trigger_acts_once_at_the_next_tick(street: LoadedScenario) -> None:
    """Pressed at n = 13 it acts at n = 20, k = 2; pressed again it is refused."""
    run = HandDriven(setup_of(street, RELEASE))
    run.drive(13)
    assert run.simulation.trigger('walk') is None
    assert run.simulation.trigger('walk') is None
    run.drive(6)
    assert run.simulation.fired == ()
    run.drive(1)
    assert run.result.fired == (FiredEvent('walk', 20, 2, 'trigger'),)
    assert run.simulation.trigger('walk') == '"walk" has taken effect already'
    run.drive(10)
    assert run.result.fired == ()
    assert run.simulation.fired == (FiredEvent('walk', 20, 2, 'trigger'),)


def test_refusals_say_what_there_is(street: LoadedScenario) -> None:
    """Unknown names, an object that waits or is gone; a game without any event."""
    run = HandDriven(setup_of(street, RELEASE, BRAKE, {'name': 'halt', 'brake': {'object': 201}}))
    assert run.simulation.trigger('fly') == \
        'there is no event "fly"; the game has walk, brake, halt'
    assert run.simulation.trigger('halt') == 'o201 stands until it is released'
    assert Simulation(setup_of(street)).trigger('x' * 100) == \
        f'there is no event "{"x" * 40}"; the game has none'


def test_released_object_is_seen_by_all_from_that_tick_on(street: LoadedScenario) -> None:
    """In `/traffic/objects`, in the request's present and in its prediction."""
    run = HandDriven(setup_of(street, RELEASE))
    walker = column(run, 'o201')
    first = run.result.objects.poses[walker].copy()
    run.drive(40)
    np.testing.assert_array_equal(run.result.objects.poses[walker], first)
    request = run.result.requests['av0']
    place = request.names.index('o201/x')
    np.testing.assert_array_equal(request.positions[:, place:place + 3], np.tile(first, (31, 1)))
    run.simulation.trigger('walk')
    run.drive(20)
    assert run.result.objects.poses[walker, 1] == pytest.approx(first[1] + 0.14, abs=1e-3)
    request = run.result.requests['av0']
    np.testing.assert_allclose(np.diff(request.positions[:, place + 1]), 0.14, atol=1e-3)


def test_put_object_is_announced_and_absent_until_then(street: LoadedScenario) -> None:
    """`/scenario/objects` lists it from the start; its places are NaN up to its tick."""
    setup = setup_of(street, CONE | {'when': {'time': 0.5}})
    (cone,) = (item for item in setup.descriptions if item.id == 'e_cone')
    assert (cone.type, cone.role.value, cone.shape.length, cone.shape.width) == (
        'constructionZone', 'static', 2.0, 1.0)
    run = HandDriven(setup)
    run.drive(49)
    assert np.isnan(run.simulation.objects.poses[-1]).all()
    run.drive(1)
    assert run.result.fired == (FiredEvent('cone', 50, 5, 'condition'),)
    assert run.result.objects.poses[-1].tolist() == [300.0, -1.75, 0.0]
    place = run.result.requests['av0'].names.index('e_cone/x')
    assert (run.result.requests['av0'].positions[:, place] == 300.0).all()


def test_leader_brakes_for_everybody(street: LoadedScenario) -> None:
    """From 12.5 m/s at 4 m/s^2 it stands after 3.1 s and 19.5 m, and is predicted to stand."""
    run = HandDriven(setup_of(street, BRAKE))
    run.drive(10)
    run.simulation.trigger('brake')
    run.drive(10)
    leader, place = column(run, 'o200'), run.result.requests['av0'].names.index('o200/x')
    start = run.result.objects.poses[leader, 0]
    run.drive(20)
    speed = run.result.requests['av0'].velocities[0, place]
    assert speed == pytest.approx(12.5 - 4.0 * 0.25, abs=1e-2)
    steps = np.diff(run.result.requests['av0'].positions[:, place])
    np.testing.assert_allclose(steps, 0.1 * speed, atol=1e-4)
    run.drive(400)
    assert run.result.objects.poses[leader, 0] == pytest.approx(start + 12.5**2 / 8.0, abs=1e-3)


@pytest.mark.parametrize(('when', 'holds'), [
    ({'time': 0.34}, lambda n, human, av, leader: n >= 34),
    ({'step': 7}, lambda n, human, av, leader: n >= 70),
    ({'vehicle': 'hv0', 'x': 120.0, 'y': 1.75, 'radius': 30.0},
     lambda n, human, av, leader: abs(120.0 - human) <= 30.0),
    ({'vehicle': 'o200', 'x': 160.0, 'y': -1.75, 'radius': 12.0},
     lambda n, human, av, leader: abs(160.0 - leader) <= 12.0),
    ({'between': ['hv0', 'o201'], 'distance': 75.0},
     lambda n, human, av, leader: np.hypot(170.0 - human, 6.65) <= 75.0),
    ({'between': ['av0', 'hv0'], 'distance': 35.0},
     lambda n, human, av, leader: np.hypot(av - human, 3.5) <= 35.0),
], ids=['time', 'step', 'vehicle', 'object', 'human-object', 'av-human'])
def test_conditions(street: LoadedScenario, when: dict[str, Any],
                    holds: Callable[[int, float, float, float], bool]) -> None:
    """A condition fires at the first tick at which it holds; vehicles count by their centres."""
    setup = setup_of(street, CONE | {'when': when})
    run = HandDriven(setup)
    offset = setup.humans[0].vehicle.rear_to_center
    for _ in range(250):
        states = run.simulation.states
        now = run.result.tick and holds(
            run.simulation.n, states[0].x + offset, states[1].x + offset,
            float(run.simulation.objects.poses[column(run, 'o200'), 0]))
        assert bool(run.simulation.fired) >= bool(now)
        if run.simulation.fired:
            assert now
            break
        run.drive(1)
    assert run.simulation.fired[0].n == run.simulation.n > 0
    assert run.simulation.fired[0].by == 'condition'


def test_absent_objects_hold_no_condition_and_brake_when_they_come(
        street: LoadedScenario) -> None:
    """The cone is absent before it is put; the leader is absent after 30 s."""
    run = HandDriven(setup_of(
        street, CONE, BRAKE,
        {'name': 'late', 'plan_display': {'av': 'av0', 'show': False},
         'when': {'between': ['e_cone', 'hv0'], 'distance': 1000.0}}))
    run.drive(20)
    assert run.simulation.fired == ()
    run.simulation.trigger('cone')
    run.drive(20)
    assert [event.name for event in run.simulation.fired] == ['cone', 'late']
    run.drive(2980, plans=False)
    assert run.simulation.trigger('brake') == 'o200 is not there'


def test_events_of_one_tick_act_in_the_order_of_the_game(street: LoadedScenario) -> None:
    """In any order of the triggers; of two that release one object only the first acts."""
    run = HandDriven(setup_of(street, CONE, RELEASE, RELEASE | {'name': 'again'}))
    for name in ('again', 'walk', 'cone'):
        assert run.simulation.trigger(name) is None
    run.drive(10)
    assert [event.name for event in run.simulation.fired] == ['cone', 'walk']
    assert run.simulation.trigger('again') == 'o201 has been released already'


def test_stopped_planner_is_asked_for_nothing(street: LoadedScenario) -> None:
    """The AV follows its last plan of 4 s, then brakes; after the stop ends it is asked again."""
    run = HandDriven(setup_of(
        street, {'name': 'stop', 'planner_run': {'av': 'av0', 'run': False},
                 'when': {'time': 1.0}},
        {'name': 'go', 'planner_run': {'av': 'av0', 'run': True}}))
    run.drive(99)
    asked = run.simulation.avs[0].counters.requests
    states = run.drive(381)
    assert run.simulation.avs[0].counters.requests == asked == 10
    assert run.result.requests == {}
    assert states[-1].speed == pytest.approx(12.5)
    run.drive(100)
    assert run.simulation.avs[0].uses_no_plan
    assert run.simulation.avs[0].state.speed < 11.0
    run.simulation.trigger('go')
    run.drive(20)
    assert not run.simulation.avs[0].uses_no_plan


def test_a_game_without_events_pays_nothing(street: LoadedScenario) -> None:
    """Its objects are the scenario's own arrays, at every tick."""
    run = HandDriven(setup_of(street))
    run.drive(10)
    assert run.simulation.fired == ()
    assert np.shares_memory(run.result.objects.poses, run.simulation.setup.obstacles.poses)


@pytest.mark.parametrize(('entry', 'message'), [
    ({'name': 'a', 'release': {'object': 7}},
     'event a: there is no moving obstacle "o7"; there is o200, o201'),
    ({'name': 'a', 'brake': {'object': 100}}, 'no moving obstacle "o100"'),
    ({'name': 'a', 'speed_limit': {'speed': 5, 'lanelets': [11, 77]}},
     'no lanelet "77"; there is 11, 12, 21, 22, 31'),
    ({'name': 'a', 'plan_display': {'av': 'av1', 'show': True}}, 'no AV "av1"; there is av0'),
    ({'name': 'a', 'planner_run': {'av': 'hv0', 'run': True}}, 'no AV "hv0"'),
    ({'name': 'a', 'planner': {'av': 'av0', 'planner': 'external'}},
     'cannot bring in an external planner'),
    (RELEASE | {'when': {'vehicle': 'hv3', 'x': 0, 'y': 0, 'radius': 1}},
     'no vehicle or object "hv3"; there is hv0, av0, o200, o201'),
    (RELEASE | {'when': {'between': ['hv0', 'o5'], 'distance': 1}}, '"o5"'),
], ids=range(8))
def test_events_about_unknown_objects_are_refused(street: LoadedScenario, entry: dict[str, Any],
                                                  message: str) -> None:
    """At setup, with a list of the known names."""
    with pytest.raises(InputError, match=message):
        setup_of(street, entry)


def test_refusal_lists_no_more_than_a_dozen() -> None:
    """The message does not list all of a motorway's 30 lanelets and more."""
    game = load_game(scenarios_directory() / 'parked_cars.yaml')
    game = replace(game, events=events_of(
        {'name': 'a', 'plan_display': {'av': 'av0', 'show': True},
         'when': {'between': ['hv0', 'o5'], 'distance': 1}}))
    with pytest.raises(InputError, match=r'there is hv0, av0, o200.* and 7 more$'):
        support.build_setup(game)


def test_external_planner_stays(street: LoadedScenario) -> None:
    """An event cannot replace an external process."""
    with pytest.raises(InputError, match='av0 has an external planner'):
        setup_of(street, {'name': 'a', 'planner': {'av': 'av0', 'planner': 'idm'}},
                 avs=(AvSpec('av0', 'external'),))


def test_documents_round_trip(street: LoadedScenario) -> None:
    """`/scenario/game` carries the events, `/scenario/events` those that have fired."""
    setup = setup_of(street, RELEASE, CONE | {'when': {'time': 1.0}})
    text = GAME.write(describe_game(setup, epoch=3, clock_offset_ns=5))
    assert GAME.read(text).events == setup.game.events
    fired = (FiredEvent('walk', 20, 2, 'trigger'), FiredEvent('cone', 100, 10, 'condition'))
    for events in (FiredEvents(3, fired), FiredEvents(3, ())):
        assert EVENTS.read(EVENTS.write(events)) == events
    newer = EVENTS.write(FiredEvents(3, fired)).replace('trigger', 'telepathy')
    assert EVENTS.read(newer).fired[0].by == 'condition'


@pytest.mark.parametrize('text', ['', '7', '{}', '{"epoch": 1}', '{"epoch": 1, "fired": [7]}',
                                  '{"epoch": "x", "fired": []}'], ids=range(6))
def test_spoilt_list_of_events_is_refused(text: str) -> None:
    """It raises one error that names the topic."""
    with pytest.raises(InputError, match='/scenario/events: is no list of events'):
        EVENTS.read(text)
