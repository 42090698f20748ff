# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Runs a case of a test, and judges it."""

from dataclasses import replace
from pathlib import Path
import time

from crgame_ros.analysis.runs.run import Run
from crgame_ros.errors import CrgameError
from crgame_ros.evaluation.judging import check_expectations, columns_of, shortfalls
from crgame_ros.evaluation.results.cell_rows import vehicle_rows
from crgame_ros.game.expectation import Expectation
from crgame_ros.game.game import Game, load_game
from crgame_ros.scenario.loading import load_scenario
from crgame_ros.simulation.av_assignment import adapt_game
from crgame_ros.simulation.contacts import contacts_of
from crgame_ros.simulation.offline import run_offline
from crgame_ros.simulation.setup import build_setup
from crgame_ros.verdict.cases import Case, CaseResult


def run_case(case: Case, out: Path) -> CaseResult:
    """
    Run a case, and judge it.

    :param out: folder for the reports and recordings of runs that break an expectation.
    """
    began = time.perf_counter()
    expectations: tuple[Expectation, ...] = ()
    try:
        game = load_game(case.file)
        expectations = game.expect
        check_expectations(game, str(case.file))
        game = _adapted(game, case)
        result = run_offline(build_setup(game), keep_messages=True)
        run = Run(case.name, result=result, scoring='drives')
        rows = vehicle_rows(run, result, contacts_of(result), [
            column for each in expectations for column in columns_of(each.measure)])
        broken = tuple(tuple(shortfalls(each, rows)) for each in expectations)
        folder = None
        if any(broken):
            # Imported here: it draws.
            from crgame_ros.analysis.report.run_files import write_run_files
            folder = out / '-'.join((
                case.game.stem, str(case.seed), *(case.copy[:1] if case.copy else ())))
            folder.mkdir(parents=True, exist_ok=True)
            write_run_files(run, result, game, folder)
    except CrgameError as error:
        return CaseResult(case, expectations, (), str(error), time.perf_counter() - began)
    return CaseResult(case, expectations, broken, '', time.perf_counter() - began, folder)


def _adapted(game: Game, case: Case) -> Game:
    """Return the game with the seed and the planner of a case."""
    if case.planner is not None:
        game = adapt_game(game, load_scenario(game.scenario), seed=case.seed,
                          planner=case.planner, options=dict(case.options))
    return replace(game, seed=case.seed)
