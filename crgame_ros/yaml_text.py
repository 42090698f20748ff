# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Reading YAML of any origin: the result is small, plain and printable."""

from pathlib import Path
import re
from typing import Any

from crgame_ros.errors import InputError
from crgame_ros.paths import irregular
import yaml

MAX_BYTES = 1 << 20
# rosbag2's metadata is the deepest and needs 6.
MAX_DEPTH = 20
# Aliases multiply values: a few lines can stand for billions of them.
MAX_VALUES = 1_000_000
# No number written by hand is longer, and int() of a long one takes minutes.
MAX_DIGITS = 60
MAX_INTEGER = 2 ** 64

_PLAIN_TAGS = frozenset(f'tag:yaml.org,2002:{name}'
                        for name in ('str', 'int', 'float', 'bool', 'null', 'map', 'seq'))
_TIMESTAMP = 'tag:yaml.org,2002:timestamp'
# Lone surrogates cannot be written to any file, and NUL is in no file's name.
UNPRINTABLE = re.compile('[\x00-\x08\x0b\x0c\x0e-\x1f\x7f-\x84\x86-\x9f\ud800-\udfff]')
# PyYAML built with libyaml has this loader in C, which takes a fifth of the time.
_FASTEST: Any = getattr(yaml, 'CSafeLoader', yaml.SafeLoader)


class _Loader(_FASTEST):
    """A loader of mappings, lists, text, numbers, booleans and null: no dates, no classes."""

    yaml_implicit_resolvers = {
        first: [(tag, pattern) for tag, pattern in resolvers if tag != _TIMESTAMP]
        for first, resolvers in _FASTEST.yaml_implicit_resolvers.items()}


def _number(loader: yaml.SafeLoader, node: yaml.ScalarNode) -> float | int:
    build = loader.construct_yaml_int if node.tag.endswith(':int') else loader.construct_yaml_float
    if len(node.value) > MAX_DIGITS:
        raise yaml.constructor.ConstructorError(
            None, None, f'a number has {len(node.value)} digits', node.start_mark)
    value: float | int = build(node)
    if isinstance(value, int) and abs(value) > MAX_INTEGER:
        raise yaml.constructor.ConstructorError(
            None, None, f'the whole number {value} is too large', node.start_mark)
    return value


_Loader.add_constructor('tag:yaml.org,2002:int', _number)
_Loader.add_constructor('tag:yaml.org,2002:float', _number)


def read_yaml(path: Path, what: str, remedy: str = 'mend the file',
              max_bytes: int = MAX_BYTES) -> Any:
    """
    Read a YAML file safely.

    :param what: kind of the file, for the message.
    :param remedy: what to do about an invalid file, for the message.
    :param max_bytes: largest size of such a file.
    :return: as of `parse_yaml`
    :raises InputError: if it is missing, too large or no YAML.
    """
    return parse_yaml(read_text(path, what, remedy, max_bytes), str(path), remedy, max_bytes)


def read_text(path: Path, what: str, remedy: str = 'mend the file',
              max_bytes: int = MAX_BYTES) -> str:
    """
    Read a text file in UTF-8; only a regular file is opened.

    :param what: as of `read_yaml`, like the others
    :raises InputError: if it is missing, too large or no text.
    """
    where = str(path)
    try:
        if (other := irregular(path.stat().st_mode)) is not None:
            raise InputError(f'is {other}, not a {what}', where, 'name a file')
        with path.open('rb') as stream:
            data = stream.read(max_bytes + 1)
    except OSError as error:
        raise InputError(f'cannot read the {what} ({error.strerror})', where,
                         'check the name') from error
    except ValueError as error:
        raise InputError(f'is no file name ({error})', where, 'name a file') from error
    if len(data) > max_bytes:
        raise InputError(f'is larger than {max_bytes >> 20} MiB, too large for a {what}', where,
                         'name another file')
    try:
        return data.decode('utf-8')
    except UnicodeDecodeError as error:
        raise InputError(f'is no YAML (no text in UTF-8: {error.reason} at byte {error.start})',
                         where, remedy) from error


def parse_yaml(text: str, where: str, remedy: str = 'mend the file',
               max_characters: int = MAX_BYTES) -> object:
    """
    Read YAML text safely.

    :param where: the file's name, for messages.
    :param max_characters: largest length of such a text.
    :return: mappings, lists, text, finite whole numbers up to 2^64, floats, booleans or None; a
        date is text.
    :raises InputError: if it is no YAML, nested deeper than 20 levels, expands its aliases to too
        many values, or names other types.
    """
    if len(text) > max_characters:
        raise InputError(f'is longer than {max_characters} characters', where, remedy)
    try:
        _refuse_wild(text)
        return yaml.load(text, _Loader)
    except (yaml.YAMLError, ValueError, RecursionError, OverflowError) as error:
        detail = getattr(error, 'problem', None) or str(error) or type(error).__name__
        mark = getattr(error, 'problem_mark', None)
        line = f', line {mark.line + 1}' if mark is not None else ''
        raise InputError(f'is no YAML ({str(detail).splitlines()[0]}{line})', where,
                         remedy) from error


def _refuse_wild(text: str) -> None:
    """
    Check the stream of events for large or non-plain data, before anything is built.

    The depth of building in C is limited by the stack only.
    """
    # Numbers of values in each open collection, with aliases expanded, and in each anchor.
    open_values: list[int] = [0]
    open_anchors: list[str | None] = [None]
    anchors: dict[str, int] = {}
    for event in yaml.parse(text, Loader=_Loader):
        values = 1
        if isinstance(event, yaml.AliasEvent):
            if event.anchor in open_anchors:
                raise _refusal(event, f'the alias *{event.anchor} stands inside of what it names')
            # An alias without an anchor is refused when values are built.
            values = anchors.get(str(event.anchor), 1)
        elif isinstance(event, yaml.CollectionStartEvent):
            _refuse_tag(event)
            if len(open_values) > MAX_DEPTH:
                raise _refusal(event, f'nested deeper than {MAX_DEPTH} levels')
            open_values.append(1)
            open_anchors.append(event.anchor)
            continue
        elif isinstance(event, yaml.CollectionEndEvent):
            values, anchor = open_values.pop(), open_anchors.pop()
            if anchor is not None:
                anchors[anchor] = values
        elif isinstance(event, yaml.ScalarEvent):
            _refuse_tag(event)
            if UNPRINTABLE.search(event.value):
                raise _refusal(event, 'a text holds half a character, or one that cannot be shown')
            if event.anchor is not None:
                anchors[event.anchor] = 1
        else:
            continue
        open_values[-1] += values
        if open_values[-1] > MAX_VALUES:
            raise _refusal(event, 'its aliases (*name) stand for more than '
                                  f'{MAX_VALUES} values')


def _refuse_tag(event: yaml.ScalarEvent | yaml.CollectionStartEvent) -> None:
    if event.tag not in (None, '!') and event.tag not in _PLAIN_TAGS:
        raise _refusal(event, f'the tag {event.tag[:60]!r} is not taken')


def _refusal(event: Any, problem: str) -> yaml.YAMLError:
    return yaml.MarkedYAMLError(None, None, problem, event.start_mark)
