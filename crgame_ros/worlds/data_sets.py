# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Converts data sets of recorded traffic to CommonRoad scenarios."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
import re
import subprocess
import tempfile
from threading import Timer

from commonroad.scenario.obstacle import DynamicObstacle
from commonroad.scenario.scenario import ScenarioID, Tag
from crgame_ros.errors import CrgameError, InputError, one_line
from crgame_ros.paths import config_directory
from crgame_ros.recording.export import prepare_folder
from crgame_ros.recording.progress import Progress
from crgame_ros.roads.network import RoadNetwork
from crgame_ros.roads.route import find_route
from crgame_ros.scenario import guard
from crgame_ros.scenario.exact_values import exact_value
from crgame_ros.scenario.export_document import (
    dynamic_obstacle,
    DYNAMIC_TYPES,
    goal_state,
    placed_rectangle,
    planning_problem,
    scenario_document,
    scenario_header,
    whole,
)
from crgame_ros.scenario.export_ids import IdPool
from crgame_ros.scenario.export_network import used_ids, write_roads
from crgame_ros.scenario.loading import LoadedScenario, parse_scenario
from crgame_ros.scenario.obstacles import ScenarioObstacles
from crgame_ros.vehicle.lights import Light
from crgame_ros.whole_file import write_text
from crgame_ros.worlds.environments import converter_variables, DATA_SET_CONVERTER
from crgame_ros.worlds.kinds import WorldKind
from crgame_ros.worlds.recordings import find_recordings, Recording
import numpy as np
from numpy.typing import NDArray

_TIME_STEP = re.compile('timeStepSize="[^"]*"')
# A recording has fewer scenarios than this, so that its number and theirs make one.
_PER_RECORDING = 10_000
# Lines of the converter that say why it made nothing.
_REASON = re.compile(r'(Error|Exception)\b.*:')
_LAST_WORDS = 300
FloatArray = NDArray[np.float64]

# An AV takes the place of a car that goes so far from where it was at first [m].
_LEAST_WAY = 5.0
# Its yaw rate at first is the mean over so long [s]: positions are rounded.
_TURNING_S = 0.4
# Around the footprint where the car ended [m], along and across.
_MARGIN = (10.0, 2.0)
_SHORTEST = 10


@dataclass(frozen=True)
class DataSetImport:
    """
    What to convert.

    :param source: the folder of a data set, or the file with the tracks of one recording.
    :param out: folder of the scenarios.
    :param limit: greatest number of scenarios.
    :param steps: time steps of each.
    :param downsample: take each n-th frame only.
    :param timeout_s: that a recording may take [s]
    :param force: replace scenarios that are there.
    """

    source: Path
    kind: WorldKind
    out: Path
    limit: int
    steps: int
    downsample: int = 1
    timeout_s: float = 900.0
    force: bool = False


def convert_data(order: DataSetImport, say: Callable[[str], object]) -> Iterator[Path]:
    """
    Convert a data set, and yield each scenario once it is written.

    The recordings are taken in the order of their names, each from its beginning: the same order
    gives the same scenarios. Each has a planning problem, which a recorded car solved.

    :param say: called with each line of progress.
    :raises InputError: if the data are not as published, the folder cannot be written to, the
        converter fails, a scenario is there already, or there is none.
    :raises CrgameError: if the converter cannot be installed.
    """
    recordings = find_recordings(order.source, order.kind, say)
    prepare_folder(order.out)
    program = DATA_SET_CONVERTER.program('python', say)
    count = skipped = 0
    progress = Progress(say)
    for place, recording in enumerate(recordings, 1):
        say(f'reading {order.kind.label}, recording {recording.name}: {place} of '
            f'{len(recordings)}')
        with tempfile.TemporaryDirectory(prefix='crgame-import-') as name, \
                _windows(program, recording, order, Path(name)) as made:
            for window, path in enumerate(made, 1):
                written = _finish(path, recording, window, order)
                path.unlink()
                if written is None:
                    skipped += 1
                    continue
                yield written
                count += 1
                progress.tell(f'{count} of {order.limit} scenarios', count / order.limit)
                if count == order.limit:
                    return
    if skipped:
        say(f'note: left out, as no car drives in it from the beginning on: {skipped} of '
            f'{skipped + count}')
    if not count:
        raise InputError('no scenario was made of it', str(order.source),
                         'give other --steps, or another recording')


