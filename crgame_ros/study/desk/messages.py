# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Parses the messages of the desk's pages: untrusted JSON to checked values or an error."""

from collections.abc import Callable, Mapping
import json
import math
import re
from typing import Any

from crgame_ros.errors import InputError

# Enough for a page of questions with long texts, at four bytes per character.
MAX_BYTES = 4 * 2 ** 20
MAX_ANSWERS = 500
MAX_CHOICES = 500
MAX_NAME = 200
MAX_REMARK = 20_000
MAX_DELAY_MS = 60_000.0
_LATEST_S = 1e11
_MAX_ID = 2 ** 53
_PAGE = re.compile(r'[0-9a-f]{32}')


def parse_participant(text: str) -> dict[str, Any]:
    """
    Check a message of the participant's page.

    :param text: one JSON object of at most `MAX_BYTES`.
    :return: its `type` and the fields of that type; others are dropped.
    :raises InputError: if it is malformed.
    """
    return _parse(text, _PARTICIPANT)


def parse_experimenter(text: str) -> dict[str, Any]:
    """Check a message of the experimenter's page, as `parse_participant` does."""
    return _parse(text, _EXPERIMENTER)


def _parse(text: str, readers: Mapping[str, Callable[[Mapping[str, Any]], dict[str, Any]]]
           ) -> dict[str, Any]:
    try:
        message = json.loads(text, parse_constant=_refuse_constant)
    except (ValueError, RecursionError) as error:
        raise _wrong('message', 'is no JSON') from error
    if not isinstance(message, dict):
        raise _wrong('message', 'is no JSON object')
    kind = message.get('type')
    reader = readers.get(kind) if isinstance(kind, str) else None
    if reader is None:
        raise _wrong('type', 'is unknown')
    return {'type': kind, **reader(message)}


def _hello(message: Mapping[str, Any]) -> dict[str, Any]:
    page = message.get('page')
    if not isinstance(page, str) or _PAGE.fullmatch(page) is None:
        raise _wrong('page', 'is none of 32 hexadecimal digits')
    return {'page': page, 'fresh': _flag(message, 'fresh')}


def _nothing(_: Mapping[str, Any]) -> dict[str, Any]:
    return {}


def _language(message: Mapping[str, Any]) -> dict[str, Any]:
    return {'language': _text(message, 'language', 20)}


def _item(message: Mapping[str, Any]) -> dict[str, Any]:
    return {'item': _text(message, 'item', MAX_NAME)}


def _finish(message: Mapping[str, Any]) -> dict[str, Any]:
    """Read answers, consent, findings and times by the wall clock."""
    read: dict[str, Any] = {**_item(message), 'answers': _answers(message.get('answers', {})),
                            'times': _times(message)}
    if 'agreed' in message:
        read['agreed'] = _flag(message, 'agreed')
    if 'device' in message:
        read['device'] = _text(message, 'device', MAX_NAME)
        read['moved'] = [_as_text(name, 'moved', MAX_NAME)
                         for name in _list(message.get('moved', []), 'moved', 50)]
    return read


def _answers(given: Any) -> dict[str, Any]:
    if not isinstance(given, dict) or len(given) > MAX_ANSWERS:
        raise _wrong('answers', f'are no object of at most {MAX_ANSWERS}')
    return {_as_text(name, 'answers', MAX_NAME): _answer(value) for name, value in given.items()}


def _answer(value: Any) -> Any:
    if value is None or isinstance(value, str):
        return value
    if isinstance(value, list):
        return [_as_text(choice, 'answers', MAX_NAME)
                for choice in _list(value, 'answers', MAX_CHOICES)]
    return _number(value, 'answers')


