# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Computes one cell: an offline run, and its measures."""

from collections.abc import Mapping
from pathlib import Path
import re
import resource
import time
from typing import Any, Literal, TypeVar

from crgame_ros.analysis.runs.run import Run
from crgame_ros.driver.source import ReplayDriver
from crgame_ros.each_minute import kind_of
from crgame_ros.evaluation.cell import Cell
from crgame_ros.evaluation.cell_scene import INPUTS
from crgame_ros.evaluation.content import resolved
from crgame_ros.evaluation.results.cell_rows import CellRows, outcome_of, vehicle_rows
from crgame_ros.game.game import Game, parse_game
from crgame_ros.game.perception_spec import PerceptionSpec
from crgame_ros.game.traffic_spec import TrafficSpec
from crgame_ros.recording.recorded_game import RecordedInputs
from crgame_ros.scenario.loading import load_scenario, LoadedScenario
from crgame_ros.schema.reading import read
from crgame_ros.simulation.av_assignment import adapt_game, OWN
from crgame_ros.simulation.contacts import contacts_of
from crgame_ros.simulation.offline import OfflineResult, PlannerRecord, run_offline
from crgame_ros.simulation.setup import build_setup, Setup
import numpy as np

T = TypeVar('T')
# A planner's reason begins with the name of an exception if its code failed.
_CODE_FAILED = re.compile(r'(setup failed: )?(\w*(Error|Exception|Interrupt|Iteration))\b')


def run_cell(cell: Cell, contents: Path, keep_messages: bool = False) -> OfflineResult:
    """
    Run a cell offline.

    :param contents: folder of the store with its contents.
    :param keep_messages: whether it is to be recorded.
    :raises InputError: if a part of it cannot be used.
    """
    setup = cell_setup(cell, contents)
    inputs = _inputs(cell, contents)
    return run_offline(setup, duration_s=cell.condition.duration_s,
                       latency_steps=cell.condition.latency_steps, drivers=inputs.drivers,
                       intervals_s=inputs.intervals_s, clock_s=time.perf_counter,
                       keep_messages=keep_messages)


def cell_setup(cell: Cell, contents: Path) -> Setup:
    """
    Build the setup of a cell.

    :raises InputError: if a part of it cannot be used.
    """
    game = parse_game(_resolved(cell.condition.values, contents), cell.label, contents)
    loaded = load_scenario(game.scenario)
    return build_setup(_adapted(game, loaded, cell, contents), loaded)


def _adapted(game: Game, loaded: LoadedScenario, cell: Cell, contents: Path) -> Game:
    """Return a game with the cell's AVs and traffic."""
    given = cell.condition
    choice: dict[str, Any] = {'planner': OWN, 'options': None} \
        if given.planner_choice is None else _resolved(given.planner_choice, contents)

    def spec(kind: type[T], values: object, name: str) -> T | Literal['own'] | None:
        return None if values is None else OWN if values == OWN else read(
            kind, _resolved(values, contents), name, contents)
    return adapt_game(
        game, loaded, seed=cell.seed, planner=choice['planner'], options=choice['options'],
        perception=spec(PerceptionSpec, given.perception_values, 'perception'),
        traffic=spec(TrafficSpec, given.traffic_values, 'traffic'))


def _resolved(value: object, contents: Path) -> Any:
    if isinstance(value, Mapping):
        return {name: _resolved(item, contents) for name, item in value.items()}
    if isinstance(value, list):
        return [_resolved(item, contents) for item in value]
    return resolved(value, contents) if isinstance(value, str) else value


def _inputs(cell: Cell, contents: Path) -> RecordedInputs:
    if not cell.condition.inputs:
        return RecordedInputs({}, None)
    with np.load(contents / cell.condition.inputs / INPUTS, allow_pickle=False) as file:
        return RecordedInputs(
            {name.removeprefix('command_'): ReplayDriver(file[name]) for name in file.files
             if name.startswith('command_')}, file['intervals_s'])


def compute_cell(cell: Cell, contents: Path) -> CellRows:
    """
    Run and measure a cell.

    :return: its rows as JSON-compatible values: `cell`, `vehicles`, `work`.
    :raises InputError: if a part of it cannot be used.
    """
    computed_s = time.process_time()
    result = run_cell(cell, contents)
    contacts = contacts_of(result)
    run = Run(cell.key, result=result,
              scoring='all' if cell.condition.commonroad_scores else 'drives')
    run.id = cell.key
    vehicles = vehicle_rows(run, result, contacts)
    durations_s = [time_s for record in result.planners.values()
                   for time_s in record.statistics.durations_s]
    return {
        'cell': outcome_of(result, contacts) | _failure(result.planners),
        'vehicles': vehicles,
        'work': {
            'computing_s': time.process_time() - computed_s,
            'peak_bytes': resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024,
            **({} if not durations_s else {'plan_p50_s': float(np.median(durations_s)),
                                           'plan_max_s': max(durations_s)})}}


def _failure(planners: Mapping[str, PlannerRecord]) -> dict[str, object]:
    """Return failures of planners; the cell fails if one of them never sent a plan that counts."""
    told: dict[str, object] = {}
    for vehicle, record in planners.items():
        plans, statistics = record.statistics.plans, record.statistics
        # Without numbers, so that a summary can count them over all cells.
        failed, refused = ({kind_of(reason): number
                            for reason, number in statistics.reasons.items()
                            if bool(_CODE_FAILED.match(reason)) is is_failure}
                           for is_failure in (True, False))
        if record.counters.refused:
            refused[record.counters.last_refusal] = record.counters.refused
        for reasons, what in ((failed, 'its planner failed in {} plans'),
                              (refused, '{} plans of its planner were refused')):
            if reasons and 'reason' not in told:
                count = what.format(f'{sum(reasons.values())} of {plans}')
                told |= {'reason': f'{vehicle}: {count}: {max(reasons, key=reasons.__getitem__)}',
                         'traceback': statistics.failure}
        if plans and sum(failed.values()) + sum(refused.values()) >= plans:
            told['status'] = ('refused' if not failed else
                              'memory' if any('MemoryError' in reason for reason in failed)
                              else 'error')
    return told
