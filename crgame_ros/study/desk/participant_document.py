# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Builds the documents that the pages of participant and experimenter show."""

from collections import Counter
from collections.abc import Mapping
from dataclasses import asdict
import math

from crgame_ros.study.answer_condition import AnswerCondition, holds_for
from crgame_ros.study.desk.desk import Desk
from crgame_ros.study.desk.page_markdown import read_tree
from crgame_ros.study.drive_watch import DrivePhase, UNDER_WAY
from crgame_ros.study.file import Break, DeviceCheck, Page, Questions
from crgame_ros.study.participant_session import ParticipantSession
from crgame_ros.study.quality import Excess, QualityBounds
from crgame_ros.study.question import (
    ChoiceQuestion,
    LikertQuestion,
    NumberQuestion,
    Question,
    SliderQuestion,
    TextQuestion,
    VasQuestion,
)
from crgame_ros.study.questionnaire import scale_of
from crgame_ros.study.session_journal import (
    done_items,
    how_ended,
    JournalEntry,
    SessionEvent,
    way_of_end,
)
from crgame_ros.study.session_script import Fields, PracticeDrives, SessionItem
from crgame_ros.study.trial_plan import PlannedTrial

MOST_ENTRIES = 300
LONGEST = 300
# Between neighbouring positions on a visual analogue scale.
VAS_STEP = 0.5


def participant_document(desk: Desk) -> dict[str, object]:
    """
    Describe the page.

    :return: `show` names the view: language, wait, questions, page, break, device, drive or over;
        `item` is the id to send with every answer. Texts are in the page's language.
    :raises InputError: if a page or questionnaire of the study cannot be read.
    """
    session, language = desk.session, desk.language
    item = session.next_item
    document = {
        'study': session.study.title_in(language),
        'participant': session.participant, 'language': language,
        'languages': list(session.study.all_languages), 'item': '' if item is None else item.id,
        'again': 0 if item is None else session.repeats(item.id),
        'progress': _progress(desk)}
    if item is None or desk.ending:
        how, elsewhere = how_over(desk), session.study.elsewhere
        return {**document, 'show': 'over', 'how': how, 'tree': _last_page(desk),
                'code': '' if elsewhere is None else elsewhere.code_for(how),
                'address': '' if elsewhere is None else elsewhere.address_for(how)}
    if desk.waits:
        return {**document, 'show': 'wait', 'why': 'held'}
    if desk.asks_language:
        return {**document, 'show': 'language'}
    return {**document, **_item(desk, item)}


def how_over(desk: Desk) -> str:
    """Return how a session ended: done, declined, excluded or ended."""
    return way_of_end(desk.session.journal.entries) or ('ended' if desk.ending else 'done')


def _last_page(desk: Desk) -> list[object]:
    """Return the page for a participant who was excluded; empty without one."""
    file = (how_ended(desk.session.journal.entries) or {}).get('page')
    return [] if not file else list(read_tree(desk.session.study, Page(file), desk.language))


def _progress(desk: Desk) -> dict[str, int]:
    session = desk.session
    done = session.done
    items = session.planned_items
    trials = [item for item in items if isinstance(item.what, PlannedTrial)]
    return {'done': len(done), 'of': len(items),
            'drives_done': sum(item.id in done for item in trials), 'drives': len(trials)}


def _item(desk: Desk, item: SessionItem) -> dict[str, object]:
    what, language, study = item.what, desk.language, desk.session.study
    if isinstance(what, PlannedTrial | PracticeDrives):
        return _drive(desk, item)
    if isinstance(what, Page):
        return {'show': 'page', 'consent': what.consent,
                'tree': list(read_tree(study, what, language))}
    if isinstance(what, Break):
        return {'show': 'break', 'text': what.text.in_language(language),
                'left_s': round(desk.break_left_s, 1)}
    if isinstance(what, DeviceCheck):
        return {'show': 'device', 'text': what.text.in_language(language)}
    head: dict[str, object] = {'title': '', 'text': '', 'matrix': False}
    if isinstance(what, Questions):
        scale = scale_of(study, what)
        head = {'title': scale.title.in_language(language),
                'text': scale.text.in_language(language), 'matrix': scale.matrix}
    return {'show': 'questions', **head, 'questions': [
        _question(question, language, isinstance(what, Fields))
        for question in desk.session.questions(item)
        if isinstance(what, Fields) or question.when is None or question.when.field is None
        or holds_for(question.when, {}, desk.session.fields)]}


