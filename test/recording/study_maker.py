# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A study with participants: real sessions, and real recordings of their drives."""

from dataclasses import dataclass, replace
import json
from pathlib import Path
from typing import Any

from crgame_ros.driver.source import ReplayDriver
from crgame_ros.recording.run_folder import FINISHED_MARK
from crgame_ros.simulation.offline import run_offline
from crgame_ros.simulation.setup import build_setup
from crgame_ros.study.file import load_study, Page, Questions
from crgame_ros.study.participant_session import ParticipantSession
from crgame_ros.study.session_script import Fields
from crgame_ros.study.trial_game import trial_game
from crgame_ros.study.trial_plan import PlannedTrial
import numpy as np

DURATION_S = 1.5
NASTY = ('=1+1 "quoted", <b>HTML</b> & \'more\'\nnew line\r\nanother\ttab; back\\slash '
         '\N{FACE WITH TEARS OF JOY}\N{ZERO WIDTH JOINER} Привет n/a ') + 'x' * 9_800
STUDY = """
name: demo
title: {{en: Does the planner matter?, de: Kommt es auf den Planer an?}}
seed: 5
participants: 4
fields:
  - {{name: age, ask: How old are you?, number: {{low: 18, high: 99, whole: true, unit: years}}}}
settings: {{game: {game}, duration: {duration}, seed: 3}}
factors:
  - name: planner
    levels: [{{name: idm, planner: idm}}, {{name: cv, planner: constant-velocity}}]
before: [{{page: {{file: consent.md, consent: true}}}}, {{questions: ssq}}]
blocks:
  - name: main
    after_trial: [{{questions: van_der_laan}}, {{questions: remarks.yaml}}]
after: [{{questions: ssq}}]
analysis:
  comparisons:
  - {{measure: mean_speed_m_per_s, factor: planner, contrast: [idm, cv]}}
  - {{measure: acceptance_usefulness, factor: planner}}
"""
REMARKS = """
name: remarks
title: Remarks
questions:
  - {name: remark, ask: What do you say?, text: {longest: 20000}, required: false}
  - name: seen
    ask: What have you seen?
    choice: {choices: {car: A car, sign: A sign}, several: true}
    required: false
"""


@dataclass
class Studied:
    """
    A study's folder, and its participants' answers.

    :param folder: of the study.
    :param answers: by participant and trial, to the questions of van_der_laan.
    """

    folder: Path
    answers: dict[tuple[str, int], dict[str, Any]]


class StudyMaker:
    """
    Makes sessions of participants, as `crgame study run` would write them.

    :param recorder: of runs.
    :param folder: of the study, is made.
    :param game: that is driven.
    """

    def __init__(self, recorder: Any, folder: Path, game: Path) -> None:
        self.recorder, self.folder = recorder, folder
        (folder / 'study').mkdir(parents=True)
        (folder / 'study' / 'consent.md').write_text('Do you agree?\n')
        (folder / 'study' / 'remarks.yaml').write_text(REMARKS)
        file = folder / 'study' / 'study.yaml'
        file.write_text(STUDY.format(game=game, duration=DURATION_S))
        self.study = load_study(file)
        self.clock_s = 1_800_000_000.0
        self.answers: dict[tuple[str, int], dict[str, Any]] = {}

    def session(self, name: str, place: int) -> ParticipantSession:
        """Open the session of a participant."""
        return ParticipantSession(self.study, self.folder / 'participants' / name, name, place,
                                  self._now)

    def _now(self) -> float:
        self.clock_s += 1.25
        return self.clock_s

    def do(self, session: ParticipantSession, rng: np.random.Generator,
           remark: str | None = None) -> str:
        """Do the next item; return its id."""
        item = session.next_item
        assert item is not None
        if isinstance(item.what, Page):
            session.finish(agreed=True)
        elif isinstance(item.what, PlannedTrial):
            run = self.run_name(session)
            attempt = session.start(run)
            self.record(session, item.what, run, rng)
            session.finish(run=run, attempt=attempt, outcome='time', end_time_s=DURATION_S,
                           start_at=self.clock_s - DURATION_S)
        elif isinstance(item.what, Fields):
            session.finish({'age': int(rng.integers(18, 80))})
        elif isinstance(item.what, Questions):
            found = {question.name: None if question.name in ('remark', 'seen')
                     else int(rng.integers(1, 5)) for question in session.questions(item)}
            if item.what.name == 'van_der_laan':
                self.answers[session.participant, item.trial or 0] = found
            if 'remark' in found:
                found |= {'remark': remark, 'seen': ['car', 'sign']}
            session.finish(found)
        return item.id

    def run_name(self, session: ParticipantSession) -> str:
        """Name the next run: the first of a start of the graph is its folder itself."""
        before = {entry.get('run') for entry in session.journal.entries} - {None, ''}
        return 'runs/1' if not before else f'runs/1/run_{len(before) + 1}'

    def drivers(self, commands: np.ndarray) -> dict[str, ReplayDriver]:
        """Return who gives these commands."""
        return {'hv0': ReplayDriver(commands)}

    def record(self, session: ParticipantSession, trial: PlannedTrial, run: str,
               rng: np.random.Generator, finished: bool = True) -> Path:
        """Drive a trial, and leave its recording."""
        game = trial_game(trial.condition.settings, 'idle')
        commands = rng.uniform((0, 0, -0.05, 0), (1, 0.2, 0.05, 0), (1000, 4))
        setup = build_setup(replace(game, drivability=replace(game.drivability, stop=False)))
        result = run_offline(setup, duration_s=DURATION_S, drivers=self.drivers(commands),
                             check_drivability=False)
        folder = session.journal.path.parent / run
        folder.mkdir(parents=True, exist_ok=True)
        self.recorder.ours(folder / 'bag', [
            *self.recorder.messages(result), *self.recorder.instruments()])
        if finished:
            (folder / FINISHED_MARK).touch()
        return folder


def lines_of(path: Path) -> list[dict[str, Any]]:
    """Read a journal."""
    return [json.loads(line) for line in path.read_text('utf-8').splitlines()]


def take_part(make: StudyMaker) -> Studied:
    """Make four participants: two complete, one with troubles, one that leaves."""
    for place, name in enumerate(('P01', 'P02')):
        with make.session(name, place) as session:
            for _ in range(2):
                session.note_software({'crgame_ros': '9.8', 'commit': 'abc'})
            rng = np.random.default_rng(place)
            while session.next_item is not None:
                make.do(session, rng, NASTY if name == 'P01' else None)
    with make.session('P03', 2) as session:
        troubled(make, session)
    with make.session('P04', 3) as session:
        rng = np.random.default_rng(4)
        while not isinstance(session.next_item.what, PlannedTrial):
            make.do(session, rng)
        session.start('runs/1')
        session.end('felt ill')
    return Studied(make.folder, make.answers)


def troubled(make: StudyMaker, session: ParticipantSession) -> None:
    """Abort, repeat and remark: trial 1 is driven three times, the third of which counts."""
    rng = np.random.default_rng(3)
    while not isinstance(session.next_item.what, PlannedTrial):
        make.do(session, rng)
    session.start(make.run_name(session))
    session.note('sneezed', run='runs/1', time_s=0.5)
    session.abort('sneezing')
    make.do(session, rng)
    session.repeat('main/1', 'a phone rang')
    make.do(session, rng)
    session.mark('beep', run='runs/1/run_3', time_s=None)
    while session.next_item is not None:
        make.do(session, rng)
