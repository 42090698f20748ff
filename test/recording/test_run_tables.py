# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The tables of runs: from a recording and from the run itself, and their values."""

from collections.abc import Callable
from dataclasses import replace
import json
from pathlib import Path
import shutil
import tracemalloc
from typing import Any, NamedTuple

from crgame_ros.analysis.runs.run import Run
from crgame_ros.analysis.tables import pairs as pairs_table
from crgame_ros.analysis.tables import run_tables
from crgame_ros.analysis.tables import states as states_table
from crgame_ros.analysis.tables import writer as table_writer
from crgame_ros.analysis.tables.column import TableDeclaration
from crgame_ros.analysis.tables.run_tables import TABLES, write_tables
from crgame_ros.analysis.tables.writer import FORMATS
from crgame_ros.cli import main
from crgame_ros.errors import InputError
from crgame_ros.game.events import FiredEvent
from crgame_ros.game.game import load_game
from crgame_ros.messages.joints import plan_to_joints
from crgame_ros.messages.plan import Plan
from crgame_ros.paths import scenarios_directory
from crgame_ros.recording.recorded_game import recorded_inputs
from crgame_ros.recording.recorded_plans import RecordedPlan
from crgame_ros.recording.run_folder import run_name
from crgame_ros.recording.run_record import run_record_of, RunRecord
from crgame_ros.simulation.offline import OfflineResult, run_offline
from crgame_ros.simulation.setup import build_setup
from crgame_ros.vehicle.state import VehicleState
import duckdb
import frictionless
import numpy as np
import pandas
import polars
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import shapely

NAMES = [table.name for table in TABLES]


class Recorded(NamedTuple):
    """A run, and the folder of its recording."""

    result: OfflineResult
    folder: Path


@pytest.fixture(scope='module')
def recorded(recorder: Any, tmp_path_factory: pytest.TempPathFactory) -> Recorded:
    """Record the game in which a pedestrian crosses and the leader brakes at their events."""
    setup = build_setup(load_game(scenarios_directory() / 'crossing.yaml'))
    drivers, intervals_s = recorded_inputs(setup)
    result = run_offline(setup, duration_s=8.0, drivers=drivers, intervals_s=intervals_s,
                         triggers=[(100, 'leader-brakes'), (333, 'pedestrian')])
    folder = tmp_path_factory.mktemp('runs') / 'pedestrian'
    recorder.ours(folder / 'bag', recorder.messages(result))
    return Recorded(result, folder)


@pytest.fixture(scope='module')
def tables(recorded: Recorded) -> dict[str, polars.DataFrame]:
    """Export the recording with the command, and read it without any code of ours."""
    assert main(['export', str(recorded.folder)]) == 0
    return {name: polars.read_parquet(recorded.folder / 'tables' / f'{name}.parquet')
            for name in NAMES}


@pytest.fixture(params=FORMATS)
def exported(request: pytest.FixtureRequest, recorded: Recorded, tmp_path: Path) -> Path:
    """Export the recording in one of the formats."""
    assert main(['export', str(recorded.folder), '--to', request.param,
                 '--out', str(tmp_path)]) == 0
    return tmp_path


@pytest.mark.exhaustive
def test_frictionless_finds_the_package_valid(exported: Path) -> None:
    """Types, missing values, keys and sums, of all tables."""
    report = frictionless.validate(exported / 'datapackage.json')
    assert report.valid, report.to_summary()
    assert [task.name for task in report.tasks] == NAMES


@pytest.mark.exhaustive
@pytest.mark.parametrize('table', [table for table in TABLES
                                   if table.name in ('vehicles', 'pairs', 'states')],
                         ids=lambda table: table.name)
