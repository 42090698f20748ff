# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Checks a study before its first session: missing files, balance, and drivable conditions."""

from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from itertools import pairwise, product
from typing import Literal

from crgame_ros.errors import CrgameError
from crgame_ros.game.game import parse_game
from crgame_ros.instruments.extra import require_instruments
from crgame_ros.simulation.offline import run_offline
from crgame_ros.simulation.setup import build_setup
from crgame_ros.study.answer_condition import AnswerCondition, AnswerTest
from crgame_ros.study.file import Break, DeviceCheck, Page, Questions, StudyFile
from crgame_ros.study.followed_session import judged_by, judging_question
from crgame_ros.study.local_text import LocalText
from crgame_ros.study.question import ChoiceQuestion, Question
from crgame_ros.study.questionnaire import page_file, scale_of, steps_of
from crgame_ros.study.session_script import (
    drives_of,
    Fields,
    members_of,
    PracticeDrives,
    session_of,
    SessionItem,
)
from crgame_ros.study.trial_game import trial_game
from crgame_ros.study.trial_order import rows_of
from crgame_ros.study.trial_plan import (
    block_rows,
    blocks_of,
    conditions_of,
    plan_trials,
    PlannedTrial,
)
from crgame_ros.study.trial_settings import TrialSettings
import yaml

# Simulated time of a checked trial [s].
TRIED_S = 1.0
# Rough times for reading a page, answering a question and checking the controls [s].
PAGE_S, QUESTION_S, DEVICE_S = 60.0, 7.0, 45.0


@dataclass(frozen=True)
class StudyFinding:
    """
    A finding about a study.

    :param kind: an `error` is met by participants, or stops the study before them.
    :param text: one line for the user.
    """

    kind: Literal['error', 'warning']
    text: str


@dataclass(frozen=True)
class SessionLength:
    """
    The length of a participant's session.

    :param driving_s: maximum driving time, with the maximum numbers of practice drives and of
        trials of staircases.
    :param else_s: approximate time for everything else.
    """

    driving_s: float
    else_s: float


def check_study(study: StudyFile,
                progress: Callable[[float], object] = lambda _: None) -> list[StudyFinding]:
    """
    Check everything that a study names, and drive a second of each of its conditions.

    :param progress: called with the share that is done, 0 to 1.
    """
    found = [*_steps(study), *_conditions_on_answers(study), *_together(study),
             *_successes(study), *_balance(study)]
    drives = list(drives_of(study))
    tasks: set[str] = set()
    for number, (name, settings) in enumerate(drives):
        try:
            tasks |= _try(settings)
        except CrgameError as error:
            found.append(StudyFinding('error', f'{name}: {error}'))
        progress((number + 1) / len(drives))
    unknown = {name for _, settings in drives for name in settings.labels or {}} - tasks
    found += [StudyFinding('warning', f'labels: {name}: no drive has this task')
              for name in sorted(unknown)]
    return found


def length_of(study: StudyFile) -> SessionLength:
    """
    Estimate the length of a session; of the longest, if groups differ.

    :raises InputError: if the study cannot be planned, or a drive has no end.
    """
    return max((_length(study, group) for group in study.group_names),
               key=lambda each: each.driving_s + each.else_s)


def _length(study: StudyFile, group: str) -> SessionLength:
    driving_s = else_s = 0.0
    for item in session_of(study, 0, group):
        what = item.what
        if isinstance(what, PlannedTrial):
            driving_s += _duration_s(what.condition.settings)
        elif isinstance(what, PracticeDrives):
            times = what.practice.at_most or 2 * what.practice.at_least
            driving_s += times * _duration_s(what.settings)
        else:
            else_s += _reading_s(study, item)
    return SessionLength(driving_s, else_s)


def _reading_s(study: StudyFile, item: SessionItem) -> float:
    what = item.what
    if isinstance(what, Break):
        return 60.0 * what.minutes
    if isinstance(what, Page):
        return PAGE_S
    if isinstance(what, Fields):
        return QUESTION_S * len(study.fields)
    if isinstance(what, Questions):
        return QUESTION_S * len(scale_of(study, what).questions)
    return DEVICE_S


def _duration_s(settings: TrialSettings) -> float:
    duration_s = trial_game(settings, 'idle').duration
    return duration_s if duration_s < float('inf') else 0.0


