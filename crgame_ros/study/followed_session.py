# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What the answers so far decide: checks, exclusion, staircases, and ends of blocks."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

from crgame_ros.errors import InputError
from crgame_ros.study.answer_condition import Exclusion
from crgame_ros.study.file import Block, Questions, StudyFile
from crgame_ros.study.question import Answer, asked_of, Question
from crgame_ros.study.questionnaire import questionnaire_of, questions_of, scale_of
from crgame_ros.study.session_journal import done_items, JournalEntry, SessionEvent
from crgame_ros.study.session_script import Fields, SessionItem
from crgame_ros.study.staircase import ToldTrial, Track
from crgame_ros.study.trial_plan import BlockStaircases, PlannedTrial

Entries = Sequence[JournalEntry]
Answers = Mapping[str, Answer]


def judged_by(block: Block) -> str:
    """Return the key of a block that makes its trials successes or failures."""
    return 'stop' if block.staircase is None else 'staircase'


def judging_question(study: StudyFile, block: Block) -> tuple[int, Question] | None:
    """
    Return the question that judges each trial of a block, and the number of its step.

    :return: the step's number after each trial, from 1 on; None if the drive is judged.
    :raises InputError: if no question of this name follows every trial, or several do.
    """
    success, where = block.judged, f'blocks: {block.name}: {judged_by(block)}: success'
    if success is None or success.question is None:
        return None
    found, known = [], []
    for number, entry in enumerate(block.after_trial):
        if not isinstance(entry.step, Questions) or entry.groups:
            continue
        scale = scale_of(study, entry.step)
        if success.questionnaire in (None, scale.name):
            always = [question for question in scale.questions if question.when is None]
            known += [question.name for question in always]
            found += [(number + 1, question) for question in always
                      if question.name == success.question]
    if not found:
        raise InputError(f'names the question "{success.question}", which does not follow every '
                         'trial', where, f'name {", ".join(known) or "a question"} of '
                         'after_trial, for all groups and without "when"')
    if len(found) > 1:
        raise InputError(f'names the question "{success.question}", which several '
                         'questionnaires have', where, 'give "questionnaire" too')
    return found[0]


@dataclass(frozen=True)
class FollowedSession:
    """
    A session as far as the answers decide on it.

    :param items: that are needed, with the staircases' trials as they are or are foreseen.
    :param tracks: by block and staircase.
    """

    items: tuple[SessionItem, ...]
    tracks: Mapping[tuple[str, str], Track]


def followed(study: StudyFile, place: int, group: str, planned: Sequence[SessionItem],
             entries: Entries) -> FollowedSession:
    """
    Follow the staircases of a session, and the rules by which its blocks end.

    It depends on nothing but its parameters.

    :param place: of the participant, in the group if there are groups.
    :param group: of the participant; empty in a study without groups.
    :param planned: the items as planned.
    :raises InputError: if the journal has a condition that a block does not have.
    """
    tracks: dict[tuple[str, str], Track] = {}
    needed: dict[str, dict[int, PlannedTrial]] = {}
    for block in study.blocks:
        of_block = [item.what for item in planned if isinstance(item.what, PlannedTrial)
                    and item.what.block == block.name]
        if not of_block:
            continue
        if block.stop is not None:
            judged = _judged(study, block, entries)
            end = block.stop.ends_after(judged.get(trial.place) for trial in of_block)
            # What is done stays, even if a repeat lets the block end before it.
            done = {_place_in(block, entry) for entry in entries
                    if entry['entry'] in (SessionEvent.FINISHED, SessionEvent.SKIPPED)}
            needed[block.name] = {trial.place: trial for trial in of_block
                                  if end is None or trial.place <= end or trial.place in done}
        if block.staircase is None:
            continue
        staircases = BlockStaircases(study, block, group)
        found, trials = staircases.follow(place, _told(study, block, staircases, entries),
                                          of_block[0].number - 1)
        tracks |= {(block.name, name): track for name, track in found.items()}
        needed[block.name] = {trial.place: trial for trial in trials}
    if not needed:
        return FollowedSession(tuple(planned), {})
    return FollowedSession(tuple(_items(planned, needed)), tracks)


def _items(planned: Iterable[SessionItem],
           needed: Mapping[str, Mapping[int, PlannedTrial]]) -> Iterator[SessionItem]:
    for item in planned:
        block, _, rest = item.id.partition('/')
        place, _, what = rest.partition('/')
        trials = needed.get(block)
        if trials is None or not place.isdecimal():
            yield item
        elif int(place) in trials:
            if isinstance(item.what, PlannedTrial):
                yield replace(item, what=trials[int(place)])
            elif what != 'break' or int(place) < max(trials):
                yield item


