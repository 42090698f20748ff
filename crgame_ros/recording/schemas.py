# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Reads message definitions, as recordings store them, from installed interface packages."""

from collections.abc import Iterator
import functools
from functools import cache
import json
import os
from pathlib import Path
import re
import sys

from crgame_ros.errors import InputError
from crgame_ros.messages.contract import load_contract

_VEHICLE = re.compile(r'/(hv|av)\d{1,3}(/.+)')


@functools.lru_cache(maxsize=4096)
def contract_type(topic: str) -> str | None:
    """Return package/msg/Type of a topic; None for a topic that is not in the contract."""
    topics = load_contract().topics
    names = [topic]
    vehicle = _VEHICLE.fullmatch(topic)
    if vehicle is not None:
        names += [f'/<{vehicle.group(1)}>{vehicle.group(2)}', f'/<v>{vehicle.group(2)}']
    return next((topics[name].type_name for name in names if name in topics), None)


def is_foreign(topic: str, type_name: str) -> bool:
    """Return whether a message cannot be one of a run: another type on a topic of the contract."""
    return contract_type(topic) not in (None, type_name)


_TYPE_NAME = re.compile(r'([a-z][a-z0-9_]*)/msg/([A-Za-z][A-Za-z0-9_]*)')
_FIELD = re.compile(r'\s*([A-Za-z][A-Za-z0-9_/]*)(?:<=\d+)?(?:\[[^\]]*\])?\s+[A-Za-z]\w*')
_PRIMITIVES = frozenset(
    'bool byte char string wstring float32 float64 '
    'int8 uint8 int16 uint16 int32 uint32 int64 uint64'.split())
_SEPARATOR = '=' * 80


def share_directories() -> tuple[Path, ...]:
    """Return the share folders to search: of each AMENT_PREFIX_PATH entry, then this Python's."""
    prefixes = [*os.environ.get('AMENT_PREFIX_PATH', '').split(os.pathsep), sys.prefix]
    return tuple(dict.fromkeys(Path(prefix) / 'share' for prefix in prefixes if prefix))


def schema_text(type_name: str) -> str:
    """
    Return the definitions of a message type and of all types that it uses (`ros2msg`).

    :param type_name: such as `nav_msgs/msg/Odometry`.
    :raises InputError: if it, or a type it uses, is not installed.
    """
    return _schema_text(type_name, share_directories())


def type_hash(type_name: str) -> str:
    """
    Return the `RIHS01_...` hash of a message type, by which ROS 2 distinguishes its versions.

    :param type_name: such as `nav_msgs/msg/Odometry`.
    :raises InputError: if it is not installed or its description lacks a hash.
    """
    return _type_hash(type_name, share_directories())


@cache
def _schema_text(type_name: str, directories: tuple[Path, ...]) -> str:
    texts: dict[str, str] = {}
    pending = [type_name]
    while pending:
        name = pending.pop(0)
        if name not in texts:
            texts[name] = _interface_file(name, '.msg', directories).read_text('utf-8')
            pending += _used_types(name, texts[name])
    parts = [texts.pop(type_name).rstrip('\n')]
    parts += [f'{_SEPARATOR}\nMSG: {name.replace("/msg/", "/")}\n' + text.rstrip('\n')
              for name, text in texts.items()]
    return '\n'.join(parts) + '\n'


@cache
def _type_hash(type_name: str, directories: tuple[Path, ...]) -> str:
    path = _interface_file(type_name, '.json', directories)
    for entry in json.loads(path.read_text('utf-8'))['type_hashes']:
        if entry['type_name'] == type_name:
            return str(entry['hash_string'])
    raise InputError(f'no hash of {type_name} in it', str(path), 'install the package again')


def _interface_file(type_name: str, suffix: str, directories: tuple[Path, ...]) -> Path:
    match = _TYPE_NAME.fullmatch(type_name)
    if match is None:
        raise InputError('not the name of a message type', type_name,
                         'write it as package/msg/Type')
    package, name = match.groups()
    for directory in directories:
        path = directory / package / 'msg' / (name + suffix)
        if path.is_file():
            return path
    raise InputError('this message type is not installed', type_name,
                     f'install the package {package} or source the workspace that has it')


def _used_types(type_name: str, text: str) -> Iterator[str]:
    """Yield the full names of the message types among the fields of a definition."""
    package = type_name.split('/')[0]
    for line in text.splitlines():
        match = _FIELD.match(line.split('#')[0])
        if match is None or match[1] in _PRIMITIVES:
            continue
        parts = match[1].split('/')
        yield f'{parts[0] if len(parts) > 1 else package}/msg/{parts[-1]}'
