# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Messages that the desk's pages may send, and a study's pages and texts in its documents."""

import json
from pathlib import Path
import re
import sys

from crgame_ros.errors import InputError
from crgame_ros.paths import page_directory
from crgame_ros.study.desk.messages import Finish, FROM_EXPERIMENTER, FROM_PARTICIPANT, Note
from crgame_ros.study.desk.page_markdown import picture, read_tree
from crgame_ros.study.desk.pages import languages_of, WORDS, words_of
from crgame_ros.study.drive_watch import DrivePhase, DriveWork
from crgame_ros.study.file import Page
from crgame_ros.study.quality import CHECKS
from crgame_ros.study.session_journal import SessionEvent
from crgame_ros.yaml_text import read_yaml
import pytest

sys.path.insert(0, str(Path(__file__).parent))

from desk_support import write_study  # noqa: E402, I100


@pytest.mark.parametrize('message', [
    'x', '1', 'null', '{"type":"note"}', '{"type":"finish","item":5}',
    '{"type":"finish","item":"a","shown_at":NaN,"answered_at":1,"taken_s":1}',
    '{"type":"finish","item":"a","shown_at":1,"answered_at":1,"taken_s":-1}',
    '{"type":"finish","item":"a","shown_at":1,"answered_at":1,"taken_s":1,"answers":{"a":{}}}',
    '{"type":"finish","item":"a","shown_at":1,"answered_at":1,"taken_s":1,"answers":{"a":true}}',
    '{"type":"finish","item":"a","shown_at":1,"answered_at":1,"taken_s":1,"answers":{"a":[1]}}',
    f'{{"type":"ping","t":{"9" * 400}}}', '{"type":"hello","page":"x","fresh":true}',
    '{"type":"ready"}', '{"type":"language","language":null}'])
def test_messages_that_no_page_sends_are_refused(message: str) -> None:
    with pytest.raises(InputError):
        FROM_PARTICIPANT.read(message)


def test_messages_of_the_experimenter_need_their_fields() -> None:
    assert FROM_EXPERIMENTER.read('{"type":"note","text":"x","id":1,"more":2}') == Note(
        text='x', id=1)
    for message in ('{"type":"note","text":" ","id":1}', '{"type":"note","text":"x"}',
                    '{"type":"end","reason":"","id":1}', '{"type":"hold","held":1,"id":1}',
                    '{"type":"skip","item":"a","reason":"","id":1}',
                    '{"type":"mark","name":"","id":1}', '{"type":"ready","item":"a"}'):
        with pytest.raises(InputError):
            FROM_EXPERIMENTER.read(message)


def test_answers_keep_their_types_and_lose_what_is_no_character() -> None:
    found = FROM_PARTICIPANT.read(
        '{"type":"finish","item":"a","shown_at":1,"answered_at":2,"taken_s":1.5,"answers":'
        '{"a":3,"b":0.5,"c":["x"],"d":"\\ud800 \\ud83d\\ude00","e":null}}')
    assert isinstance(found, Finish)
    assert found.answers == {'a': 3, 'b': 0.5, 'c': ['x'], 'd': '\N{REPLACEMENT CHARACTER} '
                             '\N{GRINNING FACE}', 'e': None}
    assert isinstance(found.answers['a'], int) and isinstance(found.answers['b'], float)
    assert found.told() == {'shown_at': 1.0, 'answered_at': 2.0, 'taken_s': 1.5, 'after_s': {}}


def test_markdown_becomes_a_tree_without_html(tmp_path: Path) -> None:
    study = write_study(tmp_path / 'study')
    tree = read_tree(study, Page('welcome.md'), 'de')
    assert tree[0] == {'tag': 'h1', 'children': ['Welcome']}
    assert {'tag': 'em', 'children': ['other']} in tree[1]['children']
    assert '<script>document.title = "hurt"</script>' in tree[1]['children'][-1]
    assert tree[2]['tag'] == 'ol' and tree[2]['children'][0]['children'] == ['Take your seat.']
    assert tree[3]['tag'] == 'table'
    image, _, link, rest = tree[4]['children']
    assert (image['tag'], image['src'], image['alt']) == ('img', 'road.png', 'a road')
    assert link['href'] == 'https://example.org/' and 'javascript' in rest
    assert 'href' not in json.dumps(tree[4]['children'][3:])
    assert read_tree(study, Page('consent.md'), 'de')[0]['children'] == ['Zustimmung']
    assert picture(study, 'road.png') is not None and picture(study, '../road.png') is None
    with pytest.raises(InputError, match='no such page'):
        read_tree(study, Page('none.md'), 'en')


def test_words_of_another_language_come_from_a_file(tmp_path: Path) -> None:
    study = write_study(tmp_path / 'study')
    (study.base / 'words.fr.yaml').write_text('next: Continuer\n', encoding='utf-8')
    french = words_of(study, 'fr')
    assert french['next'] == 'Continuer' and french['agree'] == 'I agree'
    assert languages_of(study) == ['de', 'en', 'fr']
    (study.base / 'words.it.yaml').write_text('nxet: Avanti\n', encoding='utf-8')
    with pytest.raises(InputError, match='no word of the page'):
        words_of(study, 'it')


def test_all_words_are_in_each_language_with_the_same_gaps_to_fill() -> None:
    """The English words are those that journal and tables have, the same for each value."""
    english, *others = (read_yaml(WORDS / f'{name}.yaml', 'words') for name in ('en', 'de'))
    for words in others:
        assert list(words) == list(english)
        assert {key: set(re.findall(r'{\w+}', text)) for key, text in words.items()} == {
            key: set(re.findall(r'{\w+}', text)) for key, text in english.items()}
    assert {f'phase_{phase}' for phase in DrivePhase} == _begin('phase_', english)
    assert {f'work_{work}' for work in DriveWork if work} == _begin('work_', english)
    told = {f'log_{event}' for event in SessionEvent}
    assert told <= english.keys() and {'log_released', 'log_at'} < _begin('log_', english) - told
    assert {f'check_{name}': check.words for name, check in CHECKS.items()} == {
        key: english[key] for key in _begin('check_', english)}


def _begin(how: str, words: dict[str, str]) -> set[str]:
    return {key for key in words if key.startswith(how)}


def test_words_that_the_pages_name_are_there_and_the_experimenters_are_all_used() -> None:
    """Some are named by a code of the server: how a session ended, and orders."""
    words = read_yaml(WORDS / 'en.yaml', 'words')
    pages = page_directory() / 'desk'
    text = '\n'.join(path.read_text(encoding='utf-8') for path in (
        *pages.glob('*.html'), *pages.glob('js/*.ts')))
    named = set(re.findall(r"(?:words\.of\(|data-word=)\s*['\"](\w+)['\"]", text))
    assert len(named) > 50 and named <= words.keys()
    orders = {'desk_abort', 'desk_abort_text', 'desk_skip', 'desk_skip_text'}
    ends = {f'desk_over_{how}' for how in ('done', 'declined', 'excluded', 'ended')}
    assert _begin('desk_', words) - set(re.findall(r'\w+', text)) == orders | ends
