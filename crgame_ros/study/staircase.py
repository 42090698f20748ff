# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Staircases: rules by which successes decide on the level of the next trial, or end a block."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from itertools import pairwise
import random
import statistics
from typing import Annotated, ClassVar, Literal

from crgame_ros.errors import InputError
from crgame_ros.schema.marks import Listed, Within, Wording
from crgame_ros.study.answer_condition import QuestionTest
from crgame_ros.study.local_text import ColumnName, Name
from crgame_ros.study.trial_settings import Factor

EndReason = Literal['reversals', 'at_most']
# How a drive ends: by its duration, by the own vehicle's violation, or by that of another one.
OUTCOMES = ('time', 'collision', 'off_road', 'other')


@dataclass(frozen=True)
class Success(QuestionTest):
    """
    What makes a trial a success: an answer after it, or a value of its drive.

    :param question: name of a question that follows every trial of the block.
    :param questionnaire: name of its questionnaire, if several that follow have this question.
    :param drive: instead of a question: how the drive ended, or a number of the vehicle's contacts
        or departures from the road.
    """

    ELSE: ClassVar[str] = 'drive'

    drive: Literal['outcome', 'contacts', 'departures'] | None = None

    def check(self) -> None:
        """Refuse a success of nothing, of two things, without a test, or that never comes."""
        super().check()
        if self.drive == 'outcome' and not (
                self.values and all(value in OUTCOMES for value in self.values)):
            raise InputError('tests no outcome of a drive', '',
                             f'give equals or one_of with {", ".join(OUTCOMES)}')
        if self.drive in ('contacts', 'departures') and not all(
                type(value) in (int, float) for value in self.values):
            raise InputError(f'tests {self.drive}, which are numbers, by something else', '',
                             'give numbers')

    @property
    def told(self) -> str:
        """Return it in words."""
        return self.text_of(self.question_told if self.drive is None
                            else f'{self.drive} of the drive')


@dataclass(frozen=True)
class StopRule:
    """
    When a block ends before its last trial: by successes one after the other.

    :param success: what makes a trial a success.
    :param in_a_row: number of successes.
    """

    success: Success
    in_a_row: Annotated[int, Within(1, 100)] = 3

    @property
    def told(self) -> str:
        """Return the rule in words."""
        row = 'a success' if self.in_a_row == 1 else f'{self.in_a_row} successes in a row'
        return f'ends after {row}; success: {self.success.told}'

    def ends_after(self, successes: Iterable[bool | None]) -> int | None:
        """
        Return after how many trials the block ends; None if it does not.

        :param successes: of its trials, in their order; None counts for nothing.
        """
        row = 0
        for number, success in enumerate(successes, 1):
            row = row if success is None else row + 1 if success else 0
            if row == self.in_a_row:
                return number
        return None


@dataclass(frozen=True)
class StaircaseStop:
    """
    When a staircase ends: by the first of both.

    :param reversals: number of changes of its direction.
    :param at_most: number of trials, those that were left out among them.
    """

    reversals: Annotated[int, Within(2, 100)] = 8
    at_most: Annotated[int, Within(2, 500)] = 40


