# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Data sets become scenarios: their vehicles are where the data have them, and one can drive."""

import math
import os
from pathlib import Path
import shutil
import signal
import subprocess
import sys

from command_line import crgame
from crgame_ros.errors import CrgameError, InputError
from crgame_ros.game.game import AvSpec, Game
from crgame_ros.geometry.angles import wrap_pi_array
from crgame_ros.scenario.export_network import schema_errors
from crgame_ros.scenario.loading import load_scenario, LoadedScenario
from crgame_ros.scenario.obstacles import ScenarioObstacles
from crgame_ros.simulation.offline import run_offline
from crgame_ros.simulation.setup import build_setup
from crgame_ros.worlds.data_sets import convert_data, DataSetImport
from crgame_ros.worlds.environments import DATA_SET_CONVERTER
from crgame_ros.worlds.kinds import find_kind
from crgame_ros.worlds.recordings import find_recordings
from lxml import etree
import numpy as np
import pytest
from recorded_data import FORMATS, FRAMES, Track, write

# The second window of a recording has 20 frames.
STEPS = 40
WINDOWS = math.ceil(FRAMES / STEPS)
# What the converter takes for the size of those who have no box [m].
FIXED = {'pedestrian': (0.7, 0.7), 'bicycle': (1.8, 0.6), 'motorcycle': (2.5, 0.8)}


@pytest.fixture(scope='session')
def maps() -> Path:
    """Return the converter's maps; its environment is made once, or the test is skipped."""
    try:
        python = DATA_SET_CONVERTER.program('python', print)
    except CrgameError as error:
        pytest.skip(f'the converter of data sets is not installed: {error}')
    return next(python.parents[1].glob('lib/python*/site-packages/crdata/datasets'))


@pytest.fixture
def recording(tmp_path: Path) -> Path:
    """Return a recording of highD, for which no map is needed."""
    return write('highd', tmp_path, tmp_path)


def convert(source: Path, out: Path, **words: object) -> list[Path]:
    """Convert a data set whose format is found."""
    order = DataSetImport(source, find_kind(source), out, **{'limit': 9, 'steps': STEPS} | words)
    return list(convert_data(order, lambda line: None))


@pytest.mark.matrix('interaction', 'mona')
@pytest.mark.parametrize('name', FORMATS)
def test_vehicles_are_where_the_data_have_them(name: str, maps: Path, tmp_path: Path) -> None:
    """Each is at its place to 1 cm, with its time, speed, type and size; and one can drive."""
    source = write(name, tmp_path, maps)
    tracks = FORMATS[name].read(source)
    if name == 'mona':
        to_parquet(next(source.rglob('*.csv')))
    # One level higher than the files of the archive.
    scenarios = convert(source.parent, tmp_path / 'out')
    late = 0
    for path in scenarios:
        loaded = load_scenario(path)
        assert loaded.time_step_s == FORMATS[name].step_s
        window = int(loaded.benchmark_id.split('_')[2]) % 10_000 - 1
        compare(loaded, tracks, window % WINDOWS * STEPS, name)
        assert len(loaded.planning_problems) == 1
        late += check_schema(path)
    assert late
    drive(load_scenario(scenarios[0]))


def to_parquet(table: Path) -> None:
    """Replace a table by one in MONA's format, as only the converter's environment can."""
    subprocess.run([DATA_SET_CONVERTER.program('python', print), '-c',
                    'import pandas, sys; pandas.read_csv(sys.argv[1]).to_parquet(sys.argv[2])',
                    table, table.with_suffix('.parquet')], check=True, env={})
    table.unlink()


