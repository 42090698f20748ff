# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A search, from its folder: it explores, refines, estimates, and goes on where it was stopped."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
import math
from pathlib import Path
from typing import TYPE_CHECKING
import warnings

from crgame_ros.errors import CrgameError, InputError
from crgame_ros.evaluation.cell_grid import CellGrid, make_grid
from crgame_ros.evaluation.cell_process import Limits
from crgame_ros.evaluation.dask_cluster import dask_client
from crgame_ros.evaluation.evaluation import BATCH_S, Computing
from crgame_ros.evaluation.file_names import GRID_FILE, SEARCH_FILE
from crgame_ros.evaluation.folder import EvaluationFolder
from crgame_ros.evaluation.judging import check_expectations, expectations_of, known_measure
from crgame_ros.evaluation.plan import EvaluationPlan, PlannerChoice
from crgame_ros.evaluation.results.parts import ResultParts
from crgame_ros.game.expectation import Expectation
from crgame_ros.game.game import load_game
from crgame_ros.schema.writing import write
from crgame_ros.search.boundary import (
    Boundary,
    can_learn,
    estimate,
    FailureProbability,
    refine_boundary,
)
from crgame_ros.search.settings import BOUNDARY, PROBABILITY, SearchSettings, SMALLEST
from crgame_ros.search.trials import Outcome, Trials
from crgame_ros.simulation.av_assignment import OWN
from crgame_ros.variation.space import space_of, Variant, VariantSpace
import numpy as np

if TYPE_CHECKING:
    from optuna import Study, Trial
    from optuna.distributions import BaseDistribution
    from optuna.samplers import BaseSampler

# Points asked for until one keeps the constraints.
_ASKED = 100
# Batches in a row of which all variants were run before, until exploration ends.
_KNOWN = 20
# Variants that are chosen by chance before there is something to learn from.
_STARTUP = 8
# Candidates among which TPE takes the best; its default of 24 needs half as many runs again.
_CANDIDATES = 96
# Points between two variants that are run together: the interval shrinks by one more than these.
_BETWEEN = 3
# Failures that are nearest to the game as it is, from which lines are drawn to it.
_STARTS = 3


@dataclass(frozen=True)
class SearchResult:
    """
    What a search found.

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
    else:
        place.check()
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
    :raises InputError: if the folder cannot be used.
    :raises CrgameError: if the scheduler is lost; what was finished is kept.
    """
    settings = SearchSettings.read(folder)
    place = EvaluationFolder(folder)
    grid = _without_variants(place.grid())
    values = grid.scenes[0].values
    space = space_of(values, settings.game)
    expectations = expectations_of(values, settings.game)
    limits = Limits(computing.timeout_s, computing.memory_bytes, BATCH_S)
    with ResultParts(folder, computing.part_cells) as parts, \
            dask_client(computing.scheduler, computing.workers, computing.dashboard) as client:
        trials = Trials(settings, expectations, place, grid, parts, client, limits, told)
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


def explore(space: VariantSpace, trials: Trials, settings: SearchSettings, runs: int) -> None:
    """
    Run variants that a sampler chooses, the game as it is first.

    A batch is chosen before any of it is run, so that the variants do not depend on the order in
    which runs end.
    """
    import optuna
    optuna.logging.set_verbosity(optuna.logging.ERROR)
    with warnings.catch_warnings():
        warnings.simplefilter('ignore')
        study = optuna.create_study(sampler=_sampler(settings),
                                    directions=['minimize'] * len(settings.goals))
        _Exploration(study, space, trials, settings).run(runs)


def _sampler(settings: SearchSettings) -> 'BaseSampler':
    from optuna import samplers
    seed = settings.seed
    if settings.sampler == 'random':
        return samplers.RandomSampler(seed)
    if settings.sampler == 'nsga2' or len(settings.goals) > 1:
        return samplers.NSGAIISampler(seed=seed, population_size=max(settings.batch, 10))
    if settings.sampler == 'cmaes':
        return samplers.CmaEsSampler(seed=seed, n_startup_trials=_STARTUP,
                                     popsize=max(settings.batch, 5), with_margin=False)
    return samplers.TPESampler(seed=seed, n_startup_trials=_STARTUP, multivariate=True,
                               constant_liar=True, n_ei_candidates=_CANDIDATES)


