# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Simulates the planned measures of a study's trials, with the effects that its plan states."""

from collections import Counter
from dataclasses import dataclass
import math
from typing import Any

from crgame_ros.errors import InputError
from crgame_ros.study.file import StudyFile
from crgame_ros.study.planned_analysis import Comparison
from crgame_ros.study.trial_plan import plan_trials, PlannedTrial
import numpy as np


@dataclass(frozen=True)
class MeasureModel:
    """
    The model of a measure: a mean of 0, effects of levels, an intercept of each participant.

    :param trial_sd: standard deviation of the trials of a participant in one condition; that of
        the participants' intercepts is the same, and no test within participants depends on it.
    :param effects: what a level adds, by factor and level; others add nothing.
    """

    trial_sd: float
    effects: dict[tuple[str, str], float]


def measure_models(study: StudyFile, effects: bool = True) -> dict[str, MeasureModel]:
    """
    Return the model of each planned measure.

    An effect in standard deviations of the participants' differences is turned into one of
    trials by the numbers of trials of the first participant: the variance of a difference of
    means of a and b trials is that of a trial times (1 / a + 1 / b).

    :param effects: whether levels have the effects that the plan states, or none.
    :raises InputError: if the comparisons of a measure state different standard deviations.
    """
    trials = plan_trials(study, 0)
    models: dict[str, MeasureModel] = {}
    measures = dict.fromkeys(each.measure for each in study.analysis.comparisons)
    for measure in measures:
        of_measure = [(number, each) for number, each in enumerate(study.analysis.comparisons)
                      if each.measure == measure]
        known = {number: sd for number, each in of_measure
                 if (sd := _trial_sd(study, each, trials)) is not None}
        trial_sd = next(iter(known.values()), 1.0)
        for number, sd in known.items():
            if not math.isclose(sd, trial_sd, rel_tol=1e-6):
                raise InputError(f'states another standard deviation of {measure} than before: '
                                 f'{sd:.4g} of a trial, not {trial_sd:.4g}',
                                 f'analysis: comparisons[{number}]: sd', 'state the same')
        added: dict[tuple[str, str], float] = {}
        for _, each in of_measure if effects else ():
            if each.effect is not None:
                second = _pair(study, each)[1]
                unit = 1.0 if each.sd is not None \
                    else trial_sd * _root(study, each, trials)
                key = each.factor, second
                added[key] = added.get(key, 0.0) + each.effect * unit
        models[measure] = MeasureModel(trial_sd, added)
    return models


def _trial_sd(study: StudyFile, comparison: Comparison,
              trials: tuple[PlannedTrial, ...]) -> float | None:
    if comparison.sd is None or comparison.sd_of == 'trial':
        return comparison.sd
    return comparison.sd / _root(study, comparison, trials)


def _root(study: StudyFile, comparison: Comparison, trials: tuple[PlannedTrial, ...]) -> float:
    """Return the standard deviation of a difference of means over that of a trial."""
    counts = Counter(dict(_levels(trial)).get(comparison.factor) for trial in trials)
    return math.sqrt(sum(1.0 / max(1, counts[level]) for level in _pair(study, comparison)))


def _pair(study: StudyFile, comparison: Comparison) -> tuple[str, str]:
    return comparison.pairs(next(factor for factor in study.factors
                                 if factor.name == comparison.factor))[0]


def _levels(trial: PlannedTrial) -> tuple[tuple[str, str], ...]:
    return tuple((factor, level.name) for factor, level in trial.condition.levels)


class SimulatedTrials:
    """
    The trials of some participants, whose measures can be drawn again and again.

    :param study: their study.
    :param participants: their number; their places are 0, 1, …
    :param models: of the measures.
    :ivar measures: names of the measures.
    :ivar participants: ids of the participants.
    :ivar rows: one for each trial, as the table of trials has them.
    """

    def __init__(self, study: StudyFile, participants: int,
                 models: dict[str, MeasureModel]) -> None:
        self._models = models
        self.measures = tuple(models)
        self.participants = tuple(f'P{place + 1:02}' for place in range(participants))
        planned = [(place, trial) for place in range(participants)
                   for trial in plan_trials(study, place)]
        self.rows: list[dict[str, Any]] = [
            {'participant': self.participants[place], 'trial': trial.number, 'block': trial.block,
             **dict(_levels(trial))} for place, trial in planned]
        self._people = np.array([place for place, _ in planned], dtype=np.intp)
        self._count = participants
        self._fixed = {measure: np.array([
            sum(model.effects.get(level, 0.0) for level in _levels(trial))
            for _, trial in planned]) for measure, model in models.items()}

    def draw(self, rng: np.random.Generator) -> list[dict[str, Any]]:
        """Draw all measures of all trials; return the rows, which the next draw overwrites."""
        for measure, model in self._models.items():
            intercepts = rng.normal(0.0, model.trial_sd, self._count)
            values = self._fixed[measure] + intercepts[self._people] \
                + rng.normal(0.0, model.trial_sd, len(self.rows))
            for row, value in zip(self.rows, values.tolist(), strict=True):
                row[measure] = value
        return self.rows