@dataclass(frozen=True)
class Staircase:
    """
    An up-down rule (Levitt, Journal of the Acoustical Society of America 49:467, 1971).

    :param factor: of the block, whose levels are the steps, from easy to hard; the other factors
        of the block make a staircase of each of their combinations.
    :param success: what makes a trial a success.
    :param start: level of the first trial; the first by default.
    :param rule: N-down M-up: after N successes in a row a level harder, after M failures in a row
        a level easier.
    :param first_steps: levels to go at once until the first reversal, until the second, and so
        on; 1 afterwards. The threshold leaves these reversals out.
    :param values: numbers of the levels, for the threshold; by default the names if they are
        numbers, otherwise 1, 2, 3 …
    :param stop: when it ends.
    """

    factor: ColumnName
    success: Success
    start: Name | None = None
    rule: Annotated[str, Wording('[1-9]-down [1-9]-up',
                                 'give N-down M-up, such as 2-down 1-up')] = '2-down 1-up'
    first_steps: Annotated[tuple[int, ...], Within(1, 49), Listed(0, 10, 'step')] = ()
    values: Annotated[tuple[float, ...], Listed(0, 50, 'value')] = ()
    stop: StaircaseStop = StaircaseStop()

    def check(self) -> None:
        """Refuse an end that leaves no two reversals for the threshold."""
        if self.stop.reversals - len(self.first_steps) < 2:
            raise InputError('leaves fewer than two reversals for the threshold',
                             'stop: reversals', f'give {len(self.first_steps) + 2} or more, or '
                             'fewer first_steps')

    def check_factor(self, factors: tuple[Factor, ...], where: str) -> None:
        """
        Refuse a factor, a level or values that do not fit the factors of the block.

        :param where: name of the block.
        :raises InputError: naming the key.
        """
        factor = next((each for each in factors if each.name == self.factor), None)
        if factor is None:
            raise InputError(f'names "{self.factor}", which is no factor of the block',
                             f'{where}: staircase: factor',
                             f'name {", ".join(each.name for each in factors) or "a factor"}')
        if self.start is not None and self.start not in factor.names:
            raise InputError(f'names "{self.start}", which is no level of {factor.name}',
                             f'{where}: staircase: start', f'name {", ".join(factor.names)}')
        if self.values and len(self.values) != len(factor.levels):
            raise InputError(f'has {len(self.values)} numbers for {len(factor.levels)} levels',
                             f'{where}: staircase: values', 'give one for each level')
        signs = {(after > before) - (after < before)
                 for before, after in pairwise(self.numbers_of(factor))}
        if signs not in ({1}, {-1}):
            raise InputError('neither rise nor fall from each level to the next',
                             f'{where}: staircase: values', 'order the levels from easy to hard')

    def numbers_of(self, factor: Factor) -> tuple[float, ...]:
        """Return the numbers of the levels."""
        if self.values:
            return self.values
        if all(name.isdecimal() for name in factor.names):
            return tuple(map(float, factor.names))
        return tuple(float(number + 1) for number in range(len(factor.levels)))

    def start_of(self, factor: Factor) -> int:
        """Return the index of the first level."""
        return 0 if self.start is None else factor.names.index(self.start)

    @property
    def down(self) -> int:
        """Return after how many successes in a row the level gets harder."""
        return int(self.rule[0])

    @property
    def up(self) -> int:
        """Return after how many failures in a row the level gets easier."""
        return int(self.rule.partition(' ')[2][0])

    @property
    def told(self) -> str:
        """Return the rule in words."""
        first = '' if not self.first_steps else \
            f', first steps of {", ".join(map(str, self.first_steps))}'
        return f'staircase of {self.factor}, {self.rule} from the ' \
            f'{f"level {self.start}" if self.start else "first level"}{first}; success: ' \
            f'{self.success.told}; ends after {self.stop.reversals} reversals, or ' \
            f'{self.stop.at_most} trials'


@dataclass(frozen=True)
class StaircaseTrial:
    """
    A trial of a staircase.

    :param place: in the block, from 1 on.
    :param level: index of its level.
    :param success: None if it counts for nothing.
    :param done: whether it has finished or was left out; otherwise it is only foreseen.
    """

    place: int
    level: int
    success: bool | None
    done: bool


@dataclass(frozen=True)
class Threshold:
    """
    The threshold of a staircase.

    :param mean: of the levels at the reversals that count.
    :param sd: their standard deviation, with N - 1.
    :param reversals: number of those that count, which is even.
    """

    mean: float
    sd: float
    reversals: int


