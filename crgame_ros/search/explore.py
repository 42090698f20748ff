# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Explores the space of variants with Optuna's samplers."""

import math
from typing import Any
import warnings

from crgame_ros.search.settings import SearchSettings
from crgame_ros.search.trials import Outcome, Trials
from crgame_ros.variation.space import VariantSpace

# Points asked for until one keeps the constraints.
_ASKED = 100
# Variants that are chosen by chance before there is something to learn from.
_STARTUP = 8
# Candidates among which TPE takes the best; its default of 24 needs half as many runs again.
_CANDIDATES = 96


def explore(space: VariantSpace, trials: Trials, settings: SearchSettings, runs: int) -> None:
    """
    Run variants that a sampler chooses, the game as it is first.

    A batch is chosen before any of it is run, so that the variants do not depend on the order in
    which runs end.

    :param runs: number of runs.
    """
    import optuna
    optuna.logging.set_verbosity(optuna.logging.ERROR)
    with warnings.catch_warnings():
        warnings.simplefilter('ignore')
        study = optuna.create_study(sampler=_sampler(settings),
                                    directions=['minimize'] * len(settings.goals))
        _Exploration(study, space, trials, settings).run(runs)


def _sampler(settings: SearchSettings) -> Any:
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

    def __init__(self, study: Any, space: VariantSpace, trials: Trials,
                 settings: SearchSettings) -> None:
        from optuna.distributions import CategoricalDistribution, FloatDistribution
        from optuna.trial import TrialState
        self._study, self._space, self._trials = study, space, trials
        self._settings = settings
        self._failed = TrialState.FAIL
        self._axes = {axis.name: CategoricalDistribution(range(len(axis.spec.values)))
                      if axis.spec.values else FloatDistribution(0.0, 1.0)
                      for axis in space.axes}

    def run(self, runs: int) -> None:
        end = len(self._trials.outcomes) + runs
        self._enqueue_nominal()
        while (count := min(self._settings.batch, end - len(self._trials.outcomes))) > 0:
            before = len(self._trials.outcomes)
            asked = [self._ask() for _ in range(count)]
            outcomes = self._trials.run(variant for _, variant in asked)
            for (trial, _), outcome in zip(asked, outcomes, strict=False):
                self._tell(trial, outcome)
            if len(self._trials.outcomes) == before:
                # All of them were run before: the sampler has nothing new, as in a small space.
                break

    def _enqueue_nominal(self) -> None:
        space = self._space
        if space.is_allowed(space.nominal):
            shares = dict(zip(space.names, space.point(space.nominal), strict=True))
            self._study.enqueue_trial({
                axis.name: int(shares[axis.name] * len(axis.spec.values)) if axis.spec.values
                else float(shares[axis.name]) for axis in space.axes})

    def _ask(self) -> tuple[Any, dict[str, object]]:
        for _ in range(_ASKED):
            trial = self._study.ask(self._axes)
            variant = self._space.variant([
                (trial.params[axis.name] + 0.5) / len(axis.spec.values) if axis.spec.values
                else trial.params[axis.name] for axis in self._space.axes])
            if self._space.is_allowed(variant):
                break
            self._study.tell(trial, state=self._failed)
        return trial, variant

    def _tell(self, trial: Any, outcome: Outcome) -> None:
        if not outcome.is_known:
            self._study.tell(trial, state=self._failed)
            return
        # Where no AV can be blamed, nothing is to be found; nor where a measure is undefined.
        self._study.tell(trial, [
            math.inf if value is None or outcome.excused else goal.sign * value
            for goal, value in zip(self._settings.goals, outcome.values, strict=True)])
