# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The study file: participants, pages, questions and trials of an experiment."""

import calendar
from dataclasses import dataclass
from datetime import date
from pathlib import Path
from typing import Annotated, ClassVar, Literal

from crgame_ros.errors import InputError
from crgame_ros.schema.declaration import Form
from crgame_ros.schema.marks import Folder, Keyed, Listed, Within, Wording
from crgame_ros.schema.reading import read
from crgame_ros.study.answer_condition import Exclusion
from crgame_ros.study.elsewhere import Elsewhere
from crgame_ros.study.groups import Groups
from crgame_ros.study.local_text import BESIDE, check_known, LocalText, MarkdownFile, Name, Text
from crgame_ros.study.planned_analysis import Comparison, PlannedAnalysis
from crgame_ros.study.quality import QualityBounds
from crgame_ros.study.question import check_conditions, Question
from crgame_ros.study.staircase import Staircase, StopRule, Success
from crgame_ros.study.trial_order import OrderKind
from crgame_ros.study.trial_settings import Factor, NOTHING, TrialSettings
from crgame_ros.yaml_text import read_yaml


@dataclass(frozen=True)
class Retention:
    """
    The time for which a participant's data may be kept: one of two.

    :param until: a date, the last day.
    :param months: after the last entry of the participant's session.
    """

    until: Annotated[str, Wording('[0-9]{4}-[0-9]{2}-[0-9]{2}',
                                  'give a date such as 2030-12-31')] | None = None
    months: Annotated[int, Within(1, 1200)] | None = None

    def check(self) -> None:
        """Refuse none or both, and a day that no calendar has."""
        if (self.until is None) == (self.months is None):
            raise InputError('has not one of "until" and "months"', '', 'give one of them')
        try:
            self.last_day(date.min)
        except ValueError as error:
            raise InputError(f'is {self.until}, which is no date', 'until',
                             'give a date such as 2030-12-31') from error

    def last_day(self, session: date) -> date:
        """
        Return the last day on which the data of a session may be kept.

        :param session: day of its last entry.
        """
        if self.until is not None:
            return date.fromisoformat(self.until)
        months = session.year * 12 + session.month - 1 + (self.months or 0)
        year, month = months // 12, months % 12 + 1
        # A month after the 31st of January is the last of February.
        return date(year, month, min(session.day, calendar.monthrange(year, month)[1]))


@dataclass(frozen=True)
class Page:
    """
    A page to read.

    :param file: Markdown; `consent.de.md` beside `consent.md` is the German version.
    :param consent: whether the participant has to agree; otherwise the study ends.
    :param version: of a consent, as people name it; it is noted with a digest of the text.
    """

    FORM: ClassVar[Form] = Form(short='file')

    file: MarkdownFile
    consent: bool = False
    version: Annotated[str, Wording(r'[^\x00-\x1f]{0,60}', 'give 60 characters at most')] = ''


@dataclass(frozen=True)
class Questions:
    """
    A questionnaire.

    :param name: of a standard one, or a YAML file beside the study's.
    """

    FORM: ClassVar[Form] = Form(short='name')

    name: Annotated[str, Wording(BESIDE, 'name a questionnaire, or a YAML file beside this one')]

    @property
    def is_file(self) -> bool:
        """Return whether it is a file beside the study's."""
        return self.name.endswith(('.yaml', '.yml'))


@dataclass(frozen=True)
class Break:
    """
    A pause.

    :param minutes: its minimum duration.
    :param text: shown to the participant.
    """

    minutes: Annotated[float, Within(0.0, 240.0)] = 0.0
    text: Text = LocalText()


@dataclass(frozen=True)
class DeviceCheck:
    """
    A check in which the participant moves every control once, as shown on the page.

    :param text: what people read.
    """

    text: Text = LocalText()


Step = Page | Questions | Break | DeviceCheck
STEPS: dict[str, type[Step]] = {
    'page': Page, 'questions': Questions, 'break': Break, 'device_check': DeviceCheck}


@dataclass(frozen=True)
class StepEntry:
    """
    A step of participants between trials.

    :param step: the step.
    :param groups: only for these groups; for all by default.
    """

    step: Annotated[Step, Keyed(STEPS, 'step')]
    groups: Annotated[tuple[str, ...], Listed(noun='group')] = ()


Steps = Annotated[tuple[StepEntry, ...], Listed(0, 50, 'step')]


@dataclass(frozen=True)
class Practice:
    """
    Practice drives before the first trial of a block.

    :param settings: of it, besides those of the study and the block.
    :param at_least: minimum number of drives.
    :param at_most: maximum number of drives, after which the block begins in any case; 0 repeats
        until one is good.
    :param seconds: time without a collision or leaving the road that makes a drive good [s]
    """

    settings: TrialSettings = NOTHING
    at_least: Annotated[int, Within(1, 50)] = 1
    at_most: Annotated[int, Within(0, 50)] = 3
    seconds: Annotated[float, Within(0.0, 3600.0)] = 10.0

    def check(self) -> None:
        """Refuse a maximum number below the minimum."""
        if 0 < self.at_most < self.at_least:
            raise InputError('"at_most" is below "at_least"', '', 'give more, or 0')


