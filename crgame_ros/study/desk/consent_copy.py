# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The participant's copy of the consent: one HTML file, without anybody's name."""

from base64 import b64encode
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from datetime import datetime, UTC
from html import escape
from urllib.parse import urlsplit

from crgame_ros.study.desk.page_markdown import Node, picture, read_tree
from crgame_ros.study.file import Page, StudyFile
from crgame_ros.study.pages import consent_of

_EMPTY = ('br', 'hr')
_STYLE = ('body { max-width: 44rem; margin: 2rem auto; padding: 0 1rem; }'
          ' body { font: 1rem/1.5 sans-serif; }'
          ' img { max-width: 100%; } table { border-collapse: collapse; }'
          ' th, td { padding: 0.3rem 0.6rem; border: 1px solid #888; }'
          ' footer { margin-top: 2rem; border-top: 1px solid #888; overflow-wrap: anywhere; }')


@dataclass(frozen=True)
class ConsentCopy:
    """
    A file for the participant.

    :param name: of the file.
    :param html: its content.
    """

    name: str
    html: str


def consent_copy(study: StudyFile, page: Page, language: str, participant: str, at_s: float,
                 words: Mapping[str, str]) -> ConsentCopy:
    """
    Return the copy of a consent, with its pictures in it.

    :param participant: id, by which the participant can have the data deleted.
    :param at_s: when the copy is made [s since 1970]
    :param words: of the page, in the language.
    :raises InputError: if the page cannot be read.
    """
    told = consent_of(study, page, language)
    day = datetime.fromtimestamp(at_s, UTC).date().isoformat()
    title = study.title.in_language(language) or study.name
    values = {**told, 'study': title, 'date': day, 'participant': participant}
    facts = [_filled(words[key], values) for key in (
        'copy_of', *(('copy_version',) if told['version'] else ()), 'copy_digest', 'copy_id')]
    body = _html(study, read_tree(study, page, language))
    lines = ''.join(f'<p>{escape(fact)}</p>' for fact in facts)
    name = '_'.join(filter(None, (study.name, 'consent', told['sha256'][:8], language)))
    return ConsentCopy(f'{name}.html', (
        f'<!DOCTYPE html>\n<html lang="{escape(language)}"><head><meta charset="utf-8">'
        f'<meta name="viewport" content="width=device-width, initial-scale=1">'
        f'<title>{escape(title)}</title><style>{_STYLE}</style></head>\n'
        f'<body><main>{body}</main>\n<footer>{lines}</footer></body></html>\n'))


def _filled(text: str, values: Mapping[str, str]) -> str:
    """Return words with values in the places of their names, as the pages' script fills them."""
    for name, value in values.items():
        text = text.replace(f'{{{name}}}', value)
    return text


def _html(study: StudyFile, nodes: Iterable[Node]) -> str:
    """Return elements of a page as HTML; their tags are those that `read_tree` makes."""
    parts = []
    for node in nodes:
        if isinstance(node, str):
            parts.append(escape(node))
        elif node['tag'] == 'img':
            parts.append(_picture(study, node['src'], node['alt']))
        elif node['tag'] in _EMPTY:
            parts.append(f'<{node["tag"]}>')
        else:
            href = f' href="{escape(node["href"])}"' if 'href' in node else ''
            parts.append(f'<{node["tag"]}{href}>{_html(study, node.get("children", ()))}'
                         f'</{node["tag"]}>')
    return ''.join(parts)


def _picture(study: StudyFile, source: str, words: str) -> str:
    file = picture(study, urlsplit(source).path) if source else None
    if file is None:
        return escape(words)
    return (f'<img alt="{escape(words)}" src="data:{file.content_type};base64,'
            f'{b64encode(file.body).decode()}">')