def _place_in(block: Block, entry: JournalEntry) -> int | None:
    """Return the place in a block of the trial that an entry is about; None if it is no trial."""
    of_block, _, number = (entry.get('item') or '').partition('/')
    return int(number) if of_block == block.name and number.isdecimal() else None


def _judged(study: StudyFile, block: Block, entries: Entries) -> dict[int, bool | None]:
    """
    Return whether trials of a block that are done were a success, by their places.

    None is for those that count for nothing: they were left out, or the answer was.
    """
    success, judging = block.judged, judging_question(study, block)
    assert success is not None
    done = done_items(entries)
    found = {}
    for name, entry in done.items():
        place = _place_in(block, entry)
        if place is None:
            continue
        value = None
        if entry['entry'] == SessionEvent.FINISHED:
            value = entry.get(success.drive or '') if judging is None else (
                done.get(f'{name}/after/{judging[0]}', {}).get('answers') or {}).get(
                    success.question or '')
        found[place] = None if value in (None, []) else success.holds(value)
    return found


def _told(study: StudyFile, block: Block, staircases: BlockStaircases,
          entries: Entries) -> dict[int, ToldTrial]:
    """Return what the journal tells of the trials of a block with staircases."""
    started: dict[str, str | None] = {}
    driven: dict[int, tuple[int, int]] = {}
    for entry in entries:
        place = _place_in(block, entry)
        if place is None:
            continue
        item = entry['item']
        if entry['entry'] == SessionEvent.STARTED:
            started[item] = entry.get('condition')
        elif entry['entry'] == SessionEvent.FINISHED and (name := started.get(item)) is not None:
            # A drive that did not finish has not decided anything: its level follows anew.
            at = staircases.find(name)
            if at is None:
                raise InputError(f'tells of the condition "{name[:60]}", which is '
                                 'not in the block', item, 'put back the study file that '
                                 'the session was run with')
            driven[place] = at
    judged = _judged(study, block, entries)
    return {place: ToldTrial(driven.get(place), judged.get(place), place in judged)
            for place in sorted(driven.keys() | judged.keys()) if place <= staircases.most}


def last_answers(entries: Iterable[JournalEntry]) -> dict[str, Answers]:
    """Return the last answers of each item, by its id; none of an item that is to be repeated."""
    return {item: entry.get('answers') or {} for item, entry in done_items(entries).items()
            if entry['entry'] == SessionEvent.FINISHED}


def field_answers(items: Iterable[SessionItem], answers: Mapping[str, Answers]) -> Answers:
    """Return the answers to the fields of the participant."""
    return next((answers.get(item.id, {}) for item in items if isinstance(item.what, Fields)), {})


def failed_checks(study: StudyFile, items: Iterable[SessionItem],
                  answers: Mapping[str, Answers]) -> list[str]:
    """Return the attention checks that failed, as item and question."""
    items = tuple(items)
    fields = field_answers(items, answers)
    return [f'{item.id}: {question.name}' for item in items if item.id in answers
            for question in asked_of(questions_of(study, item), answers[item.id],
                                     None if isinstance(item.what, Fields) else fields)
            if question.failed(answers[item.id].get(question.name))]


def exclusion_of(study: StudyFile, items: Iterable[SessionItem],
                 answers: Mapping[str, Answers]) -> Exclusion | None:
    """Return the first rule that excludes a participant; None without one."""
    items = tuple(items)
    if not study.exclude:
        return None
    failed = len(failed_checks(study, items, answers))
    for rule in study.exclude:
        if rule.when is None:
            holds = failed >= (rule.attention_failed or 0)
        else:
            holds = any(map(rule.when.holds, _tested(study, rule, items, answers)))
        if holds:
            return rule
    return None


def _tested(study: StudyFile, rule: Exclusion, items: Iterable[SessionItem],
            answers: Mapping[str, Answers]) -> Iterator[Answer]:
    """Yield the answers that the condition of a rule is about."""
    when = rule.when
    assert when is not None
    if when.field is not None:
        yield field_answers(items, answers).get(when.field)
        return
    for item in items:
        scale = questionnaire_of(study, item) if item.id in answers else None
        if scale is not None and scale.name == when.questionnaire:
            yield answers[item.id].get(when.question or '')
