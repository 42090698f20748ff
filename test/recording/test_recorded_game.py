# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A recording is run again by itself; with a game it must belong to it."""

from collections.abc import Callable
from dataclasses import replace
import json
from pathlib import Path
from typing import Any

from crgame_ros.cli import main
from crgame_ros.driver.source import ReplayDriver
from crgame_ros.errors import InputError
from crgame_ros.game.documents import GAME
from crgame_ros.game.game import AvSpec, Game, HumanSpec, load_game, ModelSpec, PoseSpawn
from crgame_ros.launcher.arguments import RunRequest
from crgame_ros.launcher.run_plan import effective_setup, plan_run
from crgame_ros.paths import scenarios_directory
from crgame_ros.recording.conversion import day_of
from crgame_ros.recording.recorded_game import (
    read_game_document,
    read_recorded_game,
    recorded_inputs,
)
from crgame_ros.simulation.offline import OfflineResult, run_offline
from crgame_ros.simulation.setup import build_setup
import numpy as np
import pytest

CUT_IN_XML = scenarios_directory() / 'ZAM_CutIn-1_1_T-1.xml'
STEPS = 150


@pytest.fixture
def record(tmp_path: Path, recorder: Any) -> Callable[[Game], tuple[Path, OfflineResult]]:
    """Return a function that drives a game with uneven steps, and records it."""
    def run(game: Game) -> tuple[Path, OfflineResult]:
        rng = np.random.default_rng(7)
        commands = rng.uniform((0, 0, -0.1, 0), (0.6, 0.1, 0.1, 0), (STEPS, 4))
        intervals = rng.uniform(0.004, 0.02, STEPS)
        setup = build_setup(game)
        result = run_offline(setup, duration_s=STEPS * setup.scheduler.dt_s,
                             intervals_s=intervals, check_drivability=False,
                             drivers={human.id: ReplayDriver(commands[index:])
                                      for index, human in enumerate(setup.humans)})
        return recorder.ours(tmp_path / 'bag', recorder.messages(
            result, intervals_s=intervals)), result
    return run


def _offline(bag: Path, capsys: pytest.CaptureFixture[str], *words: str) -> dict[str, Any]:
    assert main(['offline', '--driver', f'replay:{bag}', *words]) == 0
    found: dict[str, Any] = json.loads(capsys.readouterr().out)
    return found