def _try(settings: TrialSettings) -> set[str]:
    """Simulate the start of a trial without a driver; return the names of its tasks."""
    game = trial_game(settings, 'idle')
    # Read it as the run will, so that the combination of several files is checked.
    game = parse_game(yaml.safe_load(game.dump()), 'game of the trial', game.base)
    if game.instruments is not None:
        require_instruments(game.instruments)
    run_offline(build_setup(game), duration_s=min(TRIED_S, game.duration))
    if game.duration == float('inf'):
        raise CrgameError('has no end: give "duration" to the game or to the study')
    return {task.name for task in game.tasks}


def _steps(study: StudyFile) -> Iterator[StudyFinding]:
    yield from _untold(study, 'title', (study.title,))
    for question in study.fields:
        yield from _untold(study, f'fields: {question.name}', question.texts)
    # A questionnaire that comes after several trials is one finding.
    for step in dict.fromkeys(steps_of(study)):
        if isinstance(step, Page):
            yield from _page(study, step)
        elif isinstance(step, Questions):
            try:
                scale = scale_of(study, step)
            except CrgameError as error:
                yield StudyFinding('error', str(error))
                continue
            yield from _untold(study, step.name, (scale.title, scale.text, *(
                text for question in scale.questions for text in question.texts)))
        elif isinstance(step, Break | DeviceCheck):
            yield from _untold(study, 'the text of a break or of the check of the controls',
                               (step.text,))


def _page(study: StudyFile, page: Page) -> Iterator[StudyFinding]:
    """Yield the languages without a page; the first one may have the file without a language."""
    for place, language in enumerate(study.all_languages):
        file = page_file(study, page, language)
        if file is None:
            yield StudyFinding('error', f'{study.base / page.file}: there is no such page')
            return
        if place and file == study.base / page.file:
            yield StudyFinding('warning', f'{page.file}: has no "{language}" version beside it, '
                                          f'{file.with_suffix(f".{language}.md").name}')


def _untold(study: StudyFile, name: str,
            texts: tuple[LocalText, ...]) -> Iterator[StudyFinding]:
    """Yield the languages in which some text is missing, so that another language is shown."""
    for language in study.all_languages:
        if any(text.lacks(language) for text in texts):
            yield StudyFinding('warning', f'{name}: has no texts in "{language}"')


def _conditions_on_answers(study: StudyFile) -> Iterator[StudyFinding]:
    """Yield what conditions on answers name that nobody is asked."""
    fields = {field.name: field for field in study.fields}
    scales: dict[str, dict[str, Question]] = {}
    for step in dict.fromkeys(steps_of(study)):
        with suppress(CrgameError):
            if isinstance(step, Questions):
                scale = scale_of(study, step)
                scales[scale.name] = {question.name: question for question in scale.questions}
    for scale_name, questions in scales.items():
        for question in questions.values():
            if question.when is not None:
                yield from _untestable(f'{scale_name}: {question.name}: when', question.when,
                                       questions if question.when.field is None else fields)
    for field in study.fields:
        if field.when is not None:
            yield from _untestable(f'fields: {field.name}: when', field.when, fields)
    for number, rule in enumerate(study.exclude):
        when = rule.when
        if when is not None:
            yield from _untestable(
                f'exclude[{number}]', when, fields if when.field is not None
                else scales.get(when.questionnaire or '', {}))
        elif not any(question.expect is not None for questions in (fields, *scales.values())
                     for question in questions.values()):
            yield StudyFinding('error', f'exclude[{number}]: no question has an expected answer')


def _successes(study: StudyFile) -> Iterator[StudyFinding]:
    """Yield why no trial of a block that is ruled by successes can be one."""
    for block in study.blocks:
        if block.judged is None:
            continue
        try:
            judging = judging_question(study, block)
        except CrgameError as error:
            yield StudyFinding('error', str(error))
            continue
        if judging is not None:
            where = f'blocks: {block.name}: {judged_by(block)}: success'
            yield from _impossible(where, block.judged, judging[1])
            if not judging[1].required:
                yield StudyFinding('warning', f'{where}: "{judging[1].name}" may be left open: '
                                              'such a trial counts for nothing')


