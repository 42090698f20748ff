# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A study with every kind of item, and drives that need no running graph."""

import asyncio
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

from crgame_ros.study.drive_watch import DrivePhase, DriveState
from crgame_ros.study.file import load_study, StudyFile
from crgame_ros.study.participant_session import ParticipantSession
from crgame_ros.study.session_script import is_driven, PracticeDrives
from PIL import Image
import yaml

STUDY: dict[str, Any] = {
    'name': 'demo', 'title': {'en': 'Merging with others', 'de': 'Einfädeln mit anderen'},
    'language': 'en', 'languages': ['en', 'de'], 'seed': 3, 'markers': ['braked late', 'spoke'],
    'fields': [
        {'name': 'age', 'ask': {'en': 'How old are you?', 'de': 'Wie alt sind Sie?'},
         'number': {'low': 18, 'high': 99, 'whole': True, 'unit': 'years'}},
        {'name': 'licence', 'ask': {'en': 'Have you a driving licence?',
                                    'de': 'Haben Sie einen Führerschein?'},
         'choice': {'choices': {'yes': {'en': 'Yes', 'de': 'Ja'}, 'no': {'en': 'No', 'de': 'Nein'},
                                'other': {'en': 'Something else', 'de': 'Etwas anderes'}}}}],
    'factors': [{'name': 'planner', 'levels': [{'name': 'a', 'planner': 'idm'},
                                               {'name': 'b', 'planner': 'reactive'}]}],
    'before': [{'page': {'file': 'consent.md', 'consent': True}}, {'page': 'welcome.md'},
               {'device_check': {}}, {'questions': 'kinds.yaml'}],
    'blocks': [{'name': 'main', 'settings': {'game': 'x.yaml'},
                'practice': {'at_least': 1, 'at_most': 1},
                'after_trial': [{'questions': 'nasa_tlx'}], 'break_every': 1,
                'break_minutes': 0.02}],
    'after': [{'questions': 'ssq'}, {'questions': 'van_der_laan'}]}
KINDS: dict[str, Any] = {
    'name': 'kinds', 'title': {'en': 'About driving', 'de': 'Über das Fahren'},
    'text': {'en': 'There are no wrong answers.', 'de': 'Es gibt keine falschen Antworten.'},
    'questions': [
        {'name': 'trust', 'ask': {'en': 'I trust automated vehicles.',
                                  'de': 'Ich vertraue automatisierten Fahrzeugen.'},
         'likert': {'points': 7, 'left': {'en': 'Not at all', 'de': 'Gar nicht'},
                    'right': {'en': 'Entirely', 'de': 'Völlig'}}},
        {'name': 'often', 'ask': {'en': 'How often do you drive?', 'de': 'Wie oft fahren Sie?'},
         'likert': {'points': 4, 'labels': [
             {'en': 'Never', 'de': 'Nie'}, {'en': 'Rarely', 'de': 'Selten'},
             {'en': 'Often', 'de': 'Oft'}, {'en': 'Daily', 'de': 'Täglich'}]}},
        {'name': 'tired', 'ask': {'en': 'How tired are you?', 'de': 'Wie müde sind Sie?'},
         'slider': {'low': 0, 'high': 100, 'step': 5, 'left': {'en': 'Awake', 'de': 'Wach'},
                    'right': {'en': 'Asleep', 'de': 'Schlafend'}}},
        {'name': 'vehicles', 'required': False,
         'ask': {'en': 'What have you driven?', 'de': 'Was sind Sie gefahren?'},
         'choice': {'several': True, 'choices': {
             'car': {'en': 'Car', 'de': 'Auto'}, 'van': {'en': 'Van', 'de': 'Transporter'},
             'truck': {'en': 'Truck', 'de': 'Lastwagen'}}}},
        {'name': 'distance', 'ask': {'en': 'How far do you drive in a year?',
                                     'de': 'Wie weit fahren Sie im Jahr?'},
         'number': {'low': 0, 'high': 1000000, 'unit': 'km'}},
        {'name': 'words', 'ask': {'en': 'What else should we know?',
                                  'de': 'Was sollten wir noch wissen?'}, 'text': {}}]}
