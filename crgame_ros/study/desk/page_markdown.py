# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Converts a study's Markdown pages to trees of page elements, without any raw HTML."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any
from urllib.parse import unquote, urlsplit

from crgame_ros.cockpit.page_files import PageFile
from crgame_ros.errors import InputError
from crgame_ros.study.file import Page, StudyFile
from crgame_ros.study.pages import page_file, steps_of
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
Node = str | dict[str, Any]


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
    tree = SyntaxTreeNode(_parser().parse(text))
    return tuple(_nodes(tree.children))


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


def _parser() -> MarkdownIt:
    # HTML is off: it is shown as text.
    return MarkdownIt('commonmark', {'html': False}).enable(['table', 'strikethrough'])


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