def test_duckdb_and_pandas_read_numbers_as_numbers(exported: Path,
                                                   table: TableDeclaration) -> None:
    """Also where a column begins with infinite or missing values."""
    path = next(exported.glob(f'{table.name}.*'))
    found = duckdb.sql(f"select * from '{path}'")
    frame = pandas.read_csv(path) if path.suffix == '.csv' else pandas.read_parquet(path)
    for column, kind in zip(table.columns, found.types, strict=True):
        values = frame[column.name]
        if values.isna().all():
            continue
        assert (str(kind) == 'VARCHAR') is (column.type == pa.string()), column.name
        # With gaps, flags in CSV are objects.
        assert column.type == pa.bool_() or pandas.api.types.is_numeric_dtype(values) is (
            column.type != pa.string())
        if path.suffix == '.parquet' and column.type == pa.int64():
            assert str(values.dtype) == 'Int64'


@pytest.mark.slow
def test_states_are_the_true_places(recorded: Recorded,
                                    tables: dict[str, polars.DataFrame]) -> None:
    """Centres from rear axles by hand, commands as they were consumed, objects as they moved."""
    result, every = recorded.result, recorded.result.setup.scheduler.steps_per_tick
    states = tables['states'].filter(polars.col('id') == 'hv0')
    own = result.states_of('hv0')[::every]
    assert states['k'].to_list() == list(range(len(own)))
    assert np.allclose(states['time_s'], 0.1 * np.arange(len(own)), rtol=0.0, atol=1e-9)
    to_center = result.setup.humans[0].vehicle.rear_to_center
    for name, values in (('x_rear_axle', own[:, 0]), ('y_rear_axle', own[:, 1]),
                         ('x_center', own[:, 0] + to_center * np.cos(own[:, 2])),
                         ('y_center', own[:, 1] + to_center * np.sin(own[:, 2])),
                         ('yaw', own[:, 2]), ('speed', own[:, 3]),
                         ('vx_center', own[:, 3] * np.cos(own[:, 2])
                          - to_center * own[:, 6] * np.sin(own[:, 2])),
                         ('acceleration_rear_axle', own[:, 5]), ('steering_angle', own[:, 4])):
        assert np.allclose(states[name], values, rtol=0.0, atol=1e-9), name
    consumed = result.commands[every::every, 0]
    for column, name in enumerate(('throttle', 'brake', 'steering')):
        assert states[name][0] is None
        assert np.array_equal(states[name][1:], consumed[:, column]), name
    assert not any(states['reverse'][1:])
    others = tables['states'].filter(~polars.col('role').is_in(['human', 'autonomous']))
    assert others['throttle'].null_count() == others['x_rear_axle'].null_count() == len(others)
    for number, item in enumerate(result.setup.obstacles.descriptions):
        found = others.filter(polars.col('id') == item.id)
        there = result.object_poses.reshape(len(own), -1, 3)[:, number]
        there = there[np.isfinite(there[:, 0])]
        assert np.allclose(found.select('x_center', 'y_center', 'yaw').to_numpy(), there,
                           rtol=0.0, atol=1e-9)
        assert set(found['type']) <= {item.type}


def test_places_in_the_lane_are_on_its_centre_line(
        recorded: Recorded, tables: dict[str, polars.DataFrame]) -> None:
    """The distance to the polyline as shapely has it, and the lanelet as CommonRoad finds it."""
    network = recorded.result.setup.loaded.scenario.lanelet_network
    states = tables['states'].filter(polars.col('lanelet_id').is_not_null())
    assert 0 < len(states) < len(tables['states']) + 1
    for row in states.sample(60, seed=1).iter_rows(named=True):
        place = np.array((row['x_center'], row['y_center']))
        assert row['lanelet_id'] in network.find_lanelet_by_position([place])[0]
        line = shapely.LineString(
            network.find_lanelet_by_id(row['lanelet_id']).center_vertices[:, :2])
        assert abs(row['lane_offset']) == pytest.approx(
            line.distance(shapely.Point(place)), abs=0.02)
        assert row['lane_s'] == pytest.approx(line.project(shapely.Point(place)), abs=0.2)


