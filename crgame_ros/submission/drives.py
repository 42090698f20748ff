# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Where solutions come from: recorded runs, cells of an evaluation, and scenarios to drive now."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import datetime
from functools import partial
import math
from pathlib import Path
import time
from typing import NamedTuple

from crgame_ros.errors import InputError
from crgame_ros.evaluation.cell import Cell
from crgame_ros.evaluation.cell_run import run_cell
from crgame_ros.evaluation.cell_scene import files_of, runs_of, SCENARIO_SUFFIXES
from crgame_ros.evaluation.file_names import GRID_FILE
from crgame_ros.evaluation.folder import EvaluationFolder
from crgame_ros.game.game import AvSpec, DEFAULT_PLANNER, Game
from crgame_ros.library.lookup import find_scenarios, names_file
from crgame_ros.paths import expanded
from crgame_ros.planner.registry import create_planner, EXTERNAL
from crgame_ros.recording.info import describe
from crgame_ros.recording.metadata import METADATA_FILE
from crgame_ros.recording.run_folder import folder_name, recording_in
from crgame_ros.recording.run_trajectories import (
    read_trajectories,
    RunTrajectories,
    trajectories_of,
)
from crgame_ros.scenario.loading import load_scenario, LoadedScenario
from crgame_ros.simulation.av_assignment import assign_avs
from crgame_ros.simulation.offline import OfflineResult, run_offline
from crgame_ros.simulation.setup import build_setup

_RECORDINGS = ('.mcap', '.db3')
# A goal without a time is driven to for so long [s].
_USUAL_S = 20.0


class DrivenRun(NamedTuple):
    """
    A finished run.

    :param log: its motion.
    :param when: its date, where it is known.
    :param remarks: what went wrong with planners, one line each.
    """

    log: RunTrajectories
    when: datetime | None = None
    remarks: tuple[str, ...] = ()


class Drive(NamedTuple):
    """
    A run to read or to drive.

    :param name: for people.
    :param scenario: id of its scenario as far as it is known before; else its name.
    :param make: reads or drives it; raises an `InputError` if that is impossible.
    """

    name: str
    scenario: str
    make: Callable[[], DrivenRun]


@dataclass(frozen=True)
class DrivingChoice:
    """
    How scenarios are driven, and which cells of an evaluation are taken.

    :param planner: of all AVs, or label of an evaluation's planner; None for `idm`, or for the
        only one of an evaluation.
    :param options: of the planner.
    :param vehicle: of all AVs, as in a game file; None for the usual one.
    :param duration_s: longest simulated time; None for the time of the goal [s]
    """

    planner: str | None = None
    options: Mapping[str, object] = field(default_factory=dict)
    vehicle: str | None = None
    duration_s: float | None = None


def find_drives(names: Sequence[str], choice: DrivingChoice) -> list[Drive]:
    """
    Find what names stand for.

    :param names: evaluations, runs, folders of runs, scenarios, folders of scenarios, benchmark
        ids and patterns of ids.
    :raises InputError: if one stands for nothing, or a choice does not apply to any.
    """
    found: list[Drive] = []
    scenarios, evaluations = [], 0
    for name in names:
        path = expanded(name)
        if names_file(name) and (path / GRID_FILE).exists():
            found += _cells(path, choice)
            evaluations += 1
        elif names_file(name) and _has_runs(path):
            found += [Drive(folder_name(run), folder_name(run), partial(_recorded, run))
                      for run in runs_of((str(path),), Path())]
        else:
            scenarios.append(name)
    files = files_of(find_scenarios(scenarios), Path(), SCENARIO_SUFFIXES, 'CommonRoad file')
    if files:
        _check_planner(choice)
    found += [Drive(choice.planner or DEFAULT_PLANNER, file.stem, partial(_driven, file, choice))
              for file in files]
    if not files:
        _check_unused(choice, evaluations)
    return found


def _check_planner(choice: DrivingChoice) -> None:
    if choice.planner == EXTERNAL:
        raise InputError('an external planner works in live runs only', '--planner',
                         'name another planner, or the run that it drove')
    create_planner(choice.planner or DEFAULT_PLANNER, choice.options)


