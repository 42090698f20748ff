# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Whole offline runs with events: the AV reacts, planners change, and runs repeat exactly."""

from dataclasses import replace
import json
from typing import Any

from crgame_ros.cli import main
from crgame_ros.errors import InputError
from crgame_ros.game.events import AtStep, AtTime, EventList, FiredEvent
from crgame_ros.game.game import Game, load_game
from crgame_ros.paths import scenarios_directory
from crgame_ros.recording.recorded_game import with_recorded_events
from crgame_ros.schema.reading import read
from crgame_ros.simulation.offline import OfflineResult, run_offline
from crgame_ros.simulation.setup import build_setup
from crgame_ros.vehicle.state import StateColumn
import numpy as np
import pytest

CROSSING = scenarios_directory() / 'crossing.yaml'
# The human has passed the crossing then, and the AV is about 15 m in front of it.
RELEASE_N = 900
CROSSING_X = 170.0


@pytest.fixture(scope='module')
def game() -> Game:
    """Load the game of the crossing."""
    return load_game(CROSSING)


def play(game: Game, *triggers: tuple[int, str], **options: Any) -> OfflineResult:
    """Run a game offline."""
    return run_offline(build_setup(game), triggers=triggers, **options)


def speeds(result: OfflineResult) -> np.ndarray[Any, np.dtype[np.float64]]:
    """Return the AV's speed at every step."""
    return result.states_of('av0')[:, StateColumn.SPEED]