@pytest.mark.slow
@pytest.mark.matrix
@pytest.mark.parametrize('name', ['USA_Lanker-1_3_T-1', 'more/HRV_Pula-27_3_T-1'])
def test_replay_alone_is_the_recorded_run(
        name: str, shared_scenarios: Path, record: Any, tmp_path: Path,
        monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    """
    The recording alone reproduces every state, wherever its files are by then.

    The human was placed automatically: its start is in the recording, too.
    """
    copy = tmp_path / 'copy.xml'
    copy.write_bytes((shared_scenarios / f'{name}.xml').read_bytes())
    bag, original = record(Game(copy, humans=(HumanSpec('hv0', 'idle'),), duration=1.5))
    copy.unlink()
    monkeypatch.chdir(tmp_path)
    report = _offline(Path('bag'), capsys)
    assert report['state_hash'] == original.state_hash
    assert report['scenario'] == original.setup.loaded.benchmark_id
    # Another planner meets the same human.
    setup = effective_setup(RunRequest(driver=f'replay:{bag}', planners=('constant-velocity',)))
    drivers, intervals_s = recorded_inputs(setup)
    other = run_offline(setup, drivers=drivers, intervals_s=intervals_s)
    assert np.array_equal(other.states_of('hv0'), original.states_of('hv0'))
    assert {av.spec.planner for av in setup.avs} == {'constant-velocity'}


def test_all_in_the_recording_drive_again(record: Any,
                                          capsys: pytest.CaptureFixture[str]) -> None:
    """Two humans, one on the dynamic bicycle, and an AV with options, seed and perception."""
    game = replace(load_game(scenarios_directory() / 'occluded_pedestrian.yaml'), duration=1.5)
    first = game.humans[0]
    second = replace(first, id='hv1', spawn=PoseSpawn(-60.0, 0.0, 0.0, 5.0),
                     dynamics=ModelSpec('dynamic-bicycle'))
    bag, original = record(replace(game, humans=(first, second)))
    assert _offline(bag, capsys)['state_hash'] == original.state_hash
    again = read_recorded_game(bag).game
    assert [human.driver for human in again.humans] == [f'replay:{bag}'] * 2
    assert (again.seed, again.avs, again.title) == (game.seed, original.setup.game.avs, game.title)


def test_options_beside_a_recording(record: Any) -> None:
    """They hold as with any game: other drivers by name, and no problems where AVs are named."""
    bag, _ = record(Game(CUT_IN_XML, humans=(HumanSpec('hv0', 'idle'),), avs=(AvSpec('av0'),),
                         duration=1.5))
    request = RunRequest(driver=f'replay:{bag}', drivers=(('hv0', 'idle'),))
    assert [human.driver for human in effective_setup(request).game.humans] == ['idle']
    for changed, reason in (({'problems': (1,)}, '--problem: the game names its AVs'),
                            ({'drivers': (('hv7', 'idle'),)}, 'the game has no hv7')):
        with pytest.raises(InputError, match=reason):
            effective_setup(replace(request, **changed))


def test_the_run_may_be_in_a_later_part(record: Any, tmp_path: Path) -> None:
    """A recorder that was killed at once, and the one that was started again."""
    bag, original = record(Game(CUT_IN_XML, humans=(HumanSpec('hv0', 'idle'),), duration=1.5))
    begun = day_of(bag)
    bag.rename(tmp_path / 'bag_part2')
    bag.mkdir()
    (bag / 'bag_0.mcap').touch()
    assert read_game_document(bag).benchmark_id == original.setup.loaded.benchmark_id
    assert read_recorded_game(bag).loaded.sha256 == original.setup.loaded.sha256
    assert day_of(bag) == begun


def test_live_run_gets_the_scenario_as_a_file(record: Any, tmp_path: Path) -> None:
    """In its folder, in the recorded text, whatever encoding that declares."""
    text = CUT_IN_XML.read_text(encoding='utf-8')
    declared = "<?xml version='1.0' encoding='ISO-8859-1'?>\n<!-- Stra\u00dfe -->\n"
    path = tmp_path / 'latin.xml'
    path.write_bytes((declared + text[text.index('?>') + 2:]).encode('iso-8859-1'))
    bag, original = record(Game(path, humans=(HumanSpec('hv0', 'idle'),), duration=1.5))
    plan = plan_run(RunRequest(driver=f'replay:{bag}', headless=True, out=tmp_path / 'run'))
    written = load_game(plan.game_file)
    assert written.scenario == tmp_path / 'run' / 'scenario.xml'
    setup = build_setup(written)
    assert setup.loaded.sha256 == original.setup.loaded.sha256
    assert [human.state for human in setup.humans] == [
        human.state for human in original.setup.humans]
    assert f'note: {bag}: this is the game of the recording' in [
        f'note: {notice}' for notice in plan.setup.notices]


def test_recording_of_another_scenario_or_rate_is_refused(
        record: Any, shared_scenarios: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Its commands would not fit: one line, exit code 2, and the remedy."""
    bag, _ = record(Game(shared_scenarios / 'ZAM_Over-1_1.xml',
                         humans=(HumanSpec('hv0', 'idle'),), duration=1.5))
    cut_in = str(scenarios_directory() / 'cut_in.yaml')
    for words, expected in (
            ([cut_in], f'{bag}: was recorded in another scenario (ZAM_Over-1_1) than '),
            (['--scenario', str(CUT_IN_XML)],
             'leave the game out and give --driver replay:BAG: it carries its own')
    ):
        assert main(['offline', *words, '--driver', f'replay:{bag}']) == 2
        said = capsys.readouterr().err
        assert expected in said and said.count('\n') == 1
    for request in (RunRequest(driver=f'replay:{bag}', rate_hz=200.0),
                    RunRequest(scenario=shared_scenarios / 'ZAM_Over-1_1.xml', rate_hz=200.0,
                               driver=f'replay:{bag}')):
        with pytest.raises(InputError, match='was recorded at 100 Hz, not 200 Hz; .*--rate 100'):
            recorded_inputs(effective_setup(request))


def test_other_start_is_told(record: Any) -> None:
    """With the human elsewhere or in another car a game does not repeat the path."""
    bag, original = record(Game(CUT_IN_XML, humans=(HumanSpec('hv0', 'idle'),), duration=1.5))
    state = original.setup.humans[0].state
    same, moved = (PoseSpawn(state.x + dx, state.y, state.yaw, state.speed) for dx in (0.0, 1.0))
    bicycle = ModelSpec('dynamic-bicycle')
    for spawn, dynamics, expected in (
            (same, None, ''), (moved, None, 'another start than'),
            (moved, bicycle, 'another start and vehicle model than')):
        human = HumanSpec('hv0', f'replay:{bag}', spawn=spawn, dynamics=dynamics)
        path = bag.parent / 'game.yaml'
        path.write_text(replace(original.setup.game, humans=(human,)).dump())
        notices = effective_setup(RunRequest(path)).notices
        assert [expected in notice for notice in notices if 'hv0' in notice] == (
            [True] if expected else []), notices


def test_code_is_not_taken_from_a_recording(record: Any, tmp_path: Path) -> None:
    """A user's own planner has to be named again; the message says how."""
    planner = tmp_path / 'mine.py'
    planner.write_text('from crgame_ros.planner.constant_velocity import '
                       'ConstantVelocityPlanner as Mine\n')
    bag, original = record(Game(CUT_IN_XML, humans=(HumanSpec('hv0', 'idle'),), duration=1.5,
                                avs=(AvSpec('av0', f'{planner}:Mine'),)))
    with pytest.raises(InputError, match=r'names code outside this package \(.*mine.py:Mine\); '
                                         'name the planners with --planner'):
        effective_setup(RunRequest(driver=f'replay:{bag}'))
    setup = effective_setup(RunRequest(driver=f'replay:{bag}', planners=(f'{planner}:Mine',)))
    drivers, intervals_s = recorded_inputs(setup)
    again = run_offline(setup, drivers=drivers, intervals_s=intervals_s)
    assert again.state_hash == original.state_hash


def test_recording_without_its_game_file_is_refused(tmp_path: Path, recorder: Any,
                                                    drive: Any, samples: Any) -> None:
    """For a recording of an earlier version or another program a game must be named."""
    messages = []
    for topic, kind, log_ns, data in recorder.messages(drive('ZAM_CutIn-1_1_T-1.xml')):
        if topic == GAME.topic:
            text = samples.store.deserialize_cdr(data, kind).data
            data = samples.string(json.dumps(
                {key: value for key, value in json.loads(text).items() if key != 'file'}))
        messages.append((topic, kind, log_ns, data))
    bag = recorder.ours(tmp_path / 'bag', messages)
    with pytest.raises(InputError, match='does not hold the game file; name the game'):
        read_recorded_game(bag)
