# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Write the tables of keys in the documentation from the declarations in the code.

A table in another page stands between two comments: <!-- keys: game.object_spec:ObjectSpec --> and
<!-- keys: end -->.
"""

from collections.abc import Iterator
from dataclasses import is_dataclass, MISSING
import importlib
import inspect
import math
from pathlib import Path
import re
import sys
from typing import Any, get_args, get_origin

from crgame_ros.models_command import purpose_of, REGISTRIES, registry_of
from crgame_ros.schema.declaration import (
    choices_of,
    form_of,
    Key,
    keys_of,
    mark_of,
    sentences_of,
    split,
    wanted,
)
from crgame_ros.schema.file_kinds import FILE_KINDS
from crgame_ros.schema.marks import Folder, Keyed, Meaning, Numbered, OnlyWith, Special
from crgame_ros.schema.model_options import options_of
from crgame_ros.schema.writing import write
from written import escaped, main_of, table

DOCS = Path(__file__).resolve().parent.parent / 'docs'
REFERENCE = DOCS / 'keys.md'
NOTICE = (
    '# Every key\n\nOf every file that users write; made from the declarations in the code by '
    '`scripts/make_key_tables.py`.\n`crgame schema` gives the same as JSON Schema. What the keys '
    'are for stands in the pages about [games](games.md),\n[objects](objects.md), '
    '[perception](perception.md), [traffic](traffic.md), [control](control.md), '
    '[drivers and devices](driving.md),\n[maps](occupancy.md) and [studies](studies.md).')
_TABLE = re.compile(r'(<!-- keys: ([\w.]+):(\w+) -->\n).*?(<!-- keys: end -->)', re.DOTALL)


def reference() -> str:
    """Return the page of every key."""
    parts, done = [NOTICE], set[Any]()
    for file_kind in FILE_KINDS.values():
        top = file_kind.declared
        for label, kind in sections(file_kind.title, top):
            if kind not in done:
                done.add(kind)
                parts += [f'{"##" if kind is top else "###"} {label}', summary(kind),
                          keys_table(kind)]
    return '\n\n'.join([*parts, *model_parts()]) + '\n'


def model_parts() -> Iterator[str]:
    """Yield the options of everything that a game may name."""
    yield ('## Options of models\n\nOf the planners, trackers and so on that ship; '
           '`crgame models` lists your own as well.')
    for kind in REGISTRIES:
        registry = registry_of(kind)
        for name in registry.names():
            yield f'### {kind.replace("-", " ")} `{name}`'
            yield escaped(purpose_of(registry.find(name)))
            if options := options_of(registry, name):
                yield table(('option', 'value', 'default', 'meaning'), (
                    (f'`{each.name}`', escaped(each.wanted), each.default or 'needed',
                     escaped(each.meaning)) for each in options))


def sections(label: str, kind: Any) -> Iterator[tuple[str, Any]]:
    """Yield a dataclass and all that it holds, by the keys that lead there."""
    yield label, kind
    for key in keys_of(kind):
        keyed = key.mark(Keyed)
        several = [] if key.mark(Special) else list(held(key.hint))
        inner = [(f'{keyed.noun} `{name}`', one) for name, hint in keyed.kinds.items()
                 for one in held(hint)] if keyed \
            else [(f'`{key.name}`' + (f' with `{keys_of(one)[0].name}`' if several[1:] else ''),
                   one) for one in several]
        for name, one in inner:
            yield from sections(name, one)


def held(hint: Any) -> Iterator[Any]:
    """Yield the dataclasses that a type is made of."""
    kind, marks = split(hint)
    for choice in () if mark_of(marks, Special) else choices_of(kind):
        if isinstance(choice, type) and is_dataclass(choice):
            yield choice
        else:
            for inner in get_args(choice):
                yield from held(inner)


def summary(kind: Any) -> str:
    """Return the first sentence of a docstring, and what a bare text stands for."""
    text = inspect.cleandoc(kind.__doc__ or '').split('\n')[0]
    form = form_of(kind)
    if form.short:
        text += f' A bare text is short for `{{{form.short}: …}}`.'
    return escaped(text)


def keys_table(kind: Any) -> str:
    """Return the keys of a dataclass as a table."""
    rows = []
    form, sentences = form_of(kind), sentences_of(kind)
    for key in keys_of(kind):
        keyed = key.mark(Keyed)
        if key.mark(Folder):
            continue
        name = 'one of ' + ', '.join(f'`{item}`' for item in keyed.kinds) if keyed \
            else 'all other keys' if key.field == form.rest else f'`{key.name}`'
        rows.append([name, value(key, kind), default(key), meaning(key, sentences)])
    for name, section in form.moved:
        rows.append([f'`{name}`', f'as in `{section}`', '',
                     f'short for `{section}: {{{name}: …}}`'])
    return table(('key', 'value', 'default', 'meaning'), rows)


def value(key: Key, kind: Any) -> str:
    """Return the allowed values."""
    if key.mark(Keyed):
        return 'a mapping'
    choices = form_of(kind).choices.get(key.name)
    if choices:
        return '; '.join(f'{by}: {", ".join(words)}' for by, words in choices.items())
    if len(list(held(key.hint))) == 1:
        lists = any(get_origin(choice) is tuple for choice in choices_of(key.hint))
        return 'a list of mappings' if lists else 'a mapping'
    text = wanted(key.hint, tuple(mark for mark in key.marks if not isinstance(mark, Meaning)))
    words = [str(mark.written) for mark in key.marks if isinstance(mark, Meaning)
             and isinstance(mark.written, str)]
    return escaped(', or '.join([text.removeprefix('use ').removeprefix('one of '), *words]))


def default(key: Key) -> str:
    """Return the default without the key."""
    numbered = key.mark(Numbered)
    if numbered is not None:
        return f'{numbered.prefix}0, …'
    if key.default is MISSING:
        return 'needed'
    given = write(key.default) if key.default not in (None, math.inf) else key.default
    if given in (None, '', math.inf) or isinstance(given, dict | list) and not (
            isinstance(given, list) and given and isinstance(given[0], float)):
        return '–' if given != math.inf else 'inf'
    return f'{given:.4g}' if isinstance(given, float) else str(given).lower() \
        if isinstance(given, bool) else f'{given}'


def meaning(key: Key, sentences: dict[str, str]) -> str:
    """Return its sentence, and the only keys beside which it may stand."""
    beside = key.mark(OnlyWith)
    only = '' if beside is None or key.name in beside.keys \
        else f'(with {", ".join(f"`{name}`" for name in beside.keys)}) '
    return escaped(re.sub(r'\bNone\b', 'null', only + sentences.get(key.field, '')))


def files() -> dict[Path, str]:
    """Return every page with up-to-date tables of keys."""
    found = {REFERENCE: reference()}
    for page in sorted(DOCS.glob('*.md')):
        text = page.read_text(encoding='utf-8') if page != REFERENCE else ''
        if '<!-- keys: ' in text:
            found[page] = _TABLE.sub(lambda match: match[1] + keys_table(getattr(
                importlib.import_module(f'crgame_ros.{match[2]}'), match[3])) + '\n' + match[4],
                text)
    return found


if __name__ == '__main__':
    sys.exit(main_of(__doc__, files))
