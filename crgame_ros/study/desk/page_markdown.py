# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A study's Markdown pages as trees of elements, and the participant's copy of the consent."""

from base64 import b64encode
from collections.abc import Iterable, Iterator, Mapping
from datetime import datetime, UTC
from html import escape
from pathlib import Path
from typing import TypeAlias, TypedDict
from urllib.parse import unquote, urlsplit

from crgame_ros.cockpit.page_files import PageFile
from crgame_ros.errors import InputError
from crgame_ros.study.file import Page, StudyFile
from crgame_ros.study.questionnaire import consent_of, page_file, steps_of
from markdown_it import MarkdownIt
from markdown_it.token import Token
from markdown_it.tree import SyntaxTreeNode

MOST_BYTES = 1_000_000
MOST_PICTURE_BYTES = 20_000_000
PICTURES = {'.png': 'image/png', '.jpg': 'image/jpeg', '.jpeg': 'image/jpeg',
            '.gif': 'image/gif', '.webp': 'image/webp'}
# The elements of a page; the page's script creates only these.
TAGS = {'heading', 'paragraph', 'bullet_list', 'ordered_list', 'list_item', 'blockquote', 'hr',
        'em', 'strong', 's', 'table', 'thead', 'tbody', 'tr', 'th', 'td'}
Element = TypedDict('Element', {  # noqa: UP013
    'tag': str, 'children': list['Node'], 'href': str, 'src': str, 'alt': str}, total=False)
Node: TypeAlias = str | Element
_EMPTY = ('br', 'hr')
_STYLE = ('body { max-width: 44rem; margin: 2rem auto; padding: 0 1rem; }'
          ' body { font: 1rem/1.5 sans-serif; }'
          ' img { max-width: 100%; } table { border-collapse: collapse; }'
          ' th, td { padding: 0.3rem 0.6rem; border: 1px solid #888; }'
          ' footer { margin-top: 2rem; border-top: 1px solid #888; overflow-wrap: anywhere; }')


def read_tree(study: StudyFile, page: Page, language: str) -> tuple[Node, ...]:
    """
    Read a page.

    :return: texts, and elements `{tag, children}`; a link has `href`, a picture `src`, `alt`.
    :raises InputError: if it cannot be read.
    """
    file = page_file(study, page, language)
    if file is None:
        raise InputError('there is no such page', str(study.base / page.file), 'write it')
    try:
        with file.open('rb') as stream:
            content = stream.read(MOST_BYTES + 1)
        text = content.decode('utf-8-sig')
    except (OSError, ValueError) as error:
        raise InputError('cannot be read', str(file), 'write it as UTF-8') from error
    if len(content) > MOST_BYTES:
        raise InputError(f'is longer than {MOST_BYTES} bytes', str(file), 'make it shorter')
    # HTML is off: it is shown as text.
    parser = MarkdownIt('commonmark', {'html': False}).enable(['table', 'strikethrough'])
    return tuple(_nodes(SyntaxTreeNode(parser.parse(text)).children))


def pictures_of(study: StudyFile) -> tuple[str, ...]:
    """
    Return the pictures of all existing pages, relative to the study's folder.

    :raises InputError: if a page cannot be read.
    """
    left: list[Node] = [
        node for step in steps_of(study) if isinstance(step, Page)
        for language in study.all_languages for node in read_tree(study, step, language)]
    names: dict[str, None] = {}
    while left:
        node = left.pop()
        if isinstance(node, dict):
            left += node.get('children', ())
            name = node.get('src', '')
            if name and picture(study, name) is not None:
                names[name] = None
    return tuple(names)


def picture(study: StudyFile, name: str) -> PageFile | None:
    """
    Read a picture beside a study's pages, or in a folder below.

    :param name: relative to the study's folder.
    :return: None if there is none.
    """
    base = study.base.resolve()
    try:
        path = (base / name).resolve()
        if path.suffix.lower() not in PICTURES or not path.is_relative_to(base) \
                or not path.is_file() or path.stat().st_size > MOST_PICTURE_BYTES:
            return None
        body = path.read_bytes()
    except (OSError, ValueError):
        return None
    return PageFile(body, PICTURES[path.suffix.lower()])


def _nodes(nodes: list[SyntaxTreeNode]) -> Iterator[Node]:
    for node in nodes:
        if node.type == 'inline' or (node.type == 'paragraph' and _is_tight(node)):
            yield from _nodes(node.children)
        elif node.type == 'text':
            yield node.content
        elif node.type == 'softbreak':
            yield '\n'
        elif node.type == 'hardbreak':
            yield {'tag': 'br'}
        elif node.type == 'code_inline':
            yield {'tag': 'code', 'children': [node.content]}
        elif node.type in ('fence', 'code_block'):
            yield {'tag': 'pre', 'children': [node.content]}
        elif node.type == 'link':
            yield _link(node)
        elif node.type == 'image':
            yield {'tag': 'img', 'src': _source(str(node.attrs.get('src', ''))),
                   'alt': node.content}
        elif node.type in TAGS:
            yield {'tag': node.tag, 'children': list(_nodes(node.children))}


def _is_tight(node: SyntaxTreeNode) -> bool:
    opening: Token | None = None if node.nester_tokens is None else node.nester_tokens.opening
    return opening is not None and opening.hidden


def _link(node: SyntaxTreeNode) -> Node:
    children = list(_nodes(node.children))
    href = str(node.attrs.get('href', ''))
    if urlsplit(href).scheme not in ('http', 'https', 'mailto'):
        return {'tag': 'span', 'children': children}
    return {'tag': 'a', 'href': href, 'children': children}


def _source(given: str) -> str:
    """Return the name of a picture beside the page; empty for one from elsewhere."""
    parts = urlsplit(given)
    name = unquote(parts.path)
    return '' if parts.scheme or parts.netloc or name.startswith('/') \
        or Path(name).suffix.lower() not in PICTURES else name


def consent_copy(study: StudyFile, page: Page, language: str, participant: str, at_s: float,
                 words: Mapping[str, str]) -> tuple[str, str]:
    """
    Return the copy of a consent as HTML, with its pictures in it.

    :param participant: id, by which the participant can have the data deleted.
    :param at_s: when the copy is made [s since 1970]
    :param words: of the page, in the language.
    :return: the name of its file, and its content.
    :raises InputError: if the page cannot be read.
    """
    told = consent_of(study, page, language)
    day = datetime.fromtimestamp(at_s, UTC).date().isoformat()
    title = study.title_in(language)
    values = {**told, 'study': title, 'date': day, 'participant': participant}
    facts = [_filled(words[key], values) for key in (
        'copy_of', *(('copy_version',) if told['version'] else ()), 'copy_digest', 'copy_id')]
    body = _html(study, read_tree(study, page, language))
    lines = ''.join(f'<p>{escape(fact)}</p>' for fact in facts)
    name = '_'.join(filter(None, (study.name, 'consent', told['sha256'][:8], language)))
    return f'{name}.html', (
        f'<!DOCTYPE html>\n<html lang="{escape(language)}"><head><meta charset="utf-8">'
        f'<meta name="viewport" content="width=device-width, initial-scale=1">'
        f'<title>{escape(title)}</title><style>{_STYLE}</style></head>\n'
        f'<body><main>{body}</main>\n<footer>{lines}</footer></body></html>\n')


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