def _untestable(where: str, when: AnswerCondition,
                known: Mapping[str, Question]) -> Iterator[StudyFinding]:
    """Yield why a condition can never hold: its question is not there, or takes no such answer."""
    name = when.field or when.question or ''
    if name not in known:
        yield StudyFinding('error', f'{where}: "{name}" is asked nowhere; name '
                           f'{", ".join(known) or "a question that is asked"}')
        return
    yield from _impossible(where, when, known[name])


def _impossible(where: str, when: AnswerTest, question: Question) -> Iterator[StudyFinding]:
    """Yield which tests of an answer can never hold, since the question takes no such answer."""
    name, kind = question.name, question.kind
    for value in when.values:
        given: object = value
        if isinstance(kind, ChoiceQuestion):
            given = [str(value)] if kind.several else str(value)
        if refusal := kind.refusal(given):
            yield StudyFinding('error', f'{where}: {value} is no answer to "{name}"; {refusal}')
    if (when.at_least is not None or when.below is not None) and not hasattr(kind, 'bounds'):
        yield StudyFinding('error', f'{where}: "{name}" has no numbers')


def _together(study: StudyFile) -> Iterator[StudyFinding]:
    try:
        members = members_of(study)
    except CrgameError as error:
        yield StudyFinding('error', str(error))
        return
    if members > 1 and study.participants % members:
        yield StudyFinding('warning', f'seats: {study.participants} participants do not make '
                                      f'whole groups of {members}, who drive together')
    if members > 1 and study.analysis.comparisons:
        yield StudyFinding('warning', 'seats: the planned tests take each participant as one of '
                                      'their own, and those who drive together are not')


def _balance(study: StudyFile) -> Iterator[StudyFinding]:
    groups = study.group_names
    members = max(len(settings.seats or ('',)) for _, settings in drives_of(study))
    places = study.participants // (len(groups) * members)
    if study.participants % len(groups):
        yield StudyFinding('warning', f'groups: {study.participants} participants do not make '
                                      f'{len(groups)} groups of equal size')
    for group in groups if len(study.blocks) > 1 and (
            study.block_order != 'given' or study.block_sequences) else ():
        yield from _unbalanced(
            f'blocks in {group}' if group else 'blocks', 'block', len(study.blocks),
            [[block.name for block in blocks_of(study, place, group)] for place in range(places)],
            len(study.blocks), 'block_order',
            '' if study.block_sequences else study.block_order, block_rows(study))
    for block, group in product(study.blocks, groups):
        if block.staircase is not None:
            continue
        try:
            orders = [[trial.condition.name for trial in plan_trials(study, place, group)
                       if trial.block == block.name] for place in range(places)]
        except CrgameError as error:
            yield StudyFinding('error', str(error))
            continue
        conditions = len(conditions_of(study, block))
        if conditions > 1:
            yield from _unbalanced(
                f'{block.name} in {group}' if group else block.name, 'condition', conditions,
                orders, len(block.sequences[0]) if block.sequences else conditions, 'order',
                '' if block.sequences else block.order,
                block_rows(study) * rows_of(block.order, conditions))


def _unbalanced(name: str, noun: str, count: int, orders: list[list[str]], length: int, key: str,
                kind: str, rows: int) -> Iterator[StudyFinding]:
    """
    Yield how the orders of conditions or blocks are not balanced over participants.

    :param noun: of one: condition or block.
    :param count: number of them.
    :param orders: of each participant, in repetitions of one `length`.
    :param key: of the order in the file.
    :param kind: of the order; empty for sequences of the file.
    :param rows: multiples of so many participants are balanced.
    """
    first = Counter(order[0] for order in orders)
    if len(first) < count or len(set(first.values())) > 1:
        mend = f'take a multiple of {rows} participants' if kind == 'williams' \
            else f'take "{key}: williams"'
        yield StudyFinding('warning', f'{name}: with {len(orders)} participants not every {noun} '
                                      f'is first equally often; {mend}')
    # Of successive ones that differ, within each repetition.
    follows = Counter(
        pair for order in orders for start in range(0, len(order), length)
        for pair in pairwise(order[start:start + length]) if pair[0] != pair[1])
    if len(follows) < count * (count - 1) or len(set(follows.values())) > 1:
        yield StudyFinding('warning', f'{name}: not every {noun} follows every other equally '
                                      'often')