def compare(loaded: LoadedScenario, tracks: list[Track], begin: int, name: str) -> None:
    """Compare the obstacles, and the car whose place the AV takes, with the tracks."""
    problem = loaded.planning_problems[0].initial_state
    obstacles = list(loaded.scenario.dynamic_obstacles)
    egos = 0
    begin += min(int(track.frames[0]) for track in tracks)
    for track in tracks:
        rows = (track.frames >= begin) & (track.frames < begin + STEPS)
        # highD has a scenario for each carriageway.
        aside = name == 'highd' and np.cos(track.poses[0, 2] - problem.orientation) < 0.0
        if rows.sum() < 2 or aside:
            continue
        steps, poses = track.frames[rows] - begin, track.poses[rows]
        found = [each for each in obstacles if each.initial_state.time_step == steps[0]
                 and np.hypot(*(each.initial_state.position - poses[0, :2])) < 0.01]
        if not found:
            assert np.hypot(*(problem.position - poses[0, :2])) < 0.01
            assert problem.velocity == pytest.approx(track.speeds[rows][0], abs=0.01)
            egos += 1
            continue
        obstacle, = found
        obstacles.remove(obstacle)
        states = [obstacle.initial_state, *obstacle.prediction.trajectory.state_list]
        assert [each.time_step for each in states] == steps.tolist()
        off = np.array([each.position for each in states]) - poses[:, :2]
        assert np.hypot(*off.T).max() < 0.01
        turned = np.array([each.orientation for each in states]) - poses[:, 2]
        assert np.abs(wrap_pi_array(turned)).max() < 1e-3
        assert [each.velocity for each in states] == pytest.approx(track.speeds[rows], abs=0.01)
        kind = FORMATS[name].kinds[track.kind]
        assert obstacle.obstacle_type.value == kind
        shape = obstacle.obstacle_shape
        size = (2.0 * shape.radius,) * 2 if kind == 'pedestrian' else (shape.length, shape.width)
        assert size == pytest.approx(FIXED.get(kind, (track.length, track.width)), abs=0.01)
    assert egos == 1 and not obstacles


def check_schema(path: Path) -> int:
    """Check a file by the schema, and return how many vehicles appear later, which it forbids."""
    root = etree.fromstring(path.read_bytes())
    late = 0
    for state in ('initialState', 'initialSignalState'):
        for time in root.iterfind(f'dynamicObstacle/{state}/time/exact'):
            late += time.text != '0'
            time.text = '0'
    assert schema_errors(root) == []
    return late


def drive(loaded: LoadedScenario) -> None:
    """Drive among the recorded vehicles for as long as they are there."""
    game = Game(Path(loaded.source), humans=(), avs=(AvSpec(
        'av0', 'idm', planning_problem=loaded.planning_problems[0].planning_problem_id),),
        duration=STEPS * loaded.time_step_s)
    states = run_offline(build_setup(game, loaded)).states_of('av0')
    way = float(np.hypot(*np.diff(states[:, :2], axis=0).T).sum())
    assert way > 0.5 * 8.0 * game.duration


def test_files_are_the_same_again_and_stay(recording: Path, maps: Path, tmp_path: Path) -> None:
    """The same data make the same files; those that are there are replaced by --force only."""
    folders = [tmp_path / name for name in ('folder', 'table')]
    for source, folder in zip((recording, recording / '05_tracks.csv'), folders, strict=True):
        convert(source, folder)
    one, two = ([(path.name, path.read_bytes()) for path in sorted(folder.iterdir())]
                for folder in folders)
    assert one == two and len(one) == 4
    first = folders[0] / 'DEU_LocationAUpper5-1_50001_T-1.xml'
    first.write_text('mine')
    with pytest.raises(InputError, match='is there already; add --force'):
        convert(recording, folders[0])
    assert first.read_text() == 'mine'
    assert convert(recording, folders[0], force=True, limit=1) == [first]
    assert first.read_bytes() == dict(two)[first.name]