def test_the_worst_of_a_vehicle_is_in_its_pairs(tables: dict[str, polars.DataFrame]) -> None:
    """It is each measure's extreme of all rows, with place and time; crossings are counted."""
    pairs = tables['pairs']
    for vehicle in tables['vehicles'].iter_rows(named=True):
        mine = pairs.filter(polars.col('subject') == vehicle['id'])
        for name, extreme in (('gap', 'min'), ('ttc', 'min'), ('drac', 'max'), ('a_req', 'min'),
                              ('min_distance', 'min')):
            worst = getattr(mine[name].drop_nulls(), extreme)()
            if vehicle[f'worst_{name}'] is None:
                assert worst in (None, 0.0, np.inf)
                continue
            assert vehicle[f'worst_{name}'] == worst
            row = mine.row(by_predicate=(
                polars.col('time_s') == vehicle[f'worst_{name}_time_s'])
                & (polars.col('other') == vehicle[f'worst_{name}_of']), named=True)
            assert row[name] == worst
        met = tables['crossings'].filter(
            (polars.col('first') == vehicle['id']) | (polars.col('second') == vehicle['id']))
        assert vehicle['crossings'] == len(met)
    keys = pairs.select('run', 'k', 'subject', 'other')
    assert keys.is_unique().all()
    # Every subject is in states at that time, equal to the last bit.
    joined = pairs.join(tables['states'], left_on=['run', 'k', 'time_s', 'subject'],
                        right_on=['run', 'k', 'time_s', 'id'])
    assert len(joined) == len(pairs) > 100


def test_events_and_runs_say_what_was_played(recorded: Recorded,
                                             tables: dict[str, polars.DataFrame]) -> None:
    """They have names, times, the scenario's digest, and the length of the human's path."""
    result = recorded.result
    assert tables['events']['name'].to_list() == [event.name for event in result.fired]
    assert tables['events']['name'].to_list() == ['leader-brakes', 'pedestrian']
    assert tables['events']['kind'].to_list() == ['brake', 'release']
    assert tables['events']['time_s'].to_list() == pytest.approx([1.0, 3.4])
    assert tables['events']['k'].to_list() == [event.k for event in result.fired]
    assert set(tables['events']['by']) <= {'trigger', 'condition'}
    run, = tables['runs'].iter_rows(named=True)
    assert run['run'] == 'pedestrian:0'
    assert run['scenario_sha256'] == result.setup.loaded.sha256
    assert (run['duration_s'], run['time_step_s'], run['dt_s']) == pytest.approx((8.0, 0.1, 0.01))
    assert (run['cycles'], run['gaps'], run['final_error_s']) == (800, 0, 0.0)
    human = tables['vehicles'].row(0, named=True)
    way = np.hypot(*np.diff(result.states_of('hv0')[::10, :2], axis=0).T).sum()
    assert human['distance'] == pytest.approx(way, abs=1e-9)
    assert human['max_speed'] == result.states_of('hv0')[::10, 3].max()


def test_dictionary_and_files_agree(recorded: Recorded,
                                    tables: dict[str, polars.DataFrame]) -> None:
    """Every column by name, order and type; units also in the Parquet files themselves."""
    kinds = {'number': polars.Float64, 'integer': polars.Int64, 'string': polars.String,
             'boolean': polars.Boolean}
    package = json.loads((recorded.folder / 'tables' / 'datapackage.json').read_text())
    assert [resource['name'] for resource in package['resources']] == NAMES
    for resource in package['resources']:
        frame, fields = tables[resource['name']], resource['schema']['fields']
        assert resource['rows'] == len(frame)
        assert dict(frame.schema) == {field['name']: kinds[field['type']] for field in fields}
        assert list(frame.schema) == [field['name'] for field in fields]
        assert frame.select(resource['schema']['primaryKey']).is_unique().all()
        assert not any(frame[name].null_count() for name in resource['schema']['primaryKey'])
        schema = pq.read_schema(recorded.folder / 'tables' / resource['path'])
        for field in fields:
            notes = schema.field(field['name']).metadata
            assert notes[b'description'].decode() == field['description']
            assert notes.get(b'unit', b'').decode() == field.get('unit', '')
            if 'emptyWhere' not in field:
                assert frame[field['name']].null_count() == 0, field
            if 'enum' in (constraints := field.get('constraints', {})):
                assert set(frame[field['name']].drop_nulls()) <= set(constraints['enum'])