@dataclass(frozen=True)
class Block:
    """
    Trials that belong together.

    :param name: of it.
    :param factors: names of the factors whose levels are crossed; all by default.
    :param repetitions: number of drives of each condition.
    :param order: of the conditions, drawn for each repetition.
    :param sequences: equally long lists of conditions, `level` or `level/level`, assigned to
        participants in turn instead.
    :param staircase: by which answers decide on the level of the next trial, instead of an order.
    :param stop: by which it ends before its last trial.
    :param settings: of its trials, besides those of the study.
    :param practice: before its first trial.
    :param before: steps before it.
    :param after_trial: steps after each trial.
    :param break_every: trials after which there is a break, 0 for none.
    :param break_minutes: minimum duration of the break.
    :param after: steps after it.
    """

    name: Name
    factors: Annotated[tuple[str, ...], Listed(noun='factor')] | None = None
    repetitions: Annotated[int, Within(1, 1000)] = 1
    order: OrderKind = 'williams'
    sequences: Annotated[tuple[tuple[str, ...], ...], Listed(noun='sequence')] = ()
    staircase: Staircase | None = None
    stop: StopRule | None = None
    settings: TrialSettings = NOTHING
    practice: Practice | None = None
    before: Steps = ()
    after_trial: Steps = ()
    break_every: Annotated[int, Within(0, 1000)] = 0
    break_minutes: Annotated[float, Within(0.0, 240.0)] = 1.0
    after: Steps = ()

    def check(self) -> None:
        """Refuse an order beside a staircase, and sessions with different numbers of trials."""
        if self.staircase is not None and (
                self.repetitions > 1 or self.order != 'williams' or self.sequences):
            raise InputError('has a staircase, and repetitions or an order of its conditions', '',
                             'leave out repetitions, order and sequences')
        if self.staircase is not None and self.stop is not None:
            raise InputError('has a staircase, which ends by its own rule', 'stop',
                             'leave it out, or give it to the staircase')
        lengths = {len(sequence) for sequence in self.sequences}
        if lengths and (0 in lengths or len(lengths) > 1):
            raise InputError('are not equally long, or empty', 'sequences',
                             'give each participant as many trials')

    @property
    def rule(self) -> Staircase | StopRule | None:
        """Return the rule by which successes decide on its trials; None without one."""
        return self.staircase or self.stop

    @property
    def judged(self) -> Success | None:
        """Return what makes its trials a success; None if nothing depends on that."""
        return None if self.rule is None else self.rule.success