def _drive(desk: Desk, item: SessionItem) -> dict[str, object]:
    state, what = desk.drives.state, item.what
    if state.phase not in (DrivePhase.READY, *UNDER_WAY) or state.item != item.id:
        return {'show': 'wait', 'why': 'failed' if state.phase == DrivePhase.FAILED
                else 'preparing'}
    slow = desk.slow_link
    if slow is not None:
        return {'show': 'wait', 'why': 'slow', 'link': asdict(slow)}
    drive: dict[str, object] = {
        'show': 'drive', 'phase': state.phase.value, 'link': state.link,
        'attempt': state.attempt, 'awaits_others': state.awaits_others,
        'practice': isinstance(what, PracticeDrives)}
    if isinstance(what, PlannedTrial):
        # The last trials of a staircase may not be needed, and leave gaps in the numbers.
        drive['number'] = 1 + sum(isinstance(each.what, PlannedTrial)
                                  and each.what.number < what.number
                                  for each in desk.session.items)
    else:
        drive['number'] = 1 + desk.session.practice_drives(item.id)
    return drive


def _condition(when: AnswerCondition | None, are_fields: bool) -> dict[str, object] | None:
    """Return a condition that the page has to test; None without one."""
    if when is None or when.field is not None and not are_fields:
        return None
    return {'question': when.question or when.field, 'at_least': when.at_least,
            'below': when.below, 'one_of': [
                value if isinstance(value, int | float) and not isinstance(value, bool)
                else str(value) for value in when.values]}


def _question(question: Question, language: str, are_fields: bool) -> dict[str, object]:
    kind = question.kind
    document: dict[str, object] = {'name': question.name, 'required': question.required,
                                   'ask': question.ask.in_language(language) or question.name,
                                   'when': _condition(question.when, are_fields)}
    if isinstance(kind, LikertQuestion):
        return document | {
            'kind': 'likert', 'points': kind.points, 'left': kind.left.in_language(language),
            'right': kind.right.in_language(language),
            'labels': [label.in_language(language) for label in kind.labels]}
    if isinstance(kind, SliderQuestion | VasQuestion):
        low, high = kind.bounds
        return document | {
            'kind': 'slider', 'low': low, 'high': high,
            'step': kind.step if isinstance(kind, SliderQuestion) else VAS_STEP,
            'bare': isinstance(kind, VasQuestion), 'left': kind.left.in_language(language),
            'right': kind.right.in_language(language)}
    if isinstance(kind, ChoiceQuestion):
        return document | {'kind': 'choice', 'several': kind.several, 'choices': [
            [name, text.in_language(language)] for name, text in kind.texts.items()]}
    if isinstance(kind, NumberQuestion):
        return document | {'kind': 'number', 'low': kind.low, 'high': kind.high,
                           'whole': kind.whole, 'unit': kind.unit.in_language(language)}
    assert isinstance(kind, TextQuestion)
    return document | {'kind': 'text', 'longest': kind.longest}


