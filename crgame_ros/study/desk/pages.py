# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The open pages of a desk: their documents, and the page that the participant uses."""

from collections.abc import Mapping
from functools import cache
import json
import logging
from pathlib import Path
import re

from crgame_ros.cockpit.client import Client
from crgame_ros.errors import CrgameError, InputError
from crgame_ros.study.desk.desk import Desk
from crgame_ros.study.desk.messages import (
    End,
    ExperimenterMessage,
    ExperimenterOrder,
    Finish,
    Hello,
    Here,
    Hold,
    Language,
    Mark,
    Note,
    ParticipantMessage,
    Ping,
    Ready,
    Reasoned,
)
from crgame_ros.study.desk.participant_document import experimenter_document, participant_document
from crgame_ros.study.file import StudyFile
from crgame_ros.yaml_text import read_yaml

WORDS = Path(__file__).resolve().parent / 'words'
STANDARD = 'en'
_LANGUAGE = re.compile('[a-z]{2,3}')


def words_of(study: StudyFile, language: str) -> dict[str, str]:
    """
    Return the words of the pages in a language; missing ones in English.

    :param study: `words.fr.yaml` beside its file adds or overrides the French words.
    :return: by their key.
    :raises InputError: if a file of words cannot be read.
    """
    words = dict(_read(WORDS / f'{STANDARD}.yaml'))
    for file in (WORDS / f'{language}.yaml', study.base / f'words.{language}.yaml'):
        if language.isalnum() and file.is_file():
            given = _read(file)
            unknown = sorted(set(given) - set(words))
            if unknown:
                raise InputError(f'has "{unknown[0][:40]}", which is no word of the page',
                                 str(file), f'take the keys of {STANDARD}.yaml')
            words |= given
    return words


def languages_of(study: StudyFile) -> list[str]:
    """Return the languages that have words: this package's, and those beside a study's file."""
    names = (path.stem.removeprefix('words.') for path in (
        *WORDS.glob('*.yaml'), *study.base.glob('words.*.yaml')))
    return sorted({name for name in names if _LANGUAGE.fullmatch(name)})


@cache
def _read(file: Path) -> dict[str, str]:
    given = read_yaml(file, 'words')
    if not isinstance(given, dict) or not all(
            isinstance(key, str) and isinstance(text, str) for key, text in given.items()):
        raise InputError('is no list of words', str(file), 'give texts by their key')
    return given


# A page says every second that it is there; one that is frozen or hidden says nothing [s].
SILENT_S = 5.0
# The run's clock changes with every cycle; faster updates are not readable.
TOLD_EVERY_S = 0.2

_log = logging.getLogger(__name__)


