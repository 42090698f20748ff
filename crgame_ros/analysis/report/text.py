# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Text and numbers as HTML; text from a recording is always escaped."""

from collections.abc import Iterable, Sequence
from html import escape
import math
import re

NOTHING = '–'
# Characters that hide or reorder the text around them: control characters, lone surrogates of
# UTF-16, and direction marks. Joiners stay, because emoji need them.
_UNSEEN = re.compile('[\x00-\x1f\x7f-\x9f\u061c\u200e\u200f\u2028-\u202e\u2066-\u2069\ud800-\udfff'
                     '\ufdd0-\ufdef\ufffe\uffff]')
_TAGS = re.compile('<[^>]*>')
_SPACES = '\t\n\r'
# Greatest length of a text in a table: a scenario may contain megabytes.
_LONGEST = 2000


def plain(value: object) -> str:
    """Escape text for a place where no markup is allowed, such as `<title>`."""
    text = str(value)
    if len(text) > _LONGEST:
        text = f'{text[:_LONGEST]} … ({len(text)} characters)'
    return escape(_UNSEEN.sub(_named, text))


def free(value: object) -> str:
    """Escape text from a user, and isolate its writing direction."""
    return f'<bdi>{plain(value)}</bdi>'


def _named(found: re.Match[str]) -> str:
    return ' ' if found[0] in _SPACES else f'⟨U+{ord(found[0]):04X}⟩'


def number(value: float | None, digits: int = 2) -> str:
    """Return a number as text with a true minus sign; a dash for an unknown one."""
    if value is None or math.isnan(value):
        return NOTHING
    if math.isinf(value):
        return '∞' if value > 0.0 else '−∞'
    text = f'{value:.{digits}f}'
    return text.replace('-', '−') if float(text) else text.removeprefix('-')


def share(part: float | None, whole: float | None) -> str:
    """Return the share of a part in a whole as text."""
    if not whole or part is None:
        return NOTHING
    return f'{100.0 * part / whole:.1f} %'


def table(caption: str, head: Sequence[str], rows: Iterable[Sequence[str]],
          kind: str = '') -> str:
    """
    Return a table whose rows are named by their first cells.

    :param caption: HTML, as all cells are.
    :param head: names of the columns; empty for none.
    :param kind: its CSS class.
    """
    columns = ''.join(f'<th scope="col">{cell}</th>' for cell in head)
    body = ''.join(
        f'<tr><th scope="row">{row[0]}</th>'
        + ''.join(f'<td>{cell}</td>' for cell in row[1:]) + '</tr>' for row in rows)
    name = _TAGS.sub('', caption)
    return (f'<div class="wide" tabindex="0" role="region" aria-label="{name}">'
            f'<table class="{kind}"><caption>{caption}</caption>'
            + (f'<thead><tr>{columns}</tr></thead>' if head else '')
            + f'<tbody>{body}</tbody></table></div>')


def note(html: str) -> str:
    """Return a remark of lower emphasis as HTML."""
    return f'<p class="note">{html}</p>'


def marked(text: str, critical: bool) -> str:
    """Return a text as HTML, marked if it is critical: not by colour alone."""
    return f'<strong class="critical">{text}<span class="sign"> ‼</span></strong>' \
        if critical else text
