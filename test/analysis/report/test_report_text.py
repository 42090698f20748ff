# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Foreign text comes out as text."""

from html.parser import HTMLParser
import math

from crgame_ros.analysis.report.section import free, number, plain, share, table
import pytest


class _Reader(HTMLParser):

    def __init__(self) -> None:
        super().__init__()
        self.tags: list[str] = []
        self.text = ''

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)

    def handle_data(self, data: str) -> None:
        self.text += data


def _read(html: str) -> _Reader:
    reader = _Reader()
    reader.feed(html)
    reader.close()
    return reader


@pytest.mark.parametrize('text', [
    '<img src=x onerror=alert(1)>', '"><script>alert(1)</script>', "it's & <b>bold</b>", '&lt;',
    '👩‍🚗 drives', 'שלום', '']
)
def test_markup_quotes_and_emoji_are_text(text: str) -> None:
    """A parser of HTML reads the same text, and no element but the one that isolates it."""
    found = _read(free(text))
    assert found.tags == ['bdi'] and found.text == text
    attribute = _read(f'<p title="{plain(text)}">')
    assert attribute.tags == ['p']


def test_what_hides_is_named() -> None:
    """Bidi overrides, controls and halves of characters; the text can be written as UTF-8."""
    found = plain('a\u202eb\u2066c\x00d\ud800e\nf')
    assert found == 'a⟨U+202E⟩b⟨U+2066⟩c⟨U+0000⟩d⟨U+D800⟩e f'
    assert found.encode('utf-8')
    assert len(plain('x' * 10_000_000)) < 3000


def test_numbers_are_written_for_people() -> None:
    """With a true minus, and never as nan."""
    assert [number(value) for value in (1.005, -2.0, -0.001, math.nan, None, math.inf)] == [
        '1.00', '−2.00', '0.00', '–', '–', '∞']
    assert (share(1, 3), share(1, 0), share(None, 3)) == ('33.3 %', '–', '–')


def test_tables_name_rows_and_columns() -> None:
    """As screen readers need it: a caption, and headings with their scope."""
    html = table('Of <b>x</b>', ('a', 'b'), [('1', '2')])
    assert '<caption>Of <b>x</b></caption>' in html and 'aria-label="Of x"' in html
    assert html.count('scope="col"') == 2 and html.count('scope="row"') == 1
