# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Computes the power of a study's planned tests by simulated trials of the whole plan."""

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
import math

from crgame_ros.errors import InputError
from crgame_ros.study.analysis.planned_tests import planned_tests, PlannedTest
from crgame_ros.study.file import StudyFile
from crgame_ros.study.planned_analysis import Comparison
from crgame_ros.study.trial_plan import plan_trials, PlannedTrial
import numpy as np

# The power that a number of participants is to reach.
WANTED = 0.8


@dataclass(frozen=True)
class Power:
    """
    The power of a test with a number of participants.

    :param participants: their number.
    :param name: of the test: the measure, and the levels.
    :param effect: as the plan states it.
    :param found: share of the simulated studies in which the test was significant, after Holm's
        correction.
    :param low: end of Wilson's 95 % interval of this share.
    :param high: the other end.
    """

    participants: int
    name: str
    effect: str
    found: float
    low: float
    high: float


def power_of(study: StudyFile, counts: Sequence[int], runs: int, seed: int,
             progress: Callable[[float], object] = lambda _: None) -> Iterator[list[Power]]:
    """
    Yield the power of each test with a stated effect, for each number of participants.

    Comparisons without an effect are simulated without one: they are tests of the family.
    Equal arguments give equal results.

    :param counts: numbers of participants.
    :param runs: simulated studies for each.
    :param progress: called with the share that is done, 0 to 1.
    :raises InputError: if no comparison states an effect.
    """
    if all(each.effect is None for each in study.analysis.comparisons):
        raise InputError('states no effect', 'analysis: comparisons',
                         'give "effect" to at least one comparison')
    models = measure_models(study)
    columns = {factor.name: factor.name for factor in study.all_factors}
    alpha = study.analysis.alpha
    for place, count in enumerate(counts):
        trials = SimulatedTrials(study, planned_people(study, count), models)
        rng = np.random.default_rng((seed, count))
        tests: list[PlannedTest] = []
        hits: Counter[int] = Counter()
        for run in range(runs):
            tests = planned_tests(study, trials.draw(rng), columns)
            hits.update(number for number, each in enumerate(tests) if each.p_holm < alpha)
            progress((place + (run + 1) / runs) / len(counts))
        yield [Power(count, *_told(study, each), hits[number] / runs,
                     *_interval(hits[number], runs))
               for number, each in enumerate(tests) if each.comparison.effect is not None]


def _told(study: StudyFile, test: PlannedTest) -> tuple[str, str]:
    """Return the name of a test, and its stated effect."""
    comparison, (first, second) = test.comparison, test.pair
    unit = f"in the measure's unit, sd {comparison.sd:g}" if comparison.sd is not None \
        else 'sd of the participants in a group' if comparison.factor == study.between \
        else 'sd of the differences'
    side = {'two-sided': '', 'greater': ' > 0', 'less': ' < 0'}[comparison.alternative]
    return (f'{comparison.measure}, {comparison.factor}: {second} - {first}{side}',
            f'{comparison.effect:g} {unit}')


def _interval(found: int, runs: int) -> tuple[float, float]:
    from scipy.stats import binomtest
    interval = binomtest(found, runs).proportion_ci(0.95, 'wilson')
    return float(interval.low), float(interval.high)


def smallest(powers: Sequence[Sequence[Power]]) -> int | None:
    """Return the least number of participants with which every test reaches `WANTED`, if any."""
    return min((each[0].participants for each in powers
                if each and min(power.found for power in each) >= WANTED), default=None)


def power_lines(powers: Sequence[Sequence[Power]], runs: int) -> Iterator[str]:
    """Yield the lines of a table of powers, and the smallest number of participants."""
    for number, power in enumerate(powers[0] if powers else ()):
        yield f'{power.name} ({power.effect})'
        yield f'{"participants":>14} {"power":>7}   95 % interval'
        for each in powers:
            of_test = each[number]
            yield f'{of_test.participants:>14} {of_test.found:>7.3f}   ' \
                f'[{of_test.low:.3f}; {of_test.high:.3f}]'
    found = smallest(powers)
    yield f'{runs} simulated studies for each number. ' + (
        f'None of these numbers reaches a power of {WANTED:g} in every test.' if found is None
        else f'{found} participants are the fewest of these with a power of {WANTED:g} in every '
        'test.')