@pytest.mark.slow
def test_the_same_recording_gives_the_same_bytes(recorded: Recorded, tmp_path: Path,
                                                 tables: dict[str, polars.DataFrame]) -> None:
    """This holds in both formats; CSV and Parquet agree to the last bit."""
    for file_format in ('parquet', 'csv'):
        for name in ('one', 'two'):
            assert main(['export', str(recorded.folder / 'bag'), '--to', file_format, '--out',
                         str(tmp_path / file_format / name)]) == 0
        for name in NAMES:
            one, two = ((tmp_path / file_format / each / f'{name}.{file_format}').read_bytes()
                        for each in ('one', 'two'))
            assert one == two
    for name in NAMES:
        frame = polars.read_csv(tmp_path / 'csv' / 'one' / f'{name}.csv',
                                schema=tables[name].schema)
        numbers = [column for column, kind in frame.schema.items() if kind == polars.Float64]
        frame = frame.with_columns(polars.col(numbers).fill_nan(None))
        assert frame.equals(tables[name]), name


def test_offline_run_and_recording_have_the_same_tables(
        recorded: Recorded, tmp_path: Path, tables: dict[str, polars.DataFrame]) -> None:
    """All numbers agree up to 1e-9, but for columns that only a recording has."""
    write_tables([named_run('pedestrian:0', run_record_of(recorded.result))], tmp_path,
                 'parquet')
    for name in ('states', 'pairs', 'crossings', 'events', 'vehicles'):
        here, there = polars.read_parquet(tmp_path / f'{name}.parquet'), tables[name]
        assert len(here) == len(there)
        for column in here.columns:
            if here[column].dtype != polars.Float64:
                if name != 'vehicles' or there[column].dtype != polars.Int64:
                    assert here[column].equals(there[column]), column
                continue
            one, two = (frame[column].fill_null(np.nan).to_numpy() for frame in (here, there))
            # Jerks in scores magnify the rounding in messages.
            rounding = 1e-6 if column.startswith('score_') else 1e-9
            assert np.allclose(one, two, rtol=rounding, atol=1e-9, equal_nan=True), column
    assert polars.read_parquet(tmp_path / 'plans.parquet').height == 0


def _plan(result: OfflineResult, tick: int, aside: float, told: VehicleState | None
          ) -> RecordedPlan:
    """Return a plan of av0: its driven path, moved to the left."""
    states = result.states_of('av0')[::10][tick:tick + 21].copy()
    states[:, 0] -= aside * np.sin(states[:, 2])
    states[:, 1] += aside * np.cos(states[:, 2])
    stamp_ns = tick * 100_000_000
    assert plan_to_joints(Plan(stamp_ns, states), 'av0', 100_000_000).names[0] == 'av0/x'
    return RecordedPlan('av0', stamp_ns, tick, 0.01, Plan(stamp_ns, states), '', told)


