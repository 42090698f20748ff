# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Makes the data of a study without people, to try its whole analysis before the first session."""

from collections.abc import Callable, Mapping, Sequence
from itertools import count
import json
from pathlib import Path

from crgame_ros.errors import InputError
from crgame_ros.software import software_with_commit
from crgame_ros.study.analysis.power import (
    measure_models,
    planned_people,
    SimulatedPerson,
    SimulatedTrials,
)
from crgame_ros.study.file import Page, StudyFile
from crgame_ros.study.folder import MADE, StudyFolder
from crgame_ros.study.participant_session import ParticipantSession
from crgame_ros.study.question import (
    ChoiceQuestion,
    LikertQuestion,
    NumberQuestion,
    Question,
    SliderQuestion,
    VasQuestion,
)
from crgame_ros.study.session_script import PracticeDrives, SessionItem
from crgame_ros.study.staircase import OUTCOMES
from crgame_ros.study.trial_plan import PlannedTrial
from crgame_ros.whole_file import write_text
import numpy as np

# Made sessions are of 2000-01-01, when nobody can have driven [s since 1970].
_BEGIN_S, _STEP_S = 946_684_800.0, 30.0
# Answers to numbers without bounds.
_LOW, _HIGH = 0.0, 100.0
# Random answers to an item, of which one has to keep the participant in the study.
_TRIES = 1000


def make_study(study: StudyFile, file: Path, pictures: Sequence[str], out: Path,
               participants: int, seed: int, effects: bool,
               progress: Callable[[float], object] = lambda _: None) -> None:
    """
    Make the folder of a study with sessions that nobody has done.

    Journals are those of real sessions, with random answers, and with a value of each planned
    measure for each trial, as the simulation of power draws it; trials of staircases have random
    values of the drive, and no measures. There are no recordings.

    :param pictures: of its pages.
    :param out: folder to make.
    :param effects: whether the planned effects are there, or none.
    :raises InputError: if the folder exists, or the study cannot be planned.
    """
    if out.exists():
        raise InputError('is there already', str(out), 'name another folder with --out')
    models = measure_models(study, effects)
    folder = StudyFolder(out)
    folder.keep_study(study, file, pictures)
    write_text(json.dumps({
        'made_by': 'crgame study make-data', 'participants': participants, 'seed': seed,
        'effects': effects, 'software': software_with_commit()}, indent=1) + '\n', out / MADE)
    rng, answers_rng = np.random.default_rng(seed), np.random.default_rng((seed, 1))
    times = (_BEGIN_S + _STEP_S * number for number in count())
    is_given = study.groups is not None and study.groups.allocation == 'given'
    people = planned_people(study, participants)
    for number, planned in enumerate(people):
        with ParticipantSession(study, folder.participant(planned.id), planned.id, number,
                                clock_s=lambda: next(times),
                                group=planned.group if is_given else None) as session:
            _finish_all(session, answers_rng, lambda person: SimulatedTrials(
                study, [person], models).draw(rng))
        progress((number + 1) / participants)


def _finish_all(session: ParticipantSession, rng: np.random.Generator,
                draw: Callable[[SimulatedPerson], Sequence[Mapping[str, object]]]) -> None:
    """
    Go through a session.

    :param draw: returns the trials of a person, whose group is known then.
    """
    measures = dict.fromkeys(each.measure for each in session.study.analysis.comparisons)
    values: dict[object, dict[str, object]] = {}
    while (item := session.next_item) is not None:
        what = item.what
        if isinstance(what, PracticeDrives):
            session.practised(good=True)
        elif isinstance(what, PlannedTrial):
            if not values:
                place, group = (session.place, '') if session.allocation is None else (
                    session.allocation.place, session.allocation.group)
                values = {row['trial']: {measure: row[measure] for measure in measures}
                          for row in draw(SimulatedPerson(session.participant, place, group))}
            attempt = session.start()
            told = {'outcome': 'time'} if what.staircase is None else {
                'outcome': OUTCOMES[int(rng.integers(len(OUTCOMES)))],
                'contacts': int(rng.integers(2)), 'departures': int(rng.integers(2))}
            session.finish(run='', attempt=attempt, made=values.get(what.number, {}), **told)
        elif isinstance(what, Page):
            session.finish(agreed=True)
        else:
            session.finish(_answers(session, item, rng))


def _answers(session: ParticipantSession, item: SessionItem,
             rng: np.random.Generator) -> dict[str, object]:
    """
    Return random answers with which the participant stays in the study.

    :raises InputError: if its rules exclude nearly everybody.
    """
    for _ in range(_TRIES):
        given = {question.name: _answer(question, rng) for question in session.questions(item)}
        if session.excluded_by(item, given) is None:
            return given
    raise InputError('excludes nearly everybody whose answers are random', item.id,
                     'look at the rules under exclude')


def _answer(question: Question, rng: np.random.Generator) -> object:
    """Return a random answer that the question takes; of an attention check the expected one."""
    kind = question.kind
    if question.expect is not None:
        return str(question.expect) if isinstance(kind, ChoiceQuestion) else question.expect
    if isinstance(kind, LikertQuestion):
        return int(rng.integers(1, kind.points + 1))
    if isinstance(kind, VasQuestion):
        return float(rng.uniform(*kind.bounds))
    if isinstance(kind, SliderQuestion):
        steps = int((kind.high - kind.low) / kind.step)
        return kind.low + kind.step * int(rng.integers(0, steps + 1))
    if isinstance(kind, ChoiceQuestion):
        names = [str(name) for name in kind.choices]
        chosen = names[int(rng.integers(len(names)))]
        return [chosen] if kind.several else chosen
    if isinstance(kind, NumberQuestion):
        low = max(kind.low, min(_LOW, kind.high))
        high = min(kind.high, max(_HIGH, kind.low))
        value = float(rng.uniform(low, high))
        return max(int(np.ceil(low)), int(value)) if kind.whole else value
    return 'made'[:kind.longest]