class DeskPages:
    """
    Sends documents to pages, and passes their messages to the desk.

    If the participant has several pages open, only the last one is used; the others say so.

    :param desk: whose pages they are.
    """

    def __init__(self, desk: Desk) -> None:
        self.desk = desk
        self._participants: dict[Client, str] = {}
        # The language of the words sent to each page.
        self._worded: dict[Client, str] = {}
        self._experimenters: set[Client] = set()
        self._used: Client | None = None
        self._used_page = ''
        self._told: dict[str, object] = {}
        self._is_due = False
        desk.watch(self._changed)

    def joined(self, client: Client, *, experimenter: bool) -> None:
        """Add a page; a participant's page gets nothing before its hello."""
        if experimenter:
            self._experimenters.add(client)
            client.put_document('desk', self._experimenter_text())
        else:
            self._participants[client] = ''

    def left(self, client: Client) -> None:
        """Remove a page."""
        self._experimenters.discard(client)
        self._participants.pop(client, None)
        self._worded.pop(client, None)
        if client is self._used:
            self._used = None
            self._told = {}
        self._changed()

    @property
    def clients(self) -> list[Client]:
        """Return all pages."""
        return [*self._participants, *self._experimenters]

    @property
    def page(self) -> dict[str, object]:
        """
        Return the state of the participant's page: connected, delays [ms], seat.

        Of a silent page nothing is known but `silent_s`, the time since it was heard.
        """
        told = self._told
        if self._is_silent:
            told = {'silent_s': round(self.desk.clock_s() - self.desk.heard_s),
                    **{name: value for name, value in told.items() if name == 'error'}}
        return {'connected': self._used is not None, 'open': len(self._participants), **told}

    @property
    def _is_silent(self) -> bool:
        return self._used is not None and self.desk.clock_s() - self.desk.heard_s > SILENT_S

    def update_experimenters(self) -> None:
        """Send the present document to the experimenter's pages."""
        self._is_due = False
        if self._experimenters:
            text = self._experimenter_text()
            for client in self._experimenters:
                client.put_document('desk', text)

    @property
    def is_due(self) -> bool:
        """Return whether the experimenter's pages lack a change."""
        return self._is_due or self._is_silent

    def participant_says(self, client: Client, message: ParticipantMessage) -> None:
        """
        Process a message of a participant's page.

        :raises CrgameError: if the session refuses it.
        """
        if isinstance(message, Hello | Here):
            if isinstance(message, Hello):
                self._participants[client] = message.page
            page = self._participants[client]
            if isinstance(message, Here) or message.fresh or page == self._used_page \
                    or not self._used:
                self._used, self._used_page, self._told = client, page, {}
                self.desk.heard_s = self.desk.clock_s()
            self._changed()
            return
        if isinstance(message, Ping):
            if client is self._used:
                self._is_due = self._is_due or self._is_silent
                self.desk.heard_s = self.desk.clock_s()
                if message.round_trip_ms is not None:
                    self.desk.hear_round_trip(message.round_trip_ms)
                told = message.model_dump(exclude={'type', 't'}, exclude_none=True)
                self._is_due = self._is_due or told != self._told
                self._told = told
            self._answer(client, message)
            return
        if client is self._used:
            try:
                self._do(message)
            except InputError as error:
                client.put_event(_text({'type': 'refused', 'item': getattr(message, 'item', ''),
                                        'text': str(error)}))
        # Also after an outdated message, so that the page learns the session's state.
        self._send_participant(client)

    def experimenter_says(self, client: Client, message: ExperimenterMessage) -> None:
        """Process and answer a message of an experimenter's page."""
        if isinstance(message, Ping):
            self._answer(client, message)
            return
        if isinstance(message, Language):
            self._word_experimenter(client, message.language)
            return
        ok, text = True, ''
        try:
            self._order(message)
        except CrgameError as error:
            ok, text = False, str(error)
        client.put_event(_text({'type': 'reply', 'to': message.id, 'ok': ok, 'text': text}))
        self.update_experimenters()

    def _answer(self, client: Client, ping: Ping) -> None:
        client.put_event(_text({'type': 'pong', 't': ping.t, 'at': self.desk.clock_s()}))

    def _do(self, message: Language | Ready | Finish) -> None:
        match message:
            case Language():
                self.desk.choose_language(message.language)
            case Ready():
                self.desk.ready(message.item)
            case Finish():
                self.desk.finish(message.item, message.answers, message.agreed, **message.told())

    def _order(self, message: ExperimenterOrder) -> None:
        match message:
            case Note():
                self.desk.note(message.text)
            case Mark():
                self.desk.mark(message.name)
            case Reasoned(type='repeat'):
                self.desk.repeat(message.item, message.reason)
            case Reasoned(type='skip'):
                self.desk.skip(message.item, message.reason)
            case Reasoned():
                self.desk.abort(message.item, message.reason)
            case End():
                self.desk.end(message.reason)
            case Hold():
                self.desk.hold(message.held)

    def _changed(self) -> None:
        self._is_due = True
        for client in self._participants:
            self._send_participant(client)

    def _send_words(self, client: Client) -> None:
        """Send the words of the page before its content."""
        language = self.desk.language
        if self._worded.get(client) != language:
            self._worded[client] = language
            client.put_event(_text({'type': 'words', 'language': language,
                                    'words': words_of(self.desk.session.study, language)}))

    def _word_experimenter(self, client: Client, wanted: str) -> None:
        """Send the words of an experimenter's page, which has a language of its own."""
        study = self.desk.session.study
        languages = languages_of(study)
        language = wanted if wanted in languages else STANDARD
        try:
            words = words_of(study, language)
        except InputError as error:
            # Without its words the page could not show what is wrong with them.
            _log.error('%s', error)
            language, words = STANDARD, _read(WORDS / f'{STANDARD}.yaml')
        client.put_event(_text({'type': 'words', 'language': language, 'languages': languages,
                                'words': words}))

    def _send_participant(self, client: Client) -> None:
        if not self._participants.get(client):
            return
        try:
            self._send_words(client)
            document = participant_document(self.desk)
        except CrgameError as error:
            # A page of the study is missing: the experimenter has to add it.
            _log.error('%s', error)
            self._told = {**self._told, 'error': str(error)}
            document = {'show': 'wait', 'why': 'failed', 'item': '',
                        'language': self.desk.language}
        if client is not self._used:
            document = {'show': 'elsewhere', 'item': '', 'language': self.desk.language,
                        'study': document.get('study', '')}
        client.put_document('desk', _text({'type': 'desk', **document}))

    def _experimenter_text(self) -> bytes:
        return _text({'type': 'desk', 'at': self.desk.clock_s(),
                      **experimenter_document(self.desk, self.page)})


def _text(message: Mapping[str, object]) -> bytes:
    # A page may send lone surrogates, which UTF-8 cannot encode: they stay escaped.
    return json.dumps(message, allow_nan=False).encode()
