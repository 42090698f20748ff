# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Makes the data of a study without people, to try its whole analysis before the first session."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import count
import json
from pathlib import Path

from crgame_ros.errors import InputError
from crgame_ros.software import software_with_commit
from crgame_ros.study.analysis.simulated_trials import measure_models, SimulatedTrials
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
from crgame_ros.study.session_script import PracticeDrives
from crgame_ros.study.trial_plan import PlannedTrial
from crgame_ros.whole_file import write_text
import numpy as np

# Made sessions are of 2000-01-01, when nobody can have driven [s since 1970].
_BEGIN_S, _STEP_S = 946_684_800.0, 30.0
# Answers to numbers without bounds.
_LOW, _HIGH = 0.0, 100.0


def make_study(study: StudyFile, file: Path, pictures: Sequence[str], out: Path,
               participants: int, seed: int, effects: bool,
               progress: Callable[[float], object] = lambda _: None) -> None:
    """
    Make the folder of a study with sessions that nobody has done.

    Journals are those of real sessions, with random answers, and with a value of each planned
    measure for each trial, as the simulation of power draws it. There are no recordings.

    :param file: of the study.
    :param pictures: of its pages.
    :param out: folder to make.
    :param effects: whether the planned effects are there, or none.
    :raises InputError: if the folder exists, or the study cannot be planned.
    """
    if out.exists():
        raise InputError('is there already', str(out), 'name another folder with --out')
    trials = SimulatedTrials(study, participants, measure_models(study, effects))
    folder = StudyFolder(out)
    folder.keep_study(study, file, pictures)
    write_text(json.dumps({
        'made_by': 'crgame study make-data', 'participants': participants, 'seed': seed,
        'effects': effects, 'software': software_with_commit()}, indent=1) + '\n', out / MADE)
    rng = np.random.default_rng(seed)
    values = {(row['participant'], row['trial']): {
        measure: row[measure] for measure in trials.measures} for row in trials.draw(rng)}
    times = (_BEGIN_S + _STEP_S * number for number in count())
    for place, name in enumerate(trials.participants):
        with ParticipantSession(study, folder.participant(name), name, place,
                                lambda: next(times)) as session:
            for _ in _finish_all(session, rng, values):
                pass
        progress((place + 1) / participants)


def _finish_all(session: ParticipantSession, rng: np.random.Generator,
                values: Mapping[tuple[str, int], Mapping[str, float]]) -> Iterator[None]:
    while (item := session.next_item) is not None:
        what = item.what
        if isinstance(what, PracticeDrives):
            session.practised(good=True)
        elif isinstance(what, PlannedTrial):
            attempt = session.start()
            session.finish(run='', attempt=attempt, outcome='time',
                           made=values[session.participant, what.number])
        elif isinstance(what, Page):
            session.finish(agreed=True)
        else:
            session.finish({question.name: _answer(question, rng)
                            for question in session.questions(item)})
        yield


def _answer(question: Question, rng: np.random.Generator) -> object:
    """Return a random answer that the question takes."""
    kind = question.kind
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
