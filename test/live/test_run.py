# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Whole runs from the command line: outputs, exit codes, every way to end, bad input."""

from collections.abc import Iterator
import json
import math
from pathlib import Path
import re
import signal

import commonroad
from commonroad.common.file_reader import CommonRoadFileReader
from commonroad.scenario.obstacle import DynamicObstacle
from crgame_ros.analysis.criticality.recorded import measure_log
from crgame_ros.analysis.criticality.rows import (
    COLUMNS,
    criticality_rows,
    CRITICALITY_TOPIC,
    read_criticality_rows,
)
from crgame_ros.cli import main
from crgame_ros.game.game import load_game
from crgame_ros.recording.metadata import read_metadata
from crgame_ros.recording.reader import BagReader
from crgame_ros.recording.run_cycles import read_cycles
from crgame_ros.recording.run_trajectories import read_trajectories
from crgame_ros.ros.messages import from_time
from crgame_ros.timing.cycle_rows import CycleTable
from live_peer import Peer
from live_support import CUT_IN, is_node, Launcher, SCENARIOS, wait_until
from lxml import etree
import numpy as np
from numpy.typing import NDArray
import pytest
from scipy.interpolate import CubicHermiteSpline

DURATION_S = 3.5
STEPS = 350
STEP_NS = 10_000_000
DT_S = 0.01
STEPS_PER_TICK = 10
# CommonRoad vehicle 2 (BMW 320i): the rear axle is so far behind the centre [m].
REAR_TO_CENTER = 1.4227
SCENARIO = 'ZAM_CutIn-1_1_T-1'
# Human and AV each become a planning problem, which CommonRoad marks with C-.
BENCHMARK_ID = f'C-{SCENARIO}'
TABLE_I = {'final_error_ms', 'mean_step_error_ms', 'max_cumulative_error_ms', 'timeout_ratio',
           'real_time_ratio', 'time_efficiency', 'precision_ratio'}
PLANS = {'accepted', 'fallback', 'refused', 'skipped', 'latency_ms'}
NODES = {'sim_node', 'driver_node_hv0', 'planner_node_av0', 'recorder_node', 'drivability_node',
         'timesync_node', 'marker_node', 'criticality_node'}


@pytest.fixture(scope='module')
def finished(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Launcher]:
    """Run the cut-in game to the end of its short duration, in a folder of any name."""
    with Launcher([CUT_IN, '--duration', DURATION_S],
                  tmp_path_factory.mktemp('finished') / 'a "run": \'ü #', report=True) as launcher:
        assert launcher.wait() == 0, launcher.text
        yield launcher