class _Exploration:
    """An Optuna study in the unit cube."""

    def __init__(self, study: 'Study', space: VariantSpace, trials: Trials,
                 settings: SearchSettings) -> None:
        from optuna.distributions import CategoricalDistribution, FloatDistribution
        from optuna.trial import TrialState
        self._study, self._space, self._trials = study, space, trials
        self._settings = settings
        self._failed = TrialState.FAIL
        self._axes: dict[str, BaseDistribution] = {
            axis.name: CategoricalDistribution(range(len(axis.spec.values))) if axis.spec.values
            else FloatDistribution(0.0, 1.0) for axis in space.axes}

    def run(self, runs: int) -> None:
        end = len(self._trials.outcomes) + runs
        self._enqueue_nominal()
        known = 0
        while (count := min(self._settings.batch, end - len(self._trials.outcomes))) > 0:
            before = len(self._trials.outcomes)
            asked = [self._ask() for _ in range(count)]
            outcomes = self._trials.run(variant for _, variant in asked)
            for (trial, _), outcome in zip(asked, outcomes, strict=False):
                self._tell(trial, outcome)
            known = known + 1 if len(self._trials.outcomes) == before else 0
            if known == _KNOWN:
                # The sampler has nothing new, as in a small space.
                break

    def _enqueue_nominal(self) -> None:
        space = self._space
        if space.is_allowed(space.nominal):
            shares = dict(zip(space.names, space.point(space.nominal), strict=True))
            self._study.enqueue_trial({
                axis.name: int(shares[axis.name] * len(axis.spec.values)) if axis.spec.values
                else float(shares[axis.name]) for axis in space.axes})

    def _ask(self) -> tuple['Trial', dict[str, object]]:
        for _ in range(_ASKED):
            trial = self._study.ask(self._axes)
            variant = self._space.variant([
                (trial.params[axis.name] + 0.5) / len(axis.spec.values) if axis.spec.values
                else trial.params[axis.name] for axis in self._space.axes])
            if self._space.is_allowed(variant):
                return trial, variant
            self._study.tell(trial, state=self._failed)
        raise InputError(f'none of {_ASKED} points keeps the constraints', self._settings.game,
                         'loosen them')

    def _tell(self, trial: 'Trial', outcome: Outcome) -> None:
        if not outcome.is_known:
            self._study.tell(trial, state=self._failed)
            return
        # Where no AV can be blamed, nothing is to be found; nor where a measure is undefined.
        self._study.tell(trial, [
            math.inf if value is None or outcome.excused else goal.sign * value
            for goal, value in zip(self._settings.goals, outcome.values, strict=True)])


def shrink(space: VariantSpace, trials: Trials, settings: SearchSettings,
           runs: int) -> Outcome | None:
    """
    Search for the failure that is nearest to the game as it is.

    From the nearest failures that are known: single values are put back while it still fails, then
    the line to the game as it is is halved, then the neighbourhood is tried.

    :return: the nearest failure that is known; None without failures, or where the game as it is
        fails: then it takes no change.
    """
    end = len(trials.outcomes) + runs
    if not trials.failures \
            or not space.distance(_nearest(space, trials)[0].variant, space.nominal):
        return None
    for start in _nearest(space, trials)[:_STARTS]:
        best = _put_back(space, trials, start, end)
        _along_line(space, trials, best, end)
    rng = np.random.default_rng(settings.seed)
    while len(trials.outcomes) < end:
        before = len(trials.outcomes)
        best = _nearest(space, trials)[0]
        _around(space, trials, best, rng, end)
        if len(trials.outcomes) == before:
            break
    return _nearest(space, trials)[0]


def _nearest(space: VariantSpace, trials: Trials) -> list[Outcome]:
    return sorted(trials.failures, key=lambda outcome: (
        space.distance(outcome.variant, space.nominal), outcome.number))


def _run(space: VariantSpace, trials: Trials, variants: Sequence[Variant],
         end: int) -> list[Outcome]:
    left = max(0, end - len(trials.outcomes))
    return trials.run([variant for variant in variants if space.is_allowed(variant)][:left])


def _put_back(space: VariantSpace, trials: Trials, best: Outcome, end: int) -> Outcome:
    """Put single values back to those of the game, as long as it still fails."""
    while True:
        changed = [name for name in space.names if best.variant[name] != space.nominal[name]]
        tried = _run(space, trials, [dict(best.variant) | {name: space.nominal[name]}
                                     for name in changed], end)
        better = [outcome for outcome in tried if outcome.is_failure]
        if not better:
            return best
        best = min(better, key=lambda outcome: space.distance(outcome.variant, space.nominal))


def _along_line(space: VariantSpace, trials: Trials, best: Outcome, end: int) -> None:
    """Halve the line from a failure to the game as it is, until both ends are side by side."""
    failing, passing = space.point(best.variant), space.point(space.nominal)
    names = [axis.is_numeric for axis in space.axes]
    while len(trials.outcomes) < end and np.max(np.abs(failing - passing)) > 1e-3:
        shares = [(index + 1) / (_BETWEEN + 1) for index in range(_BETWEEN)]
        points = [point for share in shares if space.is_allowed(space.variant(
            point := np.where(names, failing + share * (passing - failing), failing)))]
        tried = _run(space, trials, [space.variant(point) for point in points], end)
        before = (failing, passing)
        for point, outcome in zip(points, tried, strict=False):
            if outcome.is_failure:
                failing = point
            else:
                passing = point
                break
        if before[0] is failing and before[1] is passing:
            return


def _around(space: VariantSpace, trials: Trials, best: Outcome, rng: np.random.Generator,
            end: int) -> None:
    """Try points that are nearer to the game as it is, near the line to the best one."""
    middle, nominal = space.point(best.variant), space.point(space.nominal)
    size = float(np.linalg.norm(middle - nominal))
    points = middle + 0.1 * size * rng.standard_normal((64, len(middle)))
    variants = [space.variant(point) for point in points.clip(0.0, 1.0)]
    reach = space.distance(best.variant, space.nominal)
    nearer = [variant for variant in variants if space.distance(variant, space.nominal) < reach]
    _run(space, trials, nearer[:8], end)