@dataclass(frozen=True)
class StudyFile:
    """
    A study.

    :param name: of its folder.
    :param title: as displayed.
    :param language: of participants, unless they choose another one.
    :param languages: that participants may choose.
    :param seed: of all orders.
    :param participants: planned number, for the checks of balance.
    :param fields: questions to each participant at the start.
    :param exclude: rules that end a session.
    :param groups: a factor between participants.
    :param elsewhere: participants whom a recruiting platform sends.
    :param markers: that the experimenter can set by a key during a session.
    :param retention: until when the participants' data may be kept.
    :param quality: the bounds of data that hold, and what happens beyond them.
    :param analysis: the planned comparisons.
    :param settings: of all trials.
    :param factors: the factors of the experiment.
    :param before: steps before the first block.
    :param blocks: in the order of the file, unless another one is chosen.
    :param block_order: order of the blocks for each participant.
    :param block_sequences: lists of all blocks, assigned to participants in turn instead.
    :param after: steps after the last block.
    :param base: directory against which file names are resolved.
    """

    FORM: ClassVar[Form] = Form('see docs/studies.md for the keys')

    name: Name
    blocks: Annotated[tuple[Block, ...], Listed(1, 50, 'block', 'name')]
    title: Text = LocalText()
    language: Literal['en', 'de'] | str = 'en'
    languages: Annotated[tuple[str, ...], Listed(0, 20, 'language')] = ()
    seed: Annotated[int, Within(0, 2**63 - 1)] = 0
    participants: Annotated[int, Within(1, 10_000)] = 12
    fields: Annotated[tuple[Question, ...], Listed(0, 50, 'question', 'name')] = ()
    exclude: Annotated[tuple[Exclusion, ...], Listed(0, 50, 'rule')] = ()
    groups: Groups | None = None
    elsewhere: Elsewhere | None = None
    markers: Annotated[tuple[str, ...], Listed(0, 9, 'marker')] = ('marker',)
    retention: Retention | None = None
    quality: QualityBounds = QualityBounds()
    analysis: PlannedAnalysis = PlannedAnalysis()
    settings: TrialSettings = NOTHING
    factors: Annotated[tuple[Factor, ...], Listed(0, 10, 'factor', 'name')] = ()
    block_order: OrderKind = 'given'
    block_sequences: Annotated[tuple[tuple[str, ...], ...], Listed(noun='sequence')] = ()
    before: Steps = ()
    after: Steps = ()
    base: Annotated[Path, Folder()] = Path('.')

    def check(self) -> None:
        """Refuse what names factors, fields, questions or groups that are not there."""
        for block in self.blocks:
            if block.name in ('before', 'after'):
                raise InputError('has the name of the steps around all blocks',
                                 f'blocks: {block.name}', 'give it another name')
            for name in block.factors or ():
                check_known('factor', name, (factor.name for factor in self.factors),
                            f'blocks: {block.name}')
            if block.staircase is not None:
                block.staircase.check_factor(self.factors_of(block), f'blocks: {block.name}')
        names = [block.name for block in self.blocks]
        for number, sequence in enumerate(self.block_sequences):
            if sorted(sequence) != sorted(names):
                raise InputError('does not have each block once', f'block_sequences[{number}]',
                                 f'name {", ".join(names)}')
        check_conditions(self.fields, are_fields=True)
        self._check_groups()
        for number, rule in enumerate(self.exclude):
            if rule.when is not None and rule.when.field is not None:
                check_known('field', rule.when.field, (field.name for field in self.fields),
                            f'exclude[{number}]')
        self.analysis.check_factors(self.all_factors, self.between)
        self._check_compared()

    def _check_compared(self) -> None:
        """Refuse a comparison of trials that only staircases have: answers chose their levels."""
        for number, comparison in enumerate(self.analysis.comparisons):
            if not self.compared_blocks(comparison.factor):
                raise InputError(f'is of {comparison.factor}, which only blocks with a staircase '
                                 'have', f'analysis: comparisons[{number}]',
                                 'leave it out: answers choose the levels of their trials')

    def compared_blocks(self, factor: str) -> tuple[Block, ...]:
        """Return the blocks whose trials a comparison of a factor, or of the groups, uses."""
        return tuple(block for block in self.blocks if block.staircase is None and (
            factor == self.between or factor in {each.name for each in self.factors_of(block)}))

    def _check_groups(self) -> None:
        """Refuse groups that fields cannot form, and steps of groups that are not known there."""
        names = () if self.groups is None else self.groups.names
        if self.groups is not None:
            self.groups.check_fields({field.name: field for field in self.fields})
            if self.groups.name in {factor.name for factor in self.factors}:
                raise InputError(f'has the name of the factor "{self.groups.name}"', 'groups',
                                 'give it its own name')
        for number, entry in enumerate(self.before):
            if entry.groups:
                raise InputError('is only for some groups, which are not known yet',
                                 f'before[{number}]', 'put it into "before" of the first block')
        for entry in self.step_entries:
            for name in entry.groups:
                if name not in names:
                    raise InputError(f'names the group "{name}", which is not there', 'a step',
                                     f'name {", ".join(names) or "none: there are no groups"}')

    @property
    def step_entries(self) -> tuple[StepEntry, ...]:
        """Return the steps between drives: those around all blocks, then those of each."""
        return (*self.before, *self.after, *(entry for block in self.blocks for entry in (
            *block.before, *block.after_trial, *block.after)))

    @property
    def is_adaptive(self) -> bool:
        """Return whether the length of a session depends on successes."""
        return any(block.judged is not None for block in self.blocks)

    @property
    def staircases(self) -> dict[str, Staircase]:
        """Return the staircases by the names of their blocks."""
        return {block.name: block.staircase for block in self.blocks
                if block.staircase is not None}

    @property
    def all_factors(self) -> tuple[Factor, ...]:
        """Return the factors within participants, and the one between them."""
        return (*self.factors, *((self.groups.factor,) if self.groups is not None else ()))

    def pairs_of(self, comparison: Comparison) -> tuple[tuple[str, str], ...]:
        """Return the pairs of levels, or groups, that a planned comparison compares."""
        return comparison.pairs(next(factor for factor in self.all_factors
                                     if factor.name == comparison.factor))

    @property
    def between(self) -> str | None:
        """Return the name of the factor between participants; None without one."""
        return None if self.groups is None else self.groups.name

    @property
    def group_names(self) -> tuple[str, ...]:
        """Return the names of the groups; one empty name in a study without groups."""
        return ('',) if self.groups is None else self.groups.names

    def group_settings(self, group: str) -> TrialSettings:
        """Return the settings of a group; none if its name is empty."""
        if self.groups is None or not group:
            return NOTHING
        return next(level.settings for level in self.groups.levels if level.name == group)

    def title_in(self, language: str) -> str:
        """Return the title in a language; the name of a study without one."""
        return self.title.in_language(language) or self.name

    @property
    def all_languages(self) -> tuple[str, ...]:
        """Return the languages that participants can choose, that of the study first."""
        return tuple(dict.fromkeys((self.language, *self.languages)))

    def factors_of(self, block: Block) -> tuple[Factor, ...]:
        """Return the factors that are crossed in a block, in the order of the file."""
        return tuple(factor for factor in self.factors
                     if block.factors is None or factor.name in block.factors)


def load_study(path: Path) -> StudyFile:
    """
    Read a study file.

    :raises InputError: naming the file, the key and the remedy.
    """
    return read(StudyFile, read_yaml(path, 'study'), str(path), path.parent)
