# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""`crgame figures`: from a recording to the files that a paper includes."""

from pathlib import Path
from typing import Any
from xml.etree import ElementTree

from crgame_ros.analysis.pictures.scene_frame import followed_plans
from crgame_ros.analysis.runs.run import Run
from crgame_ros.cli import main
from crgame_ros.game.game import Game, load_game
from crgame_ros.messages.joints import vehicle_joint_names, vehicle_to_joints
from crgame_ros.paths import scenarios_directory
from crgame_ros.recording.offline_recording import write_recording
from crgame_ros.recording.recorded_game import recorded_inputs
from crgame_ros.recording.recorded_plans import read_plans
from crgame_ros.recording.run_trajectories import read_trajectories
from crgame_ros.simulation.offline import OfflineResult, run_offline
from crgame_ros.simulation.setup import build_setup
from crgame_ros.vehicle.state import VehicleState
import numpy as np
from PIL import Image
import pytest

pytestmark = pytest.mark.xdist_group('figures')
TRAJECTORY = 'trajectory_msgs/msg/JointTrajectory'
LOG_NS = 1_700_000_000_000_000_000


@pytest.fixture(scope='module')
def result() -> OfflineResult:
    """Run 8 s of the cut-in game."""
    setup = build_setup(load_game(scenarios_directory() / 'cut_in.yaml'))
    drivers, intervals_s = recorded_inputs(setup)
    return run_offline(setup, duration_s=8.0, drivers=drivers, intervals_s=intervals_s)


def _plans(result: OfflineResult, samples: Any, every: int, ahead: int, latency_ns: int
           ) -> list[tuple[str, str, int, bytes]]:
    """Answer every so many steps with the AV's motion then, some time after the request."""
    scheduler = result.setup.scheduler
    states = result.states_of('av0')[::scheduler.steps_per_tick]
    found = []
    for k in range(0, len(states) - ahead, every):
        stamp_ns = k * scheduler.time_step_ns
        header = samples.make('std_msgs/msg/Header', samples.make(
            'builtin_interfaces/msg/Time', *divmod(stamp_ns, 1_000_000_000)), 'map')
        points = []
        for i, state in enumerate(states[k:k + ahead]):
            joints = [np.asarray(row, dtype=np.float64)
                      for row in vehicle_to_joints(VehicleState(*state))]
            since = samples.make('builtin_interfaces/msg/Duration',
                                 *divmod(i * scheduler.time_step_ns, 1_000_000_000))
            points.append(samples.make('trajectory_msgs/msg/JointTrajectoryPoint', *joints,
                                       np.zeros(0), since))
        data = samples.encode(TRAJECTORY, header, list(vehicle_joint_names('av0')), points)
        asked_ns = LOG_NS + stamp_ns + 1_000_000
        found += [('/av0/plan_request', TRAJECTORY, asked_ns, data),
                  ('/av0/plan', TRAJECTORY, asked_ns + latency_ns, data)]
    return found