@pytest.mark.exhaustive
def test_frames_are_left_out(recording: Path, maps: Path, tmp_path: Path) -> None:
    """With --downsample 2 every other frame of the recording remains."""
    every, other = (load_scenario(convert(recording, tmp_path / str(factor), downsample=factor,
                                          steps=STEPS // factor, limit=1)[0])
                    for factor in (1, 2))
    assert (every.time_step_s, other.time_step_s) == (0.04, 0.08)
    full, half = map(ScenarioObstacles, (every, other))
    assert full.ids == half.ids and len(half.poses) == STEPS // 2
    assert np.nanmax(np.abs(full.poses[::2] - half.poses)) < 1e-6


def test_ctrl_c_leaves_no_half_file(recording: Path, maps: Path, tmp_path: Path,
                                    monkeypatch: pytest.MonkeyPatch) -> None:
    """It ends the converter as well."""
    out = tmp_path / 'out'
    work = tmp_path / 'work'
    work.mkdir()
    monkeypatch.setenv('TMPDIR', str(work))
    # So much that it is far from the end after the first scenario.
    for path in sorted(recording.iterdir()):
        for number in range(10, 30):
            shutil.copy(path, path.with_name(path.name.replace('05', str(number))))
    process = subprocess.Popen(
        [sys.executable, '-m', 'crgame_ros.cli', 'import', recording, '--out', out, '--steps',
         str(STEPS), '--limit', '1000'],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    assert process.stdout is not None and process.stdout.readline().startswith(str(out))
    process.send_signal(signal.SIGINT)
    process.communicate(timeout=60)
    assert process.returncode == 130
    for path in out.iterdir():
        load_scenario(path)
    assert not list(work.iterdir())
    running = [os.readlink(folder) for folder in Path('/proc').glob('[0-9]*/cwd')
               if os.access(folder, os.R_OK)]
    assert not [folder for folder in running if folder.startswith(str(work))]


@pytest.mark.parametrize(('table', 'change', 'words'), [
    ('05_tracks.csv', lambda text: text.replace('xVelocity', 'speed'), 'no column xVelocity'),
    ('05_tracks.csv', lambda text: text[:text.index('\n') + 1], 'recordings are empty'),
    ('05_tracksMeta.csv', lambda text: text.replace('class', 'type'), 'no column class'),
    ('05_recordingMeta.csv', None, 'is missing; 05_tracks.csv is of no use without it'),
])
def test_damaged_recordings_are_refused(recording: Path, table: str, change: object,
                                        words: str) -> None:
    """One line says what is wrong with which file, before the converter is called."""
    path = recording / table
    if callable(change):
        path.write_text(change(path.read_text()))
    else:
        path.unlink()
    code, printed, told = crgame(recording, 'import', recording, '--out', recording / 'out')
    assert code == 2 and words in told and not printed
    assert len([line for line in told.splitlines() if 'error' in line]) == 1
    assert not (recording / 'out').exists()


def test_the_format_follows_from_folders_and_columns(tmp_path: Path, recording: Path) -> None:
    """Whichever folder of an archive is named; two data sets in a folder are refused."""
    levels = [tmp_path, recording.parent, recording, recording / '05_tracks.csv']
    assert [find_kind(place).name for place in levels] == ['highd'] * 4
    interaction = tmp_path / 'other' / 'recorded_trackfiles' / 'DR_USA_Roundabout_FT'
    tumdot = tmp_path / 'muc' / 'Trajectory-Data'
    for place, table in ((interaction, 'vehicle_tracks_000.csv'), (tumdot, 'drone_1.csv')):
        place.mkdir(parents=True)
        (place / table).touch()
        for folder in (place, place.parent):
            assert find_kind(folder).name == ('tumdot' if place is tumdot else 'interaction')
    with pytest.raises(InputError, match='holds INTERACTION and TUMdot and highD'):
        find_kind(tmp_path)
    levelx = tmp_path / 'uniD-dataset' / 'data'
    shutil.copytree(recording, levelx)
    (levelx / '05_tracks.csv').write_text('recordingId,trackId,frame,xCenter,yCenter,xVelocity\n')
    assert find_kind(levelx).name == 'unid'
    with pytest.raises(InputError, match='no folder of that name'):
        find_kind(levelx.rename(tmp_path / 'plain'))


def test_recordings_without_a_map_are_told(tmp_path: Path) -> None:
    """INTERACTION has locations for which the converter has none."""
    place = tmp_path / 'DR_Elsewhere'
    place.mkdir()
    (place / 'vehicle_tracks_000.csv').touch()
    told: list[str] = []
    with pytest.raises(InputError, match='holds no recording of INTERACTION'):
        find_recordings(tmp_path, find_kind(tmp_path), told.append)
    assert told == ['note: the converter has no map of DR_Elsewhere']