def _finish(path: Path, recording: Recording, window: int,
            order: DataSetImport) -> Path | None:
    """Complete and write a scenario of the converter; None if there is nothing to drive."""
    text = path.read_text(encoding='utf-8')
    if recording.time_step_s is not None:
        step = recording.time_step_s * order.downsample
        text = _TIME_STEP.sub(f'timeStepSize="{step:g}"', text, 1)
    what = f'{order.kind.label}, recording {recording.name}'
    loaded = parse_scenario(text, what)
    last = loaded.scenario.scenario_id.prediction_id
    made = _recorded_scenario(
        loaded, _PER_RECORDING * recording.number + window,
        f'{what}, up to frame {last}, by {DATA_SET_CONVERTER.title} and crgame import')
    if made is None:
        return None
    benchmark_id, xml_text = made
    out = order.out / f'{benchmark_id}.xml'
    if out.exists() and not order.force:
        raise InputError('is there already', str(out), 'add --force to replace it')
    write_text(xml_text, out)
    return out


@contextmanager
def _windows(program: Path, recording: Recording, order: DataSetImport,
             folder: Path) -> Iterator[Iterator[Path]]:
    """
    Run the converter on a recording, in a folder of its own.

    :return: yields the scenarios while it makes them; at the end of the block it is ended.
    :raises InputError: if it fails.
    """
    given, made, log = folder / 'given', folder / 'made', folder / 'log'
    for path, name in recording.files:
        (given / name).parent.mkdir(parents=True, exist_ok=True)
        (given / name).symlink_to(path)
    words = [str(program), str(config_directory() / 'converters' / 'data_set_windows.py'),
             '--num-planning-problems', '0', '--routability-check', 'nocheck',
             '--num-time-steps', str(order.steps * order.downsample),
             '--downsample', str(order.downsample), '--obstacles-start-at-zero',
             str(given), str(made), order.kind.name, *recording.words]
    with log.open('wb') as errors:
        try:
            # The order of sets, and so of some elements, follows from the hashes.
            process = subprocess.Popen(
                words, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=errors,
                text=True, cwd=folder, env=converter_variables() | {
                    'PYTHONHASHSEED': '0', '_TYPER_STANDARD_TRACEBACK': '1'})
        except OSError as error:
            raise CrgameError(f'{DATA_SET_CONVERTER.title} cannot be run '
                              f'({error.strerror})') from error
    late: list[bool] = []

    def expire() -> None:
        late.append(True)
        process.kill()

    timer = Timer(order.timeout_s, expire)
    timer.start()
    try:
        yield _made(process, made, log, recording, late, order.timeout_s)
    finally:
        timer.cancel()
        process.kill()
        process.wait()
        if process.stdout is not None:
            process.stdout.close()


def _made(process: 'subprocess.Popen[str]', made: Path, log: Path, recording: Recording,
          late: list[bool], timeout_s: float) -> Iterator[Path]:
    count = 0
    for line in process.stdout or ():
        count += 1
        yield made / line.strip()
    what = f'recording {recording.name}: {DATA_SET_CONVERTER.title}'
    if late:
        raise InputError(f'took longer than {timeout_s:.0f} s', what,
                         'give fewer --steps, or more time with --timeout')
    lines = [line.strip() for line in log.read_text(errors='replace').splitlines()]
    reasons = [line for line in lines if _REASON.search(line)]
    if process.wait() or (reasons and not count):
        said = (reasons or [line for line in lines if line] or ['it wrote nothing'])[-1]
        raise InputError(one_line(said)[-_LAST_WORDS:], what)


def _recorded_scenario(loaded: LoadedScenario, number: int,
                       source: str) -> tuple[str, str] | None:
    """
    Return a scenario in which an AV takes the place of a recorded car.

    It is the car that goes farthest of those that are there at time step 0, on lanes for cars at
    the beginning and the end, with a route between. Its goal is where it ended.

    :param loaded: what the converter wrote, with obstacles from time step 0 on.
    :param number: of the scenario among those of its data set, from 1 on.
    :param source: what it is of, for its header.
    :return: benchmark id and content of the file, which is valid by CommonRoad's schema but for
        vehicles that appear after time step 0; None if there is no such car, or the scenario is
        shorter than 10 time steps.
    """
    network = RoadNetwork(loaded.scenario.lanelet_network)
    recorded = ScenarioObstacles(loaded)
    ego = _find_ego(network, recorded)
    if ego is None:
        return None
    notes: list[str] = []
    roads = write_roads(loaded, 0, notes)
    for tags in roads.elements:
        simulated = tags.find('simulated') if tags.tag == 'scenarioTags' else None
        if simulated is not None and Tag.SIMULATED not in (loaded.scenario.tags or ()):
            tags.remove(simulated)
    ids = IdPool(used_ids(roads.elements), notes)
    obstacles = {f'o{each.obstacle_id}': each for each in loaded.scenario.dynamic_obstacles}
    written = [_obstacle(recorded, column, obstacles[name], ids)
               for column, name in enumerate(recorded.ids)
               if name in obstacles and column != ego[0]]
    problem = _problem(recorded, *ego, obstacles[recorded.ids[ego[0]]], ids.fresh())
    given: ScenarioID = loaded.scenario.scenario_id
    benchmark_id = str(ScenarioID(False, given.country_id, given.map_name, given.map_id, number,
                                  'T', 1))
    root = guard.parse_hardened(loaded.xml_text, loaded.source)
    header = scenario_header(benchmark_id, loaded.time_step_s, one_line(source),
                             author=root.get('author', ''),
                             affiliation=root.get('affiliation', ''))
    return benchmark_id, scenario_document(
        header, roads.elements, ''.join(written) + problem, late=True)


