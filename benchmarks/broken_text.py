# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Files broken in one or two places: YAML and JSON by values and text, anything by bytes."""

from collections.abc import Iterator
from copy import deepcopy
import json
import math
import random
from typing import Any

import yaml

VALUES: tuple[Any, ...] = (
    0, -1, 1, 7, 1e6, 1e9, 1e308, -1e308, 1e-9, 5.5e6, math.nan, math.inf, -math.inf, 2 ** 63,
    2 ** 64, -2 ** 63, 10 ** 30, '', ' ', 'abc', 'é\u200bx', '../../x', '/dev/zero', '/',
    'x' * 5000, True, False, None, [], {}, [[]], [1, 2], {'a': 1}, 'a:b', 'nan', '1e3',
    '2026-01-01')
# These are written literally: no dumper would write them.
TEXTS = (
    '2026-13-45', '2026-01-01', '!!python/object/apply:os.getcwd []', '!!binary aGk=',
    '!!set {a, b}', '!!timestamp 2026-01-01', '!!int abc', '!!float []', '"\\ud800"', '"\\0"',
    '"\\x1b[31m"', '&a [*a]', '*missing', '0x' + 'f' * 5000, '9' * 5000, '1:2:3:4:5', '-.inf',
    '[' * 1000, '{' * 50, '? [a]\n: b', '!<x> y', '[' * 30 + ']' * 30, '<<: 3',
    '{<<: [{a: 1}, 2]}', '=', '%TAG', '---\n- a', '...\n', '\t', '|', '!!map [1]', '0o17',
    '1_000', '~', 'y', '1e3')


def broken_yaml(text: bytes, dice: random.Random) -> tuple[bytes, str]:
    """Break a YAML file; return the change, too."""
    if dice.random() < 0.15:
        return broken_bytes(text, dice)
    document = yaml.safe_load(text)
    done = [dice.choice((_value, _value, _value, _text, _text, _delete, _double, _rename, _swap))(
        document, dice) for _ in range(dice.choice((1, 1, 2)))]
    data = yaml.safe_dump(document, sort_keys=False, allow_unicode=True).encode('utf-8')
    # A placeholder stands for text that is inserted literally.
    for place, raw in enumerate(TEXTS):
        data = data.replace(f'RAW{place}WAR'.encode(), raw.encode())
    return data, ' and '.join(done)


def broken_json(text: bytes, dice: random.Random) -> tuple[bytes, str]:
    """Break a JSON file, or one line of a file with such a line for each entry."""
    parts = [text] if text.startswith(b'{\n') else text.splitlines()
    number = dice.randrange(len(parts))
    document = json.loads(parts[number])
    done = dice.choice((_value, _value, _value, _delete, _double, _swap))(document, dice)
    parts[number] = json.dumps(document).encode('utf-8')
    return b'\n'.join(parts) + b'\n', f'part {number}: {done}'


def broken_bytes(data: bytes, dice: random.Random) -> tuple[bytes, str]:
    """Cut a file, or change, double, insert or remove some of its bytes."""
    size = max(1, len(data))
    at, kind = dice.randrange(size), dice.randrange(6)
    if kind == 0:
        return data[:at], f'cut after {at} bytes'
    if kind == 1:
        changed = bytearray(data)
        places = [dice.randrange(size) for _ in range(dice.choice((1, 1, 8, 100)))]
        for place in places if data else ():
            changed[place] ^= 1 << dice.randrange(8)
        return bytes(changed), f'{len(places)} bits turned, the first at {places[0]}'
    length = dice.choice((1, 4, 8, 100, 4096))
    if kind == 2:
        return data[:at] + data[at + length:], f'{length} bytes removed at {at}'
    if kind == 3:
        return data[:at + length] + data[at:], f'{length} bytes doubled at {at}'
    if kind == 4:
        kinds = (b'\x00', b'\xff', b'\x80', b'\xed\xa0\x80', b'[', b'<', b'9')
        filling = dice.choice(kinds) * length
        return (data[:at] + filling + data[at + length:],
                f'{length} times {filling[:3]!r} at {at}')
    other = dice.randrange(size)
    part = data[other:other + length]
    return data[:at] + part + data[at + length:], f'{length} bytes from {other} at {at}'


def _places(node: Any, path: str = '') -> Iterator[tuple[Any, Any, str]]:
    """Yield (container, key, path) of every value below a node."""
    items = node.items() if isinstance(node, dict) else enumerate(
        node if isinstance(node, list) else ())
    for key, value in list(items):
        yield node, key, f'{path}/{key}'
        yield from _places(value, f'{path}/{key}')


def _pick(document: Any, dice: random.Random) -> tuple[Any, Any, str]:
    places = list(_places(document))
    return dice.choice(places) if places else ({}, 'x', '')


def _value(document: Any, dice: random.Random) -> str:
    node, key, path = _pick(document, dice)
    node[key] = deepcopy(dice.choice(VALUES))
    return f'{path} = {str(node[key])[:30]!r}'


def _text(document: Any, dice: random.Random) -> str:
    node, key, path = _pick(document, dice)
    place = dice.randrange(len(TEXTS))
    node[key] = f'RAW{place}WAR'
    return f'{path} = {TEXTS[place][:30]}'


def _delete(document: Any, dice: random.Random) -> str:
    node, key, path = _pick(document, dice)
    if path:
        del node[key]
    return f'delete {path}'


def _double(document: Any, dice: random.Random) -> str:
    node, key, path = _pick(document, dice)
    count = dice.choice((1, 1, 30))
    if isinstance(node, list):
        node += [deepcopy(node[key]) for _ in range(count)]
    else:
        node[f'{key}2'] = deepcopy(node.get(key))
    return f'double {path} {count} times'


def _rename(document: Any, dice: random.Random) -> str:
    node, key, path = _pick(document, dice)
    name = dice.choice((0, 'x', '', None, True, 1.5, 'id', 'é', 'x' * 600))
    if isinstance(node, dict) and path:
        node[name] = node.pop(key)
    return f'rename {path} to {str(name)[:20]!r}'


def _swap(document: Any, dice: random.Random) -> str:
    node, key, path = _pick(document, dice)
    other, name, place = _pick(document, dice)
    if path and place:
        node[key], other[name] = deepcopy(other[name]), deepcopy(node[key])
    return f'swap {path} and {place}'