def test_plans_are_compared_with_what_was_driven(recorded: Recorded, tmp_path: Path) -> None:
    """A plan 0.3 m beside the path deviates by 0.3 m; one that starts too far off is refused."""
    result = recorded.result
    own = [VehicleState(*row) for row in result.states_of('av0')[::10].tolist()]
    last = len(own) - 1
    plans = [_plan(result, 5, 0.3, own[5]), _plan(result, 6, 0.0, own[6]),
             _plan(result, 7, 2.0, own[7]), _plan(result, last - 15, 0.0, None),
             RecordedPlan('av0', 900_000_000, 9, 0.2, None, 'has no points', None)]

    class Planned(Run):
        """A run with these plans."""

        plans = staticmethod(lambda: plans)

    run = Planned('a', record=run_record_of(result))
    write_tables([run], tmp_path, 'parquet')
    table = polars.read_parquet(tmp_path / 'plans.parquet')
    assert table['number'].to_list() == [0, 1, 2, 3, 4]
    assert table['deviation_1s'].to_list() == pytest.approx([0.3, 0.0, 2.0, 0.0, None], abs=1e-9)
    assert table['deviation_end'].to_list()[:3] == pytest.approx([0.3, 0.0, 2.0], abs=1e-9)
    assert table['points'].to_list() == [21, 21, 21, 16, None]
    assert table['passes_check'].to_list()[1:] == [True, False, None, False]
    assert '2.00 m from the vehicle' in table['refusal'][2]
    assert table['refusal'][4] == 'has no points'
    assert table['first_x'][1] == own[6].x
    vehicle = polars.read_parquet(tmp_path / 'vehicles.parquet').row(1, named=True)
    assert vehicle['plans'] == 5
    assert vehicle['latency_max_s'] == 0.2
    assert vehicle['plans_passing'] is None


@pytest.mark.exhaustive
def test_several_runs_in_the_same_tables(recorded: Recorded, tmp_path: Path, drive: Any,
                                         recorder: Any,
                                         capsys: pytest.CaptureFixture[str]) -> None:
    """Ids differ even where folders are named alike; the same run twice is refused."""
    other = tmp_path / 'pedestrian'
    recorder.ours(other / 'bag', recorder.messages(drive('ZAM_CutIn-1_1_T-1.xml')))
    out = tmp_path / 'out'
    assert main(['export', str(recorded.folder), str(other), '--no-scores', '--out',
                 str(out)]) == 0
    assert polars.read_parquet(out / 'runs.parquet')['run'].to_list() == [
        'pedestrian:0', 'pedestrian:0~2']
    states = polars.read_parquet(out / 'states.parquet')
    assert states['run'].unique(maintain_order=True).to_list() == ['pedestrian:0',
                                                                   'pedestrian:0~2']
    assert states.select('run', 'k', 'id').is_unique().all()
    capsys.readouterr()
    before = {path.name: path.read_bytes() for path in out.iterdir()}
    for words, what in (((recorded.folder, recorded.folder / 'bag', '--out', out), 'twice'),
                        ((recorded.folder, other), '--out')):
        assert main(['export', *map(str, words)]) == 2
        # Reports of progress may come before it.
        *_, error = capsys.readouterr().err.splitlines()
        assert error.startswith('error: ')
        assert what in error
    assert {path.name: path.read_bytes() for path in out.iterdir()} == before


def _cut(bag: Path) -> None:
    (bag / 'metadata.yaml').unlink()
    file = bag / 'bag_0.mcap'
    file.write_bytes(file.read_bytes()[:200])


def _overwrite(bag: Path) -> None:
    (bag / 'bag_0.mcap').write_bytes(bytes(range(256)) * 100)


@pytest.mark.parametrize('harm', [_cut, _overwrite, shutil.rmtree])
def test_broken_recordings_give_a_line_and_no_file(
        recorded: Recorded, tmp_path: Path, harm: Callable[[Path], None],
        capsys: pytest.CaptureFixture[str]) -> None:
    """Every fault has exit code 2 and one line, and leaves no half-made file."""
    shutil.copytree(recorded.folder / 'bag', tmp_path / 'run' / 'bag')
    harm(tmp_path / 'run' / 'bag')
    assert main(['export', str(tmp_path / 'run'), '--out', str(tmp_path / 'out')]) == 2
    lines = capsys.readouterr().err.splitlines()
    assert len([line for line in lines if line.startswith('error: ')]) == 1
    assert not (tmp_path / 'out').exists() or not list((tmp_path / 'out').iterdir())