@pytest.mark.exhaustive
def test_av_stops_for_the_pedestrian_that_is_released(game: Game) -> None:
    """Without the trigger it drives past; with it, it halts in front of the walker."""
    passed, stopped = play(game), play(game, (RELEASE_N, 'pedestrian'))
    assert passed.fired == ()
    assert passed.states_of('av0')[1400, StateColumn.X] > CROSSING_X
    assert speeds(passed).min() > 8.0
    assert stopped.fired == (FiredEvent('pedestrian', RELEASE_N, RELEASE_N // 10, 'trigger'),)
    assert speeds(stopped).min() == 0.0
    halt = int(np.argmin(speeds(stopped)))
    front = stopped.states_of('av0')[halt, StateColumn.X] + 1.4227 + 0.5 * 4.508
    assert CROSSING_X - 10.0 < front < CROSSING_X
    # When the walker is through, it drives on, over the crossing.
    assert stopped.states_of('av0')[-1, StateColumn.X] > CROSSING_X
    for result in (passed, stopped):
        assert [item for item in result.violations if not item.is_valid] == []
        assert result.planners['av0'].counters.refused == 0


@pytest.mark.slow
def test_runs_with_triggers_repeat_to_the_last_bit(game: Game) -> None:
    """The setup is shared and no event changes it; a trigger one tick later gives another run."""
    setup = build_setup(game)
    triggers = [(200, 'slow-zone'), (405, 'careful-planner'), (RELEASE_N, 'pedestrian')]
    first, plain, again = (run_offline(setup, triggers=used, duration_s=12.0)
                           for used in (triggers, (), triggers))
    assert first.state_hash == again.state_hash != plain.state_hash
    assert [(event.name, event.n) for event in first.fired] == [
        ('slow-zone', 200), ('careful-planner', 410), ('pedestrian', RELEASE_N)]
    assert first.object_poses.tobytes() == again.object_poses.tobytes()
    assert play(game, duration_s=12.0).state_hash == plain.state_hash
    later = play(game, (RELEASE_N + 1, 'pedestrian'), duration_s=12.0)
    assert later.fired[0].n == RELEASE_N + 10


@pytest.mark.slow
def test_recorded_events_repeat_a_run_as_conditions(game: Game) -> None:
    """The same bits without triggers; no other event fires by itself."""
    clock = read(EventList, [{'name': 'clock', 'when': {'time': 3.0},
                              'plan_display': {'av': 'av0', 'show': False}}], '')
    game = replace(game, events=(*game.events, *clock))
    original = play(game, (700, 'leader-brakes'), (RELEASE_N, 'pedestrian'), duration_s=12.0)
    repeated = with_recorded_events(game, original.fired)
    assert {event.name: event.when for event in repeated.events if event.when is not None} == {
        'pedestrian': AtStep(90), 'leader-brakes': AtStep(70), 'clock': AtStep(30)}
    again = play(repeated, duration_s=12.0)
    assert again.state_hash == original.state_hash
    assert [event.k for event in again.fired] == [event.k for event in original.fired]
    assert {event.by for event in again.fired} == {'condition'}
    # Events that did not fire in the recording wait for a trigger; events it lacks stay.
    silent = with_recorded_events(game, (), {'pedestrian'})
    assert silent.events[-1].when == AtTime(3.0)
    assert with_recorded_events(game, ()).events[-1].when is None


def test_speed_limit_reaches_the_planner(game: Game) -> None:
    """30 km/h everywhere: the AV slows down to it and keeps it."""
    result = play(replace(game, humans=()), (100, 'slow-zone'))
    assert speeds(result)[90] > 12.5
    assert speeds(result)[600:].max() < 30.0 / 3.6 + 0.1
    assert speeds(result)[600:].min() > 30.0 / 3.6 - 0.5


@pytest.mark.exhaustive
def test_speed_limit_of_one_lanelet(game: Game) -> None:
    """Only behind the crossing (lanelet 21, x > 170 m); in front of it 50 km/h hold."""
    entry = {'name': 'zone', 'speed_limit': {'speed': 5.0, 'lanelets': [21]},
             'when': {'time': 0.0}}
    game = replace(game, humans=(), events=read(EventList, [entry], ''))
    states = play(game).states_of('av0')
    ahead = states[:, StateColumn.X] < 120.0
    assert states[ahead, StateColumn.SPEED].max() > 12.5
    inside = states[:, StateColumn.X] > 172.0
    assert inside.any()
    assert states[inside, StateColumn.SPEED].max() < 5.2


@pytest.mark.matrix('reactive')
@pytest.mark.slow
@pytest.mark.parametrize('planner', ['constant-velocity', 'reactive', 'idm-package'])
def test_planner_is_replaced_in_the_run(game: Game, planner: str) -> None:
    """
    The new planner answers from its tick on, without a refused plan or a fallback.

    The pedestrian shows the difference: only constant velocity does not react.
    """
    swap = read(EventList, [{'name': 'swap', 'planner': {'av': 'av0', 'planner': planner}}], '')
    game = replace(game, humans=(), events=(*game.events, *swap))
    result = play(game, (300, 'swap'), (600, 'pedestrian'), duration_s=9.5)
    record = result.planners['av0']
    assert record.counters.refused == 0
    assert record.accepted_ratio == 1.0, record.statistics.reasons
    # Both planners' answers count: one at each tick but the last.
    assert record.statistics.plans == 95
    careless = bool(np.ptp(speeds(result)[310:]) < 0.1)
    assert careless == (planner == 'constant-velocity')


@pytest.mark.exhaustive
def test_hidden_plan_changes_no_motion(game: Game) -> None:
    """The cockpit hides the plan; the run only records the event."""
    hidden = play(game, (100, 'hide-plan'), duration_s=3.0)
    assert [event.name for event in hidden.fired] == ['hide-plan']
    assert hidden.state_hash == play(game, duration_s=3.0).state_hash


def test_refused_trigger_ends_the_run(game: Game) -> None:
    """A script that names a wrong event must not count as one that fired it."""
    with pytest.raises(InputError, match='trigger at step 50: there is no event "fly"'):
        play(game, (50, 'fly'), duration_s=2.0)


def test_command_shows_and_takes_events(capsys: pytest.CaptureFixture[str]) -> None:
    """`crgame offline --trigger NAME@S`; a malformed one is bad input."""
    assert main(['offline', str(CROSSING), '--duration', '2', '--trigger', 'hide-plan@0.5',
                 '--trigger', 'roadworks@1.01']) == 0
    assert json.loads(capsys.readouterr().out)['events'] == [
        {'name': 'hide-plan', 'n': 50, 'k': 5, 'by': 'trigger'},
        {'name': 'roadworks', 'n': 110, 'k': 11, 'by': 'trigger'}]
    for text, told in (('hide-plan', 'give NAME@SECONDS'), ('hide-plan@', 'give NAME@SECONDS'),
                       ('hide-plan@soon', 'give NAME@SECONDS'), ('@1', 'no event ""'),
                       ('hide-plan@-1', 'hide-plan: is -1.0 s'), ('fly@1', 'no event "fly"')):
        assert main(['offline', str(CROSSING), '--trigger', text]) == 2
        assert told in capsys.readouterr().err