def experimenter_document(desk: Desk, page: Mapping[str, object]) -> dict[str, object]:
    """
    Describe the page.

    :param page: state of the participant's page: connected, delays, seat.
    """
    session, state = desk.session, desk.drives.state
    item = session.next_item
    return {
        'study': session.study.title_in(session.study.language),
        'name': session.study.name, 'participant': session.participant, 'place': session.place,
        'group': None if session.allocation is None else session.allocation.group,
        'partners': [partner.participant for partner in session.partners],
        'language': session.language, 'page': dict(page), 'markers': list(session.study.markers),
        'item': '' if item is None else item.id, 'held': session.held_at is not None,
        'waits': desk.waits, 'ending': desk.ending,
        'over': how_over(desk) if item is None else '', 'can_abort': desk.can_abort,
        'drive': {'phase': state.phase.value, 'item': state.item, 'attempt': state.attempt,
                  'time_s': state.time_s, 'work': state.work.value, 'text': state.text,
                  'doubts': list(map(_doubt, state.doubts)), 'watch': state.watch,
                  'confederate': state.confederate, 'awaits_others': state.awaits_others},
        'pause_h': _pause_h(session),
        'items': _items(desk), 'log': _log(desk)}


def _doubt(excess: Excess) -> dict[str, object]:
    check = excess.check
    return {'check': excess.name, 'value': check.factor * excess.value,
            'bound': check.factor * excess.bound, 'unit': check.unit, 'digits': check.digits,
            'least': check.least}


def _doubts_of(entry: JournalEntry, quality: QualityBounds) -> list[dict[str, object]]:
    """Return what of a finished drive's values is beyond a bound, without what is no number."""
    values = {name: value for name, value in (entry.get('quality') or {}).items()
              if isinstance(value, int | float) and math.isfinite(value)}
    return list(map(_doubt, quality.excesses(values)))


def _pause_h(session: ParticipantSession) -> float:
    """Return how long nothing happened before the session was opened last [h]."""
    entries = session.journal.entries
    opened = next((index for index in range(len(entries) - 1, 0, -1)
                   if entries[index]['entry'] == SessionEvent.OPENED), 0)
    return round((entries[opened]['at'] - entries[opened - 1]['at']) / 3600.0, 1) \
        if opened else 0.0


def _items(desk: Desk) -> list[dict[str, object]]:
    session = desk.session
    attempts = Counter(entry['item'] for entry in session.journal.entries
                       if entry['entry'] == SessionEvent.STARTED)
    done, now = done_items(session.journal.entries), session.next_item
    found: list[dict[str, object]] = []
    for item in session.items:
        end = done.get(item.id)
        state = 'now' if now is not None and item.id == now.id \
            else 'to_come' if end is None else end['entry']
        found.append({
            'id': item.id, **kind_of(item), 'attempts': attempts[item.id],
            'condition': _condition_of(item, state),
            'trial': item.what.number if isinstance(item.what, PlannedTrial) else item.trial,
            'outcome': '' if end is None else end.get('outcome') or '',
            'reason': '' if end is None else (end.get('reason') or '')[:LONGEST],
            'doubts': [] if end is None else _doubts_of(end, session.study.quality),
            'state': state})
    return found


def _condition_of(item: SessionItem, state: str) -> str:
    """Return the condition of a trial; empty for other items, and where answers decide on it."""
    what = item.what
    if not isinstance(what, PlannedTrial) or state == 'to_come' and what.staircase is not None:
        return ''
    return what.condition.name


def kind_of(item: SessionItem) -> dict[str, str]:
    """Return the kind of an item, and which one of its kind it is: `kind` and `what`."""
    match item.what:
        case PlannedTrial(number=number):
            kind, what = 'drive', f'{number}'
        case PracticeDrives():
            kind, what = 'practice', ''
        case Fields():
            kind, what = 'fields', ''
        case Page(file=file, consent=consent):
            kind, what = 'consent' if consent else 'page', file
        case Break(minutes=minutes):
            kind, what = 'break', f'{minutes:g}'
        case DeviceCheck():
            kind, what = 'device', ''
        case Questions(name=name):
            kind, what = 'questions', name
    return {'kind': kind, 'what': what}


def _log(desk: Desk) -> list[dict[str, object]]:
    """Return the last entries of the journal, without answers, which only the file holds."""
    return [{name: value[:LONGEST] if isinstance(value, str) else value
             for name, value in entry.items()
             if name not in ('answers', 'items', 'after_s', 'asked')
             and not isinstance(value, dict)}
            for entry in desk.session.journal.entries[-MOST_ENTRIES:]]
