# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A consent is a document with a version, of which the participant gets a copy."""

from datetime import date
import hashlib
from html.parser import HTMLParser
from pathlib import Path
import sys
from typing import Any

from crgame_ros.cli import main
from crgame_ros.errors import InputError
from crgame_ros.schema.reading import read
from crgame_ros.study.file import load_study, StudyFile
from crgame_ros.study.folder import StudyFolder
from crgame_ros.study.participant_session import ParticipantSession
from crgame_ros.study.session_journal import read_journal
import pytest

sys.path.insert(0, str(Path(__file__).parent))

from desk_client import in_loop, served, shown, shows, TIMES  # noqa: E402, I100
from desk_support import ZUSTIMMUNG  # noqa: E402, I100

VERSION = '2 of 2026-11'
CONSENT = {'before': [{'page': {'file': 'consent.md', 'consent': True, 'version': VERSION}}],
           'fields': []}


class Read(HTMLParser):
    """The tags and the text of a page."""

    def __init__(self, html: str) -> None:
        super().__init__()
        self.tags: set[str] = set()
        self.text = ''
        self.feed(html)

    def handle_starttag(self, tag: str, attrs: Any) -> None:
        self.tags.add(tag)

    def handle_data(self, data: str) -> None:
        self.text += data


@in_loop
async def test_the_version_that_was_agreed_to_is_noted(tmp_path: Path) -> None:
    await read_and_decide(tmp_path, agreed=True)


@in_loop
async def test_the_version_that_was_declined_is_noted(tmp_path: Path) -> None:
    await read_and_decide(tmp_path, agreed=False)


async def read_and_decide(tmp_path: Path, *, agreed: bool) -> None:
    """Read a consent in German, keep a copy, and agree to it or not."""
    async with served(tmp_path, **CONSENT) as running:
        socket = await running.join()
        await shown(socket, shows('language'))
        await socket.send_json({'type': 'language', 'language': 'de'})
        await shown(socket, shows('page'))
        async with running.http.get(f'{running.root}/consent') as answer:
            assert 'attachment' in answer.headers['Content-Disposition']
            copy = Read(await answer.text())
        await socket.send_json({'type': 'finish', 'item': 'before/1', 'agreed': agreed, **TIMES})
        await shown(socket, lambda content: content.get('item') != 'before/1')
        entry = running.desk.session.journal.entries[-1]
        assert entry['entry'] == ('finished' if agreed else 'ended')
        digest = hashlib.sha256(ZUSTIMMUNG.encode()).hexdigest()
        assert entry['consent'] == {'file': 'consent.de.md', 'version': VERSION,
                                    'sha256': digest, 'language': 'de'}
        assert {'h1', 'strong', 'footer'} <= copy.tags and 'script' not in copy.tags
        for part in ('Ihre Antworten werden ohne Ihren Namen', VERSION, digest,
                     'Einfädeln mit anderen', 'Ihre Nummer in dieser Studie: P07'):
            assert part in copy.text, part
        async with running.http.get(f'{running.root}/consent') as answer:
            assert answer.status == 404


@pytest.mark.parametrize(('retention', 'last_day'), [
    ({'months': 1}, date(2027, 2, 28)), ({'months': 14}, date(2028, 3, 31)),
    ({'until': '2030-12-31'}, date(2030, 12, 31))])
def test_data_are_kept_until_a_day(retention: dict[str, object], last_day: date,
                                   tmp_path: Path) -> None:
    """A session at the end of January 2027."""
    study = read(StudyFile, {'name': 'demo', 'blocks': [{'name': 'main'}],
                             'retention': retention}, 'study')
    with ParticipantSession(study, tmp_path / 'participants' / 'P01', 'P01', 0,
                            lambda: 1_801_400_000.0):
        pass
    folder = StudyFolder(tmp_path)
    assert folder.overdue(study, last_day) == []
    assert folder.overdue(study, last_day.replace(year=last_day.year + 1)) == [('P01', last_day)]


@pytest.mark.parametrize('retention', [{}, {'months': 2, 'until': '2030-01-01'},
                                       {'until': '2030-02-30'}, {'until': 'soon'}])
def test_a_retention_without_one_end_is_refused(retention: dict[str, object]) -> None:
    with pytest.raises(InputError, match='retention'):
        read(StudyFile, {'name': 'demo', 'blocks': [{'name': 'main'}], 'retention': retention},
             'study')


def test_check_tells_who_is_kept_too_long(tmp_path: Path,
                                          capsys: pytest.CaptureFixture[str]) -> None:
    assert main(['study', 'new', str(tmp_path / 'mine')]) == 0
    file = tmp_path / 'mine' / 'study.yaml'
    file.write_text(file.read_text('utf-8') + 'retention: {until: 2020-01-01}\n', 'utf-8')
    with ParticipantSession(load_study(file), tmp_path / 'out' / 'participants' / 'P03', 'P03',
                            0):
        pass
    assert read_journal(tmp_path / 'out' / 'participants' / 'P03')
    capsys.readouterr()
    assert main(['study', 'check', str(file), '--out', str(tmp_path / 'out'),
                 '--participants', '0']) == 0
    assert 'P03: to be kept until 2020-01-01: crgame study withdraw' in capsys.readouterr().err