class Track:
    """
    The trials of a staircase, and what follows from them.

    :param staircase: the rule.
    :param factor: whose levels are the steps.
    :ivar numbers: of the levels.
    :ivar trials: in their order.
    :ivar level: index of the next trial's level.
    :ivar reversals: indices in `trials`: after these the direction changed.
    :ivar beyond: number of steps that an end of the scale prevented.
    """

    def __init__(self, staircase: Staircase, factor: Factor) -> None:
        self._staircase, self._last = staircase, len(factor.levels) - 1
        self.numbers = staircase.numbers_of(factor)
        self.trials: list[StaircaseTrial] = []
        self.level = staircase.start_of(factor)
        self.reversals: list[int] = []
        self.beyond = self._successes = self._failures = self._direction = 0

    def add(self, trial: StaircaseTrial) -> None:
        """Take a trial; one at another level than the next begins to count anew there."""
        if trial.level != self.level:
            # A trial before it was repeated, with another answer than when this one was driven.
            self.level, self._successes, self._failures = trial.level, 0, 0
        self.trials.append(trial)
        if trial.success is None:
            return
        self._successes = self._successes + 1 if trial.success else 0
        self._failures = 0 if trial.success else self._failures + 1
        harder = (self._successes == self._staircase.down) \
            - (self._failures == self._staircase.up)
        if harder:
            self._step(harder)

    def _step(self, harder: int) -> None:
        self._successes = self._failures = 0
        if not 0 <= self.level + harder <= self._last:
            self.beyond += 1
            return
        if self._direction == -harder:
            self.reversals.append(len(self.trials) - 1)
        self._direction = harder
        first = self._staircase.first_steps
        size = first[len(self.reversals)] if len(self.reversals) < len(first) else 1
        self.level = min(max(self.level + harder * size, 0), self._last)

    @property
    def end(self) -> EndReason | None:
        """Return why no trial follows; None if one does."""
        stop = self._staircase.stop
        if len(self.reversals) >= stop.reversals:
            return 'reversals'
        return 'at_most' if len(self.trials) >= stop.at_most else None

    @property
    def ended(self) -> EndReason | None:
        """Return why it has ended; None if trials of it are still to come."""
        return self.end if all(trial.done for trial in self.trials) else None

    @property
    def judged(self) -> list[StaircaseTrial]:
        """Return the trials that count."""
        return [trial for trial in self.trials if trial.success is not None]

    def value_of(self, trial: StaircaseTrial) -> float:
        """Return the number of a trial's level."""
        return self.numbers[trial.level]

    @property
    def threshold(self) -> Threshold | None:
        """
        Return the mean of the levels at the last even number of reversals (Levitt 1971).

        Reversals of the first steps are left out.

        :return: None with fewer than two of them.
        """
        counted = self.reversals[len(self._staircase.first_steps):]
        values = [self.value_of(self.trials[index]) for index in counted[len(counted) % 2:]]
        return Threshold(statistics.fmean(values), statistics.stdev(values), len(values)) \
            if values else None


@dataclass(frozen=True)
class ToldTrial:
    """
    What a journal tells of a trial.

    :param at: indices of the staircase and the level at which it was driven; None if it was not.
    :param success: None if it counts for nothing.
    :param done: whether it has finished or was left out, and is not to be repeated.
    """

    at: tuple[int, int] | None = None
    success: bool | None = None
    done: bool = False


def follow(staircase: Staircase, factor: Factor, count: int, seed: str,
           told: Mapping[int, ToldTrial]) -> tuple[list[Track], dict[int, tuple[int, int]]]:
    """
    Follow the staircases of a block.

    Trials that nothing is told of yet are foreseen as if they counted for nothing.

    :param count: number of staircases.
    :param seed: draws the staircase of each trial, of those that have not ended.
    :param told: by the places of the trials, from 1 on.
    :return: the tracks, and the staircase and level of each trial that is needed by its place.
    """
    tracks = [Track(staircase, factor) for _ in range(count)]
    found: dict[int, tuple[int, int]] = {}
    for place in range(1, count * staircase.stop.at_most + 1):
        trial = told.get(place, ToldTrial())
        at = trial.at
        if at is None:
            going_on = [index for index, track in enumerate(tracks) if track.end is None]
            if not going_on:
                continue
            index = random.Random(f'{seed} {place}').choice(going_on)
            at = index, tracks[index].level
        tracks[at[0]].add(StaircaseTrial(place, at[1], trial.success, trial.done))
        found[place] = at
    return tracks, found