@dataclass(frozen=True)
class SimulatedPerson:
    """
    A participant of a simulated study.

    :param id: of the participant.
    :param place: in the orders, of the group if there are groups, from 0 on.
    :param group: of the participant; empty in a study without groups.
    """

    id: str  # noqa: A003
    place: int
    group: str = ''


def planned_people(study: StudyFile, count: int) -> list[SimulatedPerson]:
    """Return the first participants of a study, whose groups come in turn."""
    groups = study.group_names
    return [SimulatedPerson(f'P{number + 1:02}', number // len(groups),
                            groups[number % len(groups)]) for number in range(count)]


def _compared_trials(study: StudyFile, place: int, group: str) -> tuple[PlannedTrial, ...]:
    """Return the planned trials of a participant that comparisons use: none of staircases."""
    return tuple(trial for trial in plan_trials(study, place, group) if trial.staircase is None)


@dataclass(frozen=True)
class MeasureModel:
    """
    The model of a measure: a mean of 0, effects of levels, an intercept of each participant.

    :param trial_sd: standard deviation of the trials of a participant in one condition.
    :param participant_sd: that of the participants' intercepts; no test within participants
        depends on it.
    :param effects: what a level, or a group, adds, by factor and level; others add nothing.
    """

    trial_sd: float
    participant_sd: float
    effects: dict[tuple[str, str], float]


def measure_models(study: StudyFile, effects: bool = True) -> dict[str, MeasureModel]:
    """
    Return the model of each planned measure.

    An effect in standard deviations of the participants' differences is turned into one of
    trials by the numbers of trials of the first participant: the variance of a difference of
    means of a and b trials is that of a trial times (1 / a + 1 / b). The variance of the
    participants' means in a group is that of the intercepts, and of a trial over the number of
    trials. Where the plan does not state both, the intercepts vary as trials do.

    :param effects: whether levels have the effects that the plan states, or none.
    :raises InputError: if the comparisons of a measure state different standard deviations, or
        do not state its effects one after the other.
    """
    trials = _compared_trials(study, 0, study.group_names[0])
    models: dict[str, MeasureModel] = {}
    measures = dict.fromkeys(each.measure for each in study.analysis.comparisons)
    for measure in measures:
        of_measure = [(number, each) for number, each in enumerate(study.analysis.comparisons)
                      if each.measure == measure]
        within = _stated(of_measure, measure, lambda each: None if each.factor == study.between
                         else _trial_sd(study, each, trials), 'of a trial')
        between = _stated(of_measure, measure, lambda each: each.sd
                          if each.factor == study.between else None, 'in a group')
        trial_sd, participant_sd = _sds(within, between, len(trials), measure)
        group_sd = math.hypot(participant_sd, trial_sd / math.sqrt(max(1, len(trials))))
        added: dict[tuple[str, str], float] = {}
        stated: dict[tuple[str, str], tuple[str, float]] = {}
        for number, each in of_measure if effects else ():
            if each.effect is not None:
                first, second = study.pairs_of(each)[0]
                unit = 1.0 if each.sd is not None else group_sd \
                    if each.factor == study.between else trial_sd * _root(study, each, trials)
                effect = first, each.effect * unit
                stated.setdefault((each.factor, first), ('', 0.0))
                if stated.setdefault((each.factor, second), effect) != effect:
                    raise InputError(f'states the effect of {second}, which an entry before it '
                                     'has', f'analysis: comparisons[{number}]: effect',
                                     'let the second level of each contrast be a new one')
                added[each.factor, second] = added.get((each.factor, first), 0.0) + effect[1]
        models[measure] = MeasureModel(trial_sd, participant_sd, added)
    return models