def _check_unused(choice: DrivingChoice, evaluations: int) -> None:
    """Refuse options for scenarios where there are none."""
    given = {'--option': bool(choice.options), '--vehicle': choice.vehicle is not None,
             '--duration': choice.duration_s is not None,
             '--planner': choice.planner is not None and not evaluations}
    for option, is_given in given.items():
        if is_given:
            raise InputError('is for scenarios, and runs have been driven', option,
                             'leave it out, or name scenarios')


def _has_runs(path: Path) -> bool:
    return path.suffix in _RECORDINGS or path.is_dir() and (
        recording_in(path) != path or (path / METADATA_FILE).exists()
        or any(path.glob('*/bag')) or any(path.glob('*.mcap')))


def _recorded(path: Path) -> DrivenRun:
    bag = recording_in(path)
    # Log times are those of the wall clock; of an offline run they begin at 0.
    start_s = describe(bag).start_ns // 10**9
    return DrivenRun(read_trajectories(bag), datetime.fromtimestamp(start_s) if start_s else None)


def _cells(path: Path, choice: DrivingChoice) -> Iterator[Drive]:
    """Yield the cells of an evaluation with the chosen planner."""
    place = EvaluationFolder(path)
    grid = place.grid()
    labels = [planner.label for planner in grid.planners]
    if choice.planner is None and len(labels) > 1 or choice.planner not in (None, *labels):
        raise InputError(f'has the planners {", ".join(labels)}', str(path),
                         'choose one with --planner')
    for cell in grid:
        if choice.planner in (None, cell.condition.planner):
            yield Drive(cell.label, cell.condition.scenario,
                        partial(_of_cell, cell, place.store.folder))


def _of_cell(cell: Cell, contents: Path) -> DrivenRun:
    return _finished(run_cell(cell, contents))


def _driven(file: Path, choice: DrivingChoice) -> DrivenRun:
    """Drive all planning problems of a scenario, until its last goal is over."""
    loaded = load_scenario(file)
    game = Game(file.resolve(), humans=())
    if loaded.scenario.scenario_id.cooperative:
        # Its vehicles drive together, wherever they start: none is an alternative to another.
        game = replace(game, avs=tuple(
            AvSpec(f'av{number}', planning_problem=problem.planning_problem_id)
            for number, problem in enumerate(loaded.planning_problems)))
    specs = [_adapted(spec, choice) for spec, _ in assign_avs(game, loaded)[0]]
    if not specs:
        raise InputError('it has no planning problem', str(file), 'name another scenario')
    setup = build_setup(replace(game, avs=tuple(specs)), loaded)
    goal_s = _goal_s(loaded, setup.scheduler.k0)
    duration_s = goal_s if choice.duration_s is None else min(goal_s, choice.duration_s)
    return _finished(run_offline(setup, duration_s=duration_s, clock_s=time.perf_counter))


def _adapted(spec: AvSpec, choice: DrivingChoice) -> AvSpec:
    spec = replace(spec, planner=choice.planner or DEFAULT_PLANNER, options=dict(choice.options))
    return spec if choice.vehicle is None else replace(spec, vehicle=choice.vehicle)


def _goal_s(loaded: LoadedScenario, k0: int) -> float:
    """Return the time from the start to the end of the last goal [s]."""
    ends = [getattr(getattr(goal, 'time_step', None), 'end', None)
            for problem in loaded.planning_problems for goal in problem.goal.state_list]
    known = [end for end in ends if end is not None and math.isfinite(end)]
    return max(1, max(known) - k0) * loaded.time_step_s if known else _USUAL_S


def _finished(result: OfflineResult) -> DrivenRun:
    remarks = []
    for name, record in result.planners.items():
        plans, reasons = record.statistics.plans, dict(record.statistics.reasons)
        if reasons:
            remarks.append(f'{name} braked in {record.statistics.fallbacks} of {plans} plans: '
                           f'{max(reasons, key=reasons.__getitem__)}')
        if record.counters.refused:
            remarks.append(f'{record.counters.refused} plans of {name} were refused: '
                           f'{record.counters.last_refusal}')
    return DrivenRun(trajectories_of(result), None, tuple(remarks))