def _find_ego(network: RoadNetwork, recorded: ScenarioObstacles) -> tuple[int, int] | None:
    """Return the column of the car whose place an AV takes, and its last time step on a lane."""
    poses = recorded.poses
    if recorded.first_k or len(poses) < _SHORTEST:
        return None
    ways = np.nanmax(np.hypot(*np.moveaxis(poses - poses[0], -1, 0)[:2]), axis=0,
                     initial=0.0, where=np.isfinite(poses[:, :, 0]) & np.isfinite(poses[0, :, 0]))
    cars = [column for column, item in enumerate(recorded.descriptions)
            if item.type == 'car' and ways[column] >= _LEAST_WAY]
    for column in sorted(cars, key=lambda each: (-ways[each], each)):
        there = np.flatnonzero(np.isfinite(poses[:, column, 0]))
        lanes = [network.lanelet_ids[place] if place >= 0 else None
                 for place in network.lanelets_at(poses[there, column]).tolist()]
        on = [k for k, lane in zip(there.tolist(), lanes, strict=True)
              if lane is not None and network.is_drivable(lane)]
        first, last = lanes[0], on[-1] if on else 0
        goal = lanes[int(np.searchsorted(there, last))]
        if not on or on[0] != 0 or first is None or goal is None or last < _SHORTEST - 1:
            continue
        s, _ = network.locate(first, *poses[0, column, :2])
        if find_route(network, first, s, frozenset({goal}), 0.0).goal is not None:
            return column, last
    return None


def _obstacle(recorded: ScenarioObstacles, column: int, obstacle: DynamicObstacle,
              ids: IdPool) -> str:
    item = recorded.descriptions[column]
    there = np.flatnonzero(np.isfinite(recorded.poses[:, column, 0]))
    first = recorded.first_k + int(there[0])
    rows = np.column_stack((recorded.poses[there, column], _speeds(obstacle, there)))
    signals = recorded.signals.get(column)
    # Those that the converter infers from turns.
    shown = [] if signals is None else [
        (False, bool(bits & Light.LEFT), bool(bits & Light.RIGHT))
        for bits in map(signals.at, range(first, first + len(there)))]
    kind = item.type if item.type in DYNAMIC_TYPES else 'unknown'
    return dynamic_obstacle(ids.keep(obstacle.obstacle_id, item.id), kind, whole(item.shape),
                            rows.tolist(), False, shown, first)


def _speeds(obstacle: DynamicObstacle, steps: NDArray[np.int_]) -> FloatArray:
    """Return the recorded speeds at time steps [m/s]."""
    states = [obstacle.initial_state, *obstacle.prediction.trajectory.state_list]
    return np.interp(steps, [each.time_step for each in states],
                     [exact_value(each.velocity) for each in states])


def _problem(recorded: ScenarioObstacles, column: int, last: int, obstacle: DynamicObstacle,
             number: int) -> str:
    poses, shape = recorded.poses[:, column], recorded.descriptions[column].shape
    turning = recorded.velocities[:max(1, round(_TURNING_S / recorded.time_step_s)), column, 2]
    row = (*poses[0].tolist(), exact_value(obstacle.initial_state.velocity),
           exact_value(getattr(obstacle.initial_state, 'acceleration', None)),
           float(turning.mean()))
    goal = placed_rectangle(shape.length + _MARGIN[0], shape.width + _MARGIN[1],
                            poses[last].tolist())
    return planning_problem(number, row, [goal_state((0, len(poses) - 1), goal)])
