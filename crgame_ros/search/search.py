# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A search, from its folder: it explores, refines, estimates, and goes on where it was stopped."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

from crgame_ros.errors import CrgameError, InputError
from crgame_ros.evaluation.cell_grid import CellGrid, make_grid
from crgame_ros.evaluation.cell_process import Limits
from crgame_ros.evaluation.dask_cluster import check_workers, dask_client
from crgame_ros.evaluation.evaluation import BATCH_S, Computing
from crgame_ros.evaluation.file_names import GRID_FILE, SEARCH_FILE
from crgame_ros.evaluation.folder import EvaluationFolder
from crgame_ros.evaluation.judging import check_expectations, expectations_of, known_measure
from crgame_ros.evaluation.plan import EvaluationPlan, parse_plan, PlannerChoice
from crgame_ros.evaluation.results.parts import ResultParts
from crgame_ros.game.expectation import Expectation
from crgame_ros.game.file import load_game
from crgame_ros.schema.writing import write
from crgame_ros.search.boundary import Boundary, can_learn, refine_boundary
from crgame_ros.search.explore import explore
from crgame_ros.search.probability import estimate, FailureProbability
from crgame_ros.search.settings import BOUNDARY, PROBABILITY, SearchSettings, SMALLEST
from crgame_ros.search.smallest import shrink
from crgame_ros.search.trials import Outcome, Trials
from crgame_ros.simulation.av_assignment import OWN
from crgame_ros.variation.space import space_of, VariantSpace


@dataclass(frozen=True)
class SearchResult:
    """
    What a search found.

    :param settings: of the search.
    :param space: of the variants.
    :param expectations: what a run had to keep.
    :param outcomes: of all variants, in the order in which they were chosen.
    :param phases: name and number of runs of each part.
    :param smallest: the failure nearest to the game as it is; None without failures.
    :param probability: of a failure; None if it was not estimated.
    :param boundary: between failures and others; None if there are not both.
    """

    settings: SearchSettings
    space: VariantSpace
    expectations: tuple[Expectation, ...]
    outcomes: tuple[Outcome, ...]
    phases: tuple[tuple[str, int], ...]
    smallest: Outcome | None
    probability: FailureProbability | None
    boundary: Boundary | None

    @property
    def failures(self) -> list[Outcome]:
        """Return the failing variants, the worst first."""
        signs = [goal.sign for goal in self.settings.goals]
        return sorted((outcome for outcome in self.outcomes if outcome.is_failure),
                      key=lambda outcome: (*((value is None, sign * (value or 0.0)) for sign, value
                                             in zip(signs, outcome.values, strict=True)),
                                           outcome.number))


# Called with the name of each part as it begins; with an outcome, and whether it was run now.
Began = Callable[[str, int], object]
Told = Callable[[Outcome, bool], object]


def begin(settings: SearchSettings, folder: Path) -> None:
    """
    Check everything that a search names, and copy its files into its folder.

    :raises InputError: if anything cannot be used, or another search is in the folder.
    """
    there = (folder / GRID_FILE).exists()
    if there and not (folder / SEARCH_FILE).exists():
        raise InputError('an evaluation is in it', str(folder), 'name another --out')
    path = Path(settings.game)
    game = load_game(path)
    check_expectations(game, str(path))
    for goal in settings.goals:
        known_measure(goal.measure, f'--{"minimise" if goal.sign > 0 else "maximise"}')
    space_of(write(game, game.base), str(path)).check(game.base, str(path))
    place = EvaluationFolder(folder)
    choice = PlannerChoice(settings.planner or OWN, options=dict(settings.options))
    plan = EvaluationPlan(games=(str(path.resolve()),), planners=(choice,), seeds=[game.seed])
    if there:
        settings.write(folder)
    grid = make_grid(plan, place.store)
    if not there:
        place.begin(plan, grid)
        settings.write(folder)
    elif _without_variants(place.grid()) != grid:
        raise InputError('its game, its planner or crgame_ros has changed since', str(folder),
                         'search again in another folder: --out')


def run_search(folder: Path, computing: Computing, began: Began, told: Told) -> SearchResult:
    """
    Run a search, or go on with it; runs that are in its folder are not run again.

    :param folder: of a search that has begun.
    :param computing: settings of the computation.
    :raises InputError: if the folder cannot be used.
    :raises CrgameError: if the scheduler is lost; what was finished is kept.
    """
    settings = SearchSettings.read(folder)
    place = EvaluationFolder(folder)
    plan = parse_plan(place.plan_values(), str(folder), place.base)
    grid = _without_variants(place.grid())
    values = grid.scenes[0].values
    space = space_of(values, settings.game)
    expectations = expectations_of(values, settings.game)
    limits = Limits(computing.timeout_s, computing.memory_bytes, BATCH_S)
    with ResultParts(folder, computing.part_cells) as parts, \
            dask_client(computing.scheduler, computing.workers, computing.dashboard) as client:
        check_workers(client)
        trials = Trials(settings, expectations, place, plan, grid, parts, client, limits, told)
        phases = []
        smallest, probability = None, None
        parts_of_budget: tuple[tuple[str, float], ...] = (
            ('boundary', BOUNDARY), ('smallest change', SMALLEST), ('probability', PROBABILITY))
        later = sum(settings.share(share) for _, share in parts_of_budget)
        began('exploration', settings.budget - later)
        explore(space, trials, settings, settings.budget - later)
        phases.append(('exploration', len(trials.outcomes)))
        for name, share in parts_of_budget:
            runs, before = settings.share(share), len(trials.outcomes)
            if not runs:
                continue
            began(name, runs)
            if name == 'boundary':
                refine_boundary(space, trials, settings, runs)
            elif name == 'smallest change':
                smallest = shrink(space, trials, settings, runs)
            else:
                probability = estimate(space, trials, settings, runs)
            phases.append((name, len(trials.outcomes) - before))
        parts.join_parts()
    if not trials.known:
        first = trials.outcomes[0] if trials.outcomes else None
        raise CrgameError('no variant could be run'
                          + (f': {first.reason}' if first is not None else ''))
    return SearchResult(
        settings, space, expectations, tuple(trials.outcomes), tuple(phases),
        smallest, probability,
        Boundary(space, trials.known) if can_learn(trials.known) else None)


def _without_variants(grid: CellGrid) -> CellGrid:
    return replace(grid, scenes=tuple(replace(scene, variants=()) for scene in grid.scenes))