@pytest.fixture(scope='module')
def run(result: OfflineResult, recorder: Any, samples: Any,
        tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Record it with plans of 2 s each half second, answered after 30 ms."""
    folder = tmp_path_factory.mktemp('figures') / 'run'
    messages = recorder.messages(result, log_ns=LOG_NS)
    messages += _plans(result, samples, 5, 21, 30_000_000)
    recorder.ours(folder / 'bag', sorted(messages, key=lambda each: each[2]))
    return folder


@pytest.mark.slow
def test_everything_of_a_run_is_drawn(run: Path, tmp_path: Path,
                                      capsys: pytest.CaptureFixture[str]) -> None:
    """Frames, profiles, timing and table are whole files, named by content; repeats are equal."""
    for folder in ('a', 'b'):
        assert main(['figures', str(run), '--out', str(tmp_path / folder), '--format', 'svg,pdf',
                     '--panels', '2', '--moments', '1']) == 0
    written = {path.name: path.read_bytes() for path in (tmp_path / 'a').iterdir()}
    assert set(written) == {
        'frames_1.svg', 'frames_1.pdf', 'profiles.svg', 'profiles.pdf', 'timing.svg',
        'timing.pdf', 'timing.txt', 'timing.csv', 'timing.md', 'timing.tex'}
    for name, content in written.items():
        assert (tmp_path / 'b' / name).read_bytes() == content, name
        if name.endswith('.svg'):
            assert ElementTree.fromstring(content).get('width') == '515.52pt'
        if name.endswith('.pdf'):
            assert content.startswith(b'%PDF')
    told = capsys.readouterr().out
    assert str(tmp_path / 'a' / 'frames_1.svg') in told and 'run around' in told
    # Without a named folder the files lie beside the recording.
    assert main(['figures', str(run / 'bag'), '--figures', 'table']) == 0
    assert (run / 'figures' / 'timing.tex').is_file()


def test_two_runs_are_compared(run: Path, result: OfflineResult, recorder: Any, tmp_path: Path,
                               capsys: pytest.CaptureFixture[str]) -> None:
    """They have their labels; the second lags by 1 ms more at each of its 800 cycles."""
    slow = tmp_path / 'slow'
    intervals_s = np.full(800, result.setup.scheduler.dt_s + 0.001)
    recorder.ours(slow / 'bag', recorder.messages(result, intervals_s=intervals_s))
    out = tmp_path / 'out'
    assert main(['figures', str(run), str(slow), '--label', 'Proposed', '--label', 'Naive',
                 '--figures', 'timing,table', '--out', str(out), '--columns', '1']) == 0
    head, _, *rows = (out / 'timing.csv').read_text().splitlines()[:4]
    assert head == 'metric,unit,Proposed,Naive'
    name, unit, ours, naive = rows[0].split(',')
    assert (name, unit) == ('Average Step Error', 'ms')
    assert float(ours) == pytest.approx(0.0, abs=1e-6)
    assert float(naive) == pytest.approx(1.0, rel=1e-6)
    assert (out / 'timing.svg').is_file() and 'Naive' in capsys.readouterr().out


def test_plans_are_drawn_as_recorded(run: Path, result: OfflineResult) -> None:
    """They hold 30 ms after the request; the first, for which the run waits, from the start."""
    log = read_trajectories(run / 'bag')
    (plans,) = followed_plans(log.game, read_plans(run / 'bag')).values()
    assert [plan.stamp_s for plan in plans] == pytest.approx(0.5 * np.arange(len(plans)))
    assert [plan.start_s for plan in plans] == pytest.approx(
        [0.0, *(0.5 * np.arange(1, len(plans)) + 0.03)])
    # The AV followed its plans: its path lies on each of them.
    scene = Run.of_recording(run).scene
    window = scene.windows([20])[0]
    (plan,) = scene.at(22, window).plans
    ticks = result.states_of('av0')[::result.setup.scheduler.steps_per_tick]
    np.testing.assert_allclose(plan.points, window.to_window(ticks[22:41, :2]), atol=1e-9)


def test_frames_at_given_times(run: Path, tmp_path: Path) -> None:
    """One figure of the times that are named."""
    assert main(['figures', str(run), '--figures', 'frames', '--at', '2:3:0.5', '--out',
                 str(tmp_path), '--format', 'png']) == 0
    assert [path.name for path in tmp_path.iterdir()] == ['frames.png']


def test_a_run_becomes_a_film(result: OfflineResult, recorder: Any, tmp_path: Path) -> None:
    """The film has its first second; nothing else is made, unless figures are asked for."""
    messages = [each for each in recorder.messages(result, log_ns=LOG_NS)
                if each[2] <= LOG_NS + 1_005_000_000]
    recorder.ours(tmp_path / 'run' / 'bag', messages)
    film = tmp_path / 'films' / 'run.gif'
    assert main(['figures', str(tmp_path / 'run'), '--video', str(film)]) == 0
    assert [path.name for path in film.parent.iterdir()] == ['run.gif']
    with Image.open(film) as pictures:
        assert pictures.n_frames == 11
    assert not (tmp_path / 'run' / 'figures').exists()


def test_a_run_that_nobody_drove_is_told(tmp_path: Path,
                                         capsys: pytest.CaptureFixture[str]) -> None:
    """A scenario without a planning problem."""
    tree = ElementTree.parse(scenarios_directory() / 'ZAM_Crossing-1_1_T-1.xml')
    for problem in tree.findall('planningProblem'):
        tree.getroot().remove(problem)
    tree.write(tmp_path / 'alone.xml')
    setup = build_setup(Game(tmp_path / 'alone.xml', humans=()))
    assert not setup.vehicle_ids
    write_recording(run_offline(setup, duration_s=0.5, keep_messages=True), tmp_path / 'run')
    assert main(['figures', str(tmp_path / 'run'), '--figures', 'frames']) == 2
    assert 'has no driven vehicle to draw' in capsys.readouterr().err


@pytest.mark.slow
@pytest.mark.parametrize('words', [
    ('missing',), ('RUN', '--figures', 'frames,maps'), ('RUN', '--format', 'bmp'),
    ('RUN', '--at', '1,x'), ('RUN', '--at', '1:2:0'), ('RUN', '--at', '99', '--figures', 'frames'),
    ('RUN', '--at', 'nan'), ('RUN', '--panels', '0'), ('RUN', '--spacing', 'inf'),
    ('RUN', '--label', 'a', '--label', 'b'), ('RUN', '--video', 'run.avi'),
    ('RUN', 'RUN', '--video', 'run.gif'), ('RUN', '--out', 'RUN/bag/metadata.yaml'),
    ('RUN', '--epoch', '7')])
def test_what_cannot_be_drawn_is_told_in_a_line(
        words: tuple[str, ...], run: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """No recording, unknown figures, formats and times, too many or too few of something."""
    assert main(['figures', *(word.replace('RUN', str(run)) for word in words)]) == 2
    error = capsys.readouterr().err
    assert error.startswith('error: ') and error.count('\n') == 1


def test_a_recording_without_cycles_has_no_timing(
        result: OfflineResult, recorder: Any, tmp_path: Path,
        capsys: pytest.CaptureFixture[str]) -> None:
    """Everything else is drawn with a note; asked for alone it is an error."""
    bag = recorder.ours(tmp_path / 'bag', [
        each for each in recorder.messages(result) if each[0] != '/timing/cycle'])
    words = ['figures', str(bag), '--out', str(tmp_path / 'out')]
    assert main([*words, '--panels', '1', '--moments', '1']) == 0
    assert 'note: no timing' in capsys.readouterr().err
    names = {path.name for path in (tmp_path / 'out').iterdir()}
    assert names == {'frames_1.svg', 'profiles.svg'}
    assert main([*words, '--figures', 'timing']) == 2
    assert 'no /timing/cycle' in capsys.readouterr().err