@pytest.mark.parametrize(('n', 'k'), [(10**400, 1), (10, 10**30)])
def test_numbers_beyond_all_bounds_give_a_line(recorded: Recorded, tmp_path: Path, n: int,
                                               k: int) -> None:
    """JSON has no largest number, but a column has."""
    record = replace(run_record_of(recorded.result), fired=(FiredEvent('x', n, k, 'trigger'),))
    with pytest.raises(InputError, match='out of all bounds'):
        write_tables([named_run('a', record)], tmp_path, 'parquet')
    assert list(tmp_path.iterdir()) == []


def test_interruption_leaves_no_half_file(recorded: Recorded, tmp_path: Path,
                                          monkeypatch: pytest.MonkeyPatch) -> None:
    """Ctrl-C while pairs are written."""
    def interrupt(*_: Any) -> None:
        raise KeyboardInterrupt
    monkeypatch.setattr(run_tables, 'write_criticality', interrupt)
    assert main(['export', str(recorded.folder), '--out', str(tmp_path / 'out')]) == 130
    assert list((tmp_path / 'out').iterdir()) == []


def test_runs_are_named_by_their_folders(tmp_path: Path) -> None:
    """The name is the session's folder, whichever part of it is given."""
    for given, name in (('A', 'A'), ('A/bag', 'A'), ('A/bag_2', 'A'), ('A/run_3', 'A'),
                        ('A/run_3/bag', 'A'), ('my_bag', 'my_bag'), ('run_1x', 'run_1x')):
        (tmp_path / given).mkdir(parents=True, exist_ok=True)
        assert run_name(tmp_path / given) == name
    (tmp_path / 'A' / 'trial.mcap').write_bytes(b'')
    assert run_name(tmp_path / 'A' / 'trial.mcap') == 'trial'


def named_run(name: str, record: RunRecord) -> Run:
    """Return a run with this id in all rows."""
    run = Run(name, record=record)
    run.id = name
    return run


def _stretched(result: OfflineResult, times: int) -> Run:
    """Repeat the motion of a run so many times, one after the other."""
    record = run_record_of(result)
    log = record.log
    longer = replace(
        log, ks=np.arange(len(log.ks) * times),
        **{name: np.tile(getattr(log, name), (times, 1, 1)) for name in (
            'vehicle_states', 'published_states', 'object_poses', 'object_velocities')})
    run = named_run('a', replace(record, log=longer))
    run.scoring = 'none'
    return run


@pytest.mark.exhaustive
def test_memory_does_not_grow_with_the_run(recorded: Recorded, tmp_path: Path,
                                           monkeypatch: pytest.MonkeyPatch) -> None:
    """The tables of a run eight times as long take no more, but for its driving behaviour."""
    for module, name in ((table_writer, 'PIECE_ROWS'), (states_table, 'PIECE_ROWS'),
                         (pairs_table, '_BUFFERED_ROWS')):
        monkeypatch.setattr(module, name, 200)
    peaks = []
    for times in (1, 1, 8):
        run = _stretched(recorded.result, times)
        # That is measured over a whole run at once, and kept.
        assert len(run.usual_behaviour) == 2
        pool = pa.proxy_memory_pool(pa.system_memory_pool())
        usual = pa.default_memory_pool()
        pa.set_memory_pool(pool)
        tracemalloc.start()
        try:
            rows = write_tables([run], tmp_path / str(times), 'parquet')
            peaks.append((tracemalloc.get_traced_memory()[1], pool.max_memory()))
        finally:
            tracemalloc.stop()
            pa.set_memory_pool(usual)
        assert rows['states'] > 200 * times
    # The first warms up. Only a Parquet file's footer still grows: 10 kB a row group.
    assert peaks[2][0] < peaks[1][0] + 1_500_000
    assert peaks[2][1] < peaks[1][1] + 3_000_000