def _stated(comparisons: list[tuple[int, Comparison]], measure: str,
            sd_of: Callable[[Comparison], float | None], what: str) -> float | None:
    """
    Return the one standard deviation that comparisons state; None if they state none.

    :raises InputError: if they state different ones.
    """
    known = {number: sd for number, each in comparisons if (sd := sd_of(each)) is not None}
    first = next(iter(known.values()), None)
    for number, sd in known.items():
        if first is not None and not math.isclose(sd, first, rel_tol=1e-6):
            raise InputError(f'states another standard deviation of {measure} than before: '
                             f'{sd:.4g} {what}, not {first:.4g}',
                             f'analysis: comparisons[{number}]: sd', 'state the same')
    return first


def _sds(trial_sd: float | None, group_sd: float | None, trials: int,
         measure: str) -> tuple[float, float]:
    """
    Return the standard deviations of a participant's trials, and of the intercepts.

    :param group_sd: of the participants' means in a group.
    :param trials: number of trials of a participant.
    """
    if group_sd is None:
        return trial_sd or 1.0, trial_sd or 1.0
    if trial_sd is None:
        trial_sd = group_sd / math.sqrt(1.0 + 1.0 / trials)
        return trial_sd, trial_sd
    left = group_sd ** 2 - trial_sd ** 2 / trials
    if left < 0.0:
        raise InputError(f'states that participants differ in {measure} by {group_sd:.4g}, which '
                         f'is less than their own {trials} trials let them, '
                         f'{trial_sd / math.sqrt(trials):.4g}', 'analysis: comparisons',
                         'state a greater "sd" between groups')
    return trial_sd, math.sqrt(left)


def _trial_sd(study: StudyFile, comparison: Comparison,
              trials: tuple[PlannedTrial, ...]) -> float | None:
    if comparison.sd is None or comparison.sd_of == 'trial':
        return comparison.sd
    return comparison.sd / _root(study, comparison, trials)


def _root(study: StudyFile, comparison: Comparison, trials: tuple[PlannedTrial, ...]) -> float:
    """Return the standard deviation of a difference of means over that of a trial."""
    counts = Counter(dict(trial.condition.levels).get(comparison.factor) for trial in trials)
    return math.sqrt(sum(1.0 / max(1, counts[level]) for level in study.pairs_of(comparison)[0]))


class SimulatedTrials:
    """
    The trials of some participants, whose measures can be drawn again and again.

    :ivar measures: names of the measures.
    :ivar rows: one for each trial, as the table of trials has them.
    """

    def __init__(self, study: StudyFile, people: Sequence[SimulatedPerson],
                 models: dict[str, MeasureModel]) -> None:
        self._models = models
        self.measures = tuple(models)
        self.rows: list[dict[str, object]] = []
        levels: list[dict[str, str]] = []
        numbers: list[int] = []
        for number, person in enumerate(people):
            own = {} if study.between is None else {study.between: person.group}
            for trial in _compared_trials(study, person.place, person.group):
                numbers.append(number)
                levels.append(dict(trial.condition.levels) | own)
                self.rows.append({'participant': person.id, 'trial': trial.number,
                                  'block': trial.block, **levels[-1]})
        self._people = np.array(numbers, dtype=np.intp)
        self._count = len(people)
        self._fixed = {measure: np.array([
            sum(model.effects.get(level, 0.0) for level in each.items()) for each in levels])
            for measure, model in models.items()}

    def draw(self, rng: np.random.Generator) -> list[dict[str, object]]:
        """Draw all measures of all trials; return the rows, which the next draw overwrites."""
        for measure, model in self._models.items():
            intercepts = rng.normal(0.0, model.participant_sd, self._count)
            values = self._fixed[measure] + intercepts[self._people] \
                + rng.normal(0.0, model.trial_sd, len(self.rows))
            for row, value in zip(self.rows, values.tolist(), strict=True):
                row[measure] = value
        return self.rows