def _poses(bag: Path) -> dict[int, dict[str, tuple[float, float, float]]]:
    """Read the rear-axle poses on /vehicles/state by step n of a run whose n = 0 is first."""
    poses: dict[int, dict[str, tuple[float, float, float]]] = {}
    with BagReader(bag) as reader:
        for item in reader.decoded(['/vehicles/state']):
            point = item.message.points[0]
            values = dict(zip(item.message.joint_names, point.positions, strict=True))
            poses[from_time(item.message.header.stamp)] = {
                name: tuple(values[f'{name}/{joint}'] for joint in ('x', 'y', 'yaw'))
                for name in {joint.split('/')[0] for joint in values}}
    start_ns = min(poses)
    return {(stamp_ns - start_ns) // STEP_NS: value for stamp_ns, value in poses.items()}


def _speeds(bag: Path, vehicle: str) -> NDArray[np.float64]:
    """Read the (S, 2) speeds of a vehicle's rear axle along x and y on /vehicles/state."""
    found: dict[int, tuple[float, float]] = {}
    with BagReader(bag) as reader:
        for item in reader.decoded(['/vehicles/state']):
            first = list(item.message.joint_names).index(f'{vehicle}/x')
            found[from_time(item.message.header.stamp)] = tuple(
                item.message.points[0].velocities[first:first + 2])
    return np.array([found[stamp_ns] for stamp_ns in sorted(found)])


def _check_outputs(out: Path, benchmark_id: str, *more: str) -> None:
    """Check that the four outputs are there, and more, and the recording is finished."""
    assert {path.name for path in out.iterdir()} == {
        'bag', f'{benchmark_id}.xml', 'timing.json', 'game.yaml', *more}
    assert sorted(path.suffix for path in (out / 'bag').iterdir()) == ['.mcap', '.yaml']
    metadata = read_metadata(out / 'bag')
    with BagReader(out / 'bag') as reader:
        assert reader.complete
        assert reader.message_count == sum(file.message_count for file in metadata.files) > 0
    CommonRoadFileReader(str(out / f'{benchmark_id}.xml')).open()


def test_a_run_leaves_its_outputs(finished: Launcher) -> None:
    """Bag with metadata, scenario, timing, game and report; the nodes start once and all end."""
    _check_outputs(finished.out, BENCHMARK_ID, 'report.html')
    # The report comes last: all other files cannot be made later.
    assert finished.text.index('/timing.json') < finished.text.index('writing ')
    # Nothing comes after what matters most.
    assert re.fullmatch(r'a "run".*: 0 contacts, (least TTC [0-9.]+ s, )?(\d+) of \2 plans '
                        r'accepted, nuPlan score hv0 [0-9.]+, av0 [0-9.]+, '
                        r'(real-time ratio [0-9.]+|slower than real time .*)',
                        finished.text.splitlines()[-1])
    assert {name for name, _ in finished.started} == NODES
    assert len(finished.started) == len(NODES)
    assert not any(is_node(pid) for _, pid in finished.started)
    assert finished.errors == []
    assert finished.complaints == []


def live_criticality(finished: Launcher) -> NDArray[np.float64]:
    """Read the rows that criticality_node has published."""
    with BagReader(finished.out / 'bag') as reader:
        return np.concatenate([
            read_criticality_rows(item.message.layout.dim[1].label, item.message.data)
            for item in reader.decoded([CRITICALITY_TOPIC])])


def test_criticality_is_the_same_live_and_from_the_bag(finished: Launcher) -> None:
    """Each recorded row is the same to the last bit; the node has rows of each vehicle."""
    live = live_criticality(finished)
    with BagReader(finished.out / 'bag') as reader:
        told = {status.name for item in reader.decoded(['/diagnostics'])
                for status in item.message.status}
    first, last = int(live[0, 1]), int(live[-1, 1])
    # There is no gap; its first and last row depend on the machine.
    assert sorted(set(live[:, 1].tolist())) == list(range(first, last + 1, STEPS_PER_TICK))
    assert np.isfinite(live[:, COLUMNS.index('min_distance')]).all()
    blocks: list[NDArray[np.float64]] = []
    log = read_trajectories(finished.out / 'bag')
    measure_log(log, on_tick=lambda it: blocks.append(criticality_rows(it, 0, it.n)))
    again = np.concatenate(blocks)
    # Others' accelerations, differences from step to step, are known from its second step on.
    compared = (again[:, 1] > first) & (again[:, 1] <= last)
    assert last > first and again[-1, 1] == STEPS
    assert np.array_equal(live[live[:, 1] > first], again[compared], equal_nan=True)
    assert {'criticality_node: hv0', 'criticality_node: av0'} <= told


@pytest.mark.clock
def test_criticality_begins_within_a_second(finished: Launcher) -> None:
    """Its subscriptions are matched by then; no run waits for it, unlike for planners."""
    live = live_criticality(finished)
    assert live[0, 1] <= 1.0 / DT_S
    assert live[-1, 1] == STEPS


@pytest.mark.exhaustive
def test_the_human_drives_live_against_another_planner(finished: Launcher, tmp_path: Path) -> None:
    """In real time, once; the human repeats its motion to the last bit."""
    assert main(['replay', str(finished.out), *2 * ['--planner', 'constant-velocity'], '--live',
                 '--headless', '--out', str(tmp_path / 'out')]) == 0
    recorded, found = json.loads((tmp_path / 'out' / 'comparison.json').read_text())
    assert found['human_differs_s'] is None
    assert found['accepted_ratio']['av0'] > 0.5
    assert found['criticality']['vehicles'].keys() == recorded['criticality']['vehicles'].keys()
    again = read_trajectories(tmp_path / 'out' / 'constant_velocity' / 'bag')
    assert len(again.ks) == len(read_trajectories(finished.out / 'bag').ks)


def test_the_timing_report_has_table_one(finished: Launcher) -> None:
    """`timing.json` has CRG's table I and the counts of plans, with plausible numbers."""
    report = json.loads((finished.out / 'timing.json').read_text())
    assert set(report) >= TABLE_I
    assert set(report['real_time_ratio']) == {'final', 'mean', 'min'}
    assert report['gaps'] == 0
    plans = report['planners']['av0']
    assert set(plans) >= PLANS
    # One request a tick at most, the one of k0 included; no plan of our own planner is refused.
    assert 0 < plans['accepted'] <= STEPS // STEPS_PER_TICK + 1
    assert plans['refused'] == 0
    assert plans['latency_ms']['p50'] > 0.0


def test_every_status_has_the_time_of_the_run_and_an_owner(finished: Launcher) -> None:
    """All nodes stamp their diagnostics with simulation time, and sign them with their name."""
    stamps: dict[str, list[int]] = {}
    owners: dict[str, set[str]] = {}
    with BagReader(finished.out / 'bag') as reader:
        clock = [item.message.clock for item in reader.decoded(['/clock'])]
        for item in reader.decoded(['/diagnostics', '/hv0/drivability', '/av0/drivability']):
            for status in item.message.status:
                owners.setdefault(status.hardware_id, set()).add(status.name)
                stamps.setdefault(status.name, []).append(from_time(item.message.header.stamp))
    assert {'/sim_node', '/planner_node_av0', '/recorder_node', '/drivability_node',
            '/timesync_node', '/criticality_node'} <= owners.keys() <= {
                f'/{name}' for name in NODES}
    assert all(owner.split('/')[1].startswith(name.partition(':')[0].partition('_node')[0])
               for owner, names in owners.items() for name in names if ':' in name)
    first_ns, last_ns = from_time(clock[0]), from_time(clock[-1])
    assert last_ns - first_ns == STEPS * STEP_NS
    for name, found in stamps.items():
        assert first_ns <= min(found) and max(found) <= last_ns, name
        assert found == sorted(found), name


def test_the_first_step_waits_until_the_recorder_hears_all_nodes(finished: Launcher) -> None:
    """
    Step 1 comes after the recorder's report that it has heard planner, driver and supervisor.

    Without that, the first reports of a node that the recorder finds late are not recorded.
    """
    awaited = {'/av0/plan', '/hv0/driver_command', '/timing/frame_skip'}
    heard_ns: list[int] = []
    clock_ns: list[int] = []
    with BagReader(finished.out / 'bag') as reader:
        for item in reader.decoded(['/clock', '/diagnostics']):
            if item.topic == '/clock':
                clock_ns.append(from_time(item.message.clock))
                if clock_ns[-1] > clock_ns[0]:
                    first_step_ns = item.log_time_ns
                    break
            heard_ns += [item.log_time_ns for status in getattr(item.message, 'status', [])
                         if status.name == 'recorder_node: recorded topics'
                         and awaited <= {value.key for value in status.values}]
    assert heard_ns
    assert min(heard_ns) < first_step_ns


def test_no_step_is_missing_in_the_recording(finished: Launcher) -> None:
    """Cycles 1 to 350 and states 0 to 350 are there, each once."""
    numbers: list[int] = []
    throttle: list[float] = []
    with BagReader(finished.out / 'bag') as reader:
        for item in reader.decoded(['/timing/cycle']):
            label = item.message.layout.dim[1].label
            table = CycleTable.from_message(label, item.message.data)
            numbers += table.column('n').tolist()
            throttle += table.commands('hv0')[:, 0].tolist()
    # The run waits for the driver: its key counts from the first cycle on, by CRG's 1.8/s.
    assert throttle[0] == pytest.approx(1.8 * 0.01, abs=1e-6)
    assert numbers == list(range(1, STEPS + 1))
    assert sorted(_poses(finished.out / 'bag')) == list(range(STEPS + 1))


def test_the_scenario_is_valid_and_true_to_the_recording(finished: Launcher) -> None:
    """
    The XML obeys CommonRoad's schema, and every k is within 1 mm of the recorded motion.

    The human was at the file's position when the intervals of his own cycles summed up to k.
    """
    path = finished.out / f'{BENCHMARK_ID}.xml'
    schema = Path(commonroad.__file__).parent.joinpath(
        'scenario_definition', 'xml_definition_files', 'XML_commonRoad_XSD.xsd')
    etree.XMLSchema(etree.parse(str(schema))).assertValid(etree.parse(str(path)))
    scenario, problems = CommonRoadFileReader(str(path)).open()
    poses = _poses(finished.out / 'bag')
    obstacles = {_vehicle_of(item, poses[0]): item for item in scenario.dynamic_obstacles}
    assert set(obstacles) == {'hv0', 'av0'}
    assert len(problems.planning_problem_dict) == len(obstacles)
    ticks = STEPS // STEPS_PER_TICK
    cycles = read_cycles(finished.out / 'bag')
    passed_s = np.concatenate(([0.0], np.cumsum(cycles.column('dt_eff_s'))))
    for vehicle, obstacle in obstacles.items():
        assert obstacle.prediction.final_time_step == ticks
        rears = np.array([poses[n][vehicle] for n in range(STEPS + 1)])
        times_s = passed_s if vehicle == 'hv0' else np.arange(STEPS + 1) * DT_S
        written = np.array([obstacle.state_at_time(k).position for k in range(ticks)])
        asked_s = np.arange(ticks) * STEPS_PER_TICK * DT_S
        # By the speeds, too: on a straight line 50 ms of a busy machine are more than 1 mm off.
        x, y = CubicHermiteSpline(times_s, rears[:, :2], _speeds(finished.out / 'bag', vehicle)
                                  )(asked_s).T
        yaw = np.interp(asked_s, times_s, rears[:, 2])
        recorded = np.array([_center(*row) for row in zip(x, y, yaw, strict=True)])
        assert np.hypot(*(written - recorded).T).max() <= 1e-3
        # Both drive: 26 and 20 m/s for 3.5 s, whatever the pedals do meanwhile.
        assert math.dist(obstacle.state_at_time(0).position,
                         obstacle.state_at_time(ticks).position) > 50.0


def _center(x: float, y: float, yaw: float) -> tuple[float, float]:
    return x + REAR_TO_CENTER * math.cos(yaw), y + REAR_TO_CENTER * math.sin(yaw)


def _vehicle_of(obstacle: DynamicObstacle, poses: dict[str, tuple[float, float, float]]) -> str:
    """Find the vehicle that starts where an obstacle does."""
    return min(poses, key=lambda vehicle: math.dist(obstacle.initial_state.position,
                                                    _center(*poses[vehicle])))


@pytest.mark.exhaustive
def test_interrupt_ends_a_rerun_in_good_order(finished: Launcher, tmp_path: Path) -> None:
    """The run's own `game.yaml` starts the same game again; Ctrl-C ends it with all outputs."""
    game_file = finished.out / 'game.yaml'
    with Launcher([game_file, '--duration', 60], tmp_path / 'run') as launcher:
        _wait_for_step(launcher, 50)
        launcher.signal(signal.SIGINT)
        assert launcher.wait() == 0, launcher.text
        _check_outputs(tmp_path / 'run', BENCHMARK_ID)
        assert not launcher.says('Traceback|does not end')
        assert not any(is_node(pid) for _, pid in launcher.started)
    assert _poses(tmp_path / 'run' / 'bag')[0] == _poses(finished.out / 'bag')[0]
    first, second = load_game(game_file), load_game(tmp_path / 'run' / 'game.yaml')
    assert (first.humans, first.avs, first.timing) == (second.humans, second.avs, second.timing)


def _wait_for_step(launcher: Launcher, n: int) -> None:
    """Wait until a run has begun and come so far."""
    launcher.wait_for('recording into')
    with Peer(launcher.domain, '/clock', '/scenario/game') as peer:
        peer.wait_until(lambda: peer.n >= n, f'n = {n}')


@pytest.mark.exhaustive
def test_terminate_ends_a_bare_scenario(shared_scenarios: Path, tmp_path: Path) -> None:
    """
    `--scenario` alone runs: a human is placed, the AV gets a planner; SIGTERM ends it well.

    So do the compiled packages of the reactive planner, which report each object that is left.
    """
    with Launcher(['--scenario', shared_scenarios / 'USA_US101-4_1_T-1.xml',
                   '--planner', 'reactive'], tmp_path / 'run') as launcher:
        _wait_for_step(launcher, 50)
        launcher.signal(signal.SIGTERM)
        assert launcher.wait() == 0, launcher.text
        assert not launcher.says('nanobind|leaked'), launcher.text
        _check_outputs(tmp_path / 'run', 'C-USA_US101-4_1_T-1')
    vehicles = _poses(tmp_path / 'run' / 'bag')[0]
    assert set(vehicles) == {'hv0', 'av0'}
    # Near the AV, and never upon it: a lane is wider than 2 m, a car longer.
    assert 2.0 < math.dist(vehicles['hv0'][:2], vehicles['av0'][:2]) < 100.0


@pytest.mark.exhaustive
def test_no_node_outlives_a_killed_launcher(tmp_path: Path) -> None:
    """After `kill -9` of the launcher the nodes end by themselves, the recorder in good order."""
    with Launcher([CUT_IN], tmp_path / 'run') as launcher:
        launcher.wait_for('recording into')
        nodes = [pid for _, pid in launcher.started]
        assert len(nodes) == len(NODES)
        assert all(is_node(pid) for pid in nodes)
        launcher.signal(signal.SIGKILL)
        wait_until(lambda: not any(is_node(pid) for pid in nodes), 'the end of every node')
    with BagReader(tmp_path / 'run' / 'bag') as reader:
        assert reader.complete


BAD_INPUT = {
    'no such game': (['nowhere.yaml'], r'nowhere\.yaml'),
    'malformed scenario': (['--scenario', 'cut.xml'], r'cut\.xml'),
    'no such planner': ([CUT_IN, '--planner', 'clairvoyant'], 'clairvoyant'),
    'no such driver': ([CUT_IN, '--driver', 'chauffeur'], 'chauffeur'),
    'negative rate': ([CUT_IN, '--rate', '-1'], '--rate'),
}


@pytest.mark.matrix
@pytest.mark.parametrize('case', BAD_INPUT)
def test_bad_input_starts_nothing(case: str, tmp_path: Path) -> None:
    """Exit code 2, one line that names the culprit, no process and no folder."""
    scenario = (SCENARIOS / f'{SCENARIO}.xml').read_text()
    (tmp_path / 'cut.xml').write_text(scenario[:len(scenario) // 2])
    arguments, named = BAD_INPUT[case]
    with Launcher(arguments, cwd=tmp_path) as launcher:
        assert launcher.wait() == 2
        assert len(launcher.errors) == 1
        assert launcher.errors[0].startswith('error: ')
        assert named.replace('\\', '') in launcher.errors[0]
        assert launcher.lines == []
    assert [path.name for path in tmp_path.iterdir()] == ['cut.xml']