CONSENT = '# Consent\n\nYour answers are kept without your **name**. You may stop at any time.\n'
ZUSTIMMUNG = '# Zustimmung\n\nIhre Antworten werden ohne Ihren **Namen** gespeichert.\n'
WELCOME = """# Welcome

You drive with *other* vehicles. <script>document.title = "hurt"</script>

1. Take your seat.
2. Keep to the right.

| key | what |
|---|---|
| W | faster |

![a road](road.png) and [more](https://example.org/) and [not this](javascript:alert(1))
"""


def write_study(folder: Path, **changed: Any) -> StudyFile:
    """Write a study with its pages, and read it."""
    folder.mkdir(parents=True, exist_ok=True)

    def dump(content: dict[str, Any]) -> str:
        return yaml.safe_dump(content, allow_unicode=True, sort_keys=False)

    for name, text in (('consent.md', CONSENT), ('consent.de.md', ZUSTIMMUNG),
                       ('welcome.md', WELCOME), ('kinds.yaml', dump(KINDS)),
                       ('study.yaml', dump(STUDY | changed))):
        (folder / name).write_text(text, encoding='utf-8')
    Image.new('RGB', (320, 120), '#4a7').save(folder / 'road.png')
    return load_study(folder / 'study.yaml')


class DrivesWithoutGraph:
    """
    Takes drives through the session as soon as the participant is ready, and drives nothing.

    :param session: of the participant.
    :param link: of what is shown meanwhile.
    :param step_s: how long each phase lasts [s].
    """

    def __init__(self, session: ParticipantSession, link: str = '', step_s: float = 0.05) -> None:
        self.session, self.step_s = session, step_s
        self._link = link
        self._state = DriveState()
        self._changed: Callable[[], None] = lambda: None
        self._aborted = ''
        self._look()

    @property
    def state(self) -> DriveState:
        return self._state

    def watch(self, changed: Callable[[], None]) -> None:
        self._changed = changed

    def wake(self) -> None:
        if self._state.phase in (DrivePhase.NONE, DrivePhase.READY):
            self._look()

    def ready(self, item: str) -> None:
        if self._state.phase == DrivePhase.READY and self._state.item == item:
            attempt = self.session.start(run='runs/1')
            self._to(DrivePhase.COUNTDOWN, attempt=attempt, time_s=0.0)
            asyncio.get_running_loop().call_later(self.step_s, self._drive)

    def record(self, kind: str, text: str) -> None:
        """Nothing is recorded here."""

    def abort(self, reason: str) -> None:
        self._aborted = reason
        self._end()

    def _look(self) -> None:
        item = self.session.next_item
        if item is not None and is_driven(item):
            self._state = DriveState(DrivePhase.READY, item.id, link=self._link,
                                     attempt=self.session.attempts(item.id) + 1)
        else:
            self._state = DriveState(link=self._link)
        self._changed()

    def _drive(self) -> None:
        if self._state.phase == DrivePhase.COUNTDOWN:
            self._to(DrivePhase.DRIVING, time_s=0.01)
            asyncio.get_running_loop().call_later(self.step_s, self._end)

    def _end(self) -> None:
        if self._state.phase not in (DrivePhase.COUNTDOWN, DrivePhase.DRIVING):
            return
        item = self.session.next_item
        assert item is not None
        if self._aborted:
            self.session.abort(self._aborted)
        elif isinstance(item.what, PracticeDrives):
            self.session.practised(True, run='runs/1')
        else:
            self.session.finish(outcome='time', run='runs/1', end_time_s=0.02)
        self._aborted = ''
        self._look()

    def _to(self, phase: DrivePhase, **changed: Any) -> None:
        self._state = replace(self._state, phase=phase, **changed)
        self._changed()