def _times(message: Mapping[str, Any]) -> dict[str, Any]:
    """Read when an item was shown and answered, and the time of each question's answer."""
    shown_at, answered_at = (_within(message.get(name), name, 0.0, _LATEST_S)
                             for name in ('shown_at', 'answered_at'))
    after_s = message.get('after_s', {})
    if not isinstance(after_s, dict) or len(after_s) > MAX_ANSWERS:
        raise _wrong('after_s', f'is no object of at most {MAX_ANSWERS}')
    return {'shown_at': shown_at, 'answered_at': answered_at,
            'taken_s': _within(message.get('taken_s'), 'taken_s', 0.0, _LATEST_S),
            'after_s': {_as_text(name, 'after_s', MAX_NAME):
                        _within(value, 'after_s', 0.0, _LATEST_S)
                        for name, value in after_s.items()}}


def _ping(message: Mapping[str, Any]) -> dict[str, Any]:
    read = {'t': _number(message.get('t'), 't')}
    for name in ('round_trip_ms', 'drive_delay_ms'):
        if message.get(name) is not None:
            read[name] = _within(message[name], name, 0.0, MAX_DELAY_MS)
    if 'seated' in message:
        read['seated'] = _flag(message, 'seated')
    return read


def _note(message: Mapping[str, Any]) -> dict[str, Any]:
    return {'text': _remark(message, 'text'), **_id(message)}


def _mark(message: Mapping[str, Any]) -> dict[str, Any]:
    name = _text(message, 'name', MAX_NAME).strip()
    if not name:
        raise _wrong('name', 'is empty')
    return {'name': name, **_id(message)}


def _reasoned(message: Mapping[str, Any]) -> dict[str, Any]:
    return {**_item(message), 'reason': _remark(message, 'reason'), **_id(message)}


def _end(message: Mapping[str, Any]) -> dict[str, Any]:
    return {'reason': _remark(message, 'reason'), **_id(message)}


def _hold(message: Mapping[str, Any]) -> dict[str, Any]:
    return {'held': _flag(message, 'held'), **_id(message)}


_PARTICIPANT: dict[str, Callable[[Mapping[str, Any]], dict[str, Any]]] = {
    'hello': _hello, 'here': _nothing, 'language': _language, 'finish': _finish, 'ready': _item,
    'ping': _ping}
_EXPERIMENTER: dict[str, Callable[[Mapping[str, Any]], dict[str, Any]]] = {
    'note': _note, 'mark': _mark, 'repeat': _reasoned, 'skip': _reasoned, 'abort': _reasoned,
    'end': _end, 'hold': _hold, 'ping': _ping}


def _remark(message: Mapping[str, Any], field: str) -> str:
    text = _text(message, field, MAX_REMARK)
    if not text.strip():
        raise _wrong(field, 'is empty')
    return text


def _text(message: Mapping[str, Any], field: str, longest: int) -> str:
    return _as_text(message.get(field), field, longest)


def _as_text(value: Any, field: str, longest: int) -> str:
    if not isinstance(value, str) or len(value) > longest:
        raise _wrong(field, f'is no text of at most {longest} characters')
    return value


def _list(value: Any, field: str, longest: int) -> list[Any]:
    if not isinstance(value, list) or len(value) > longest:
        raise _wrong(field, f'is no list of at most {longest}')
    return value


def _id(message: Mapping[str, Any]) -> dict[str, Any]:
    value = message.get('id')
    if isinstance(value, bool) or not isinstance(value, int) or not 0 <= value <= _MAX_ID:
        raise _wrong('id', 'is no whole number')
    return {'id': value}


def _flag(message: Mapping[str, Any], field: str) -> bool:
    value = message.get(field)
    if not isinstance(value, bool):
        raise _wrong(field, 'is neither true nor false')
    return value


def _number(value: Any, field: str) -> float | int:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise _wrong(field, 'is no number')
    try:
        finite = math.isfinite(value)
    except OverflowError:
        finite = False
    if not finite:
        raise _wrong(field, 'is no finite number')
    return value


def _within(value: Any, field: str, low: float, high: float) -> float:
    number = float(_number(value, field))
    if not low <= number <= high:
        raise _wrong(field, f'is not from {low:g} to {high:g}')
    return number


def _refuse_constant(name: str) -> float:
    raise ValueError(name)


def _wrong(field: str, what: str) -> InputError:
    # The sent value is not repeated: it may be long, and others may read the log.
    return InputError(what, field)
