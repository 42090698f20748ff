# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The items of a session whose staircases follow the answers in its journal."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from crgame_ros.errors import InputError
from crgame_ros.study.file import Block, Questions, StudyFile
from crgame_ros.study.pages import questionnaire_name
from crgame_ros.study.question import Question
from crgame_ros.study.questionnaire import load_questionnaire
from crgame_ros.study.session_journal import SessionEvent
from crgame_ros.study.session_script import SessionItem
from crgame_ros.study.staircase import ToldTrial, Track
from crgame_ros.study.trial_plan import BlockStaircases, PlannedTrial

Entries = Sequence[Mapping[str, Any]]


def judging_question(study: StudyFile, block: Block) -> tuple[int, Question] | None:
    """
    Return the question that judges each trial of a staircase, and the number of its step.

    :return: the step's number after each trial, from 1 on; None if the drive is judged.
    :raises InputError: if no question of this name follows every trial, or several do.
    """
    assert block.staircase is not None
    success, where = block.staircase.success, f'blocks: {block.name}: staircase: success'
    if success.question is None:
        return None
    found, known = [], []
    for number, entry in enumerate(block.after_trial):
        if not isinstance(entry.step, Questions) or entry.groups:
            continue
        scale = load_questionnaire(questionnaire_name(study, entry.step))
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
    Follow the staircases of a session.

    It depends on nothing but its parameters.

    :param place: of the participant, in the group if there are groups.
    :param group: of the participant; empty in a study without groups.
    :param planned: the items as planned.
    :param entries: of the journal.
    :raises InputError: if the journal has a condition that a block does not have.
    """
    tracks: dict[tuple[str, str], Track] = {}
    needed: dict[str, dict[int, PlannedTrial]] = {}
    for block in study.blocks:
        first = next((item.what for item in planned if isinstance(item.what, PlannedTrial)
                      and item.what.block == block.name), None)
        if block.staircase is None or first is None:
            continue
        staircases = BlockStaircases(study, block, group)
        found, trials = staircases.follow(place, _told(study, block, staircases, entries),
                                          first.number - 1)
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


def _told(study: StudyFile, block: Block, staircases: BlockStaircases,
          entries: Entries) -> dict[int, ToldTrial]:
    """Return what the journal tells of a block's trials, by their places."""
    assert block.staircase is not None
    success, judging = block.staircase.success, judging_question(study, block)
    started: dict[str, Any] = {}
    driven: dict[str, tuple[int, int]] = {}
    done: dict[str, Mapping[str, Any]] = {}
    for entry in entries:
        item = entry.get('item') or ''
        if not item.startswith(f'{block.name}/'):
            continue
        kind = entry['entry']
        if kind == SessionEvent.STARTED:
            started[item] = entry.get('condition')
        elif kind == SessionEvent.REPEATED:
            done.pop(item, None)
        elif kind in (SessionEvent.FINISHED, SessionEvent.SKIPPED):
            done[item] = entry
            # A drive that did not finish has not decided anything: its level follows anew.
            if kind == SessionEvent.FINISHED and started.get(item) is not None:
                at = staircases.find(started[item])
                if at is None:
                    raise InputError(f'tells of the condition "{started[item][:60]}", which is '
                                     'not in the block', item, 'put back the study file that '
                                     'the session was run with')
                driven[item] = at
    told = {}
    for place in range(1, staircases.most + 1):
        name = f'{block.name}/{place}'
        entry = done.get(name, {})
        good = None
        if entry.get('entry') == SessionEvent.FINISHED:
            if judging is None:
                value = entry.get(success.drive or '')
            else:
                value = (done.get(f'{name}/after/{judging[0]}', {}).get('answers') or {}).get(
                    success.question)
            good = None if value in (None, []) else success.holds(value)
        if name in done or name in driven:
            told[place] = ToldTrial(driven.get(name), good, name in done)
    return told
