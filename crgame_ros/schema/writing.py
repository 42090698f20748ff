# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Writes a value as the content of a file from which it can be read."""

from collections.abc import Mapping
from dataclasses import is_dataclass
from pathlib import Path
from typing import Any

from crgame_ros.schema.declaration import Form, form_of, Key, keys_of
from crgame_ros.schema.marks import Folder, Keyed, LeftOut, Named, OnlyWith

_HERE = Path()


def write(value: object, base: Path = _HERE) -> Any:
    """
    Return the YAML values from which `read` builds an equal value, from any folder.

    :param value: a dataclass that `read` returned, or could return.
    :param base: directory of its relative file names.
    :return: new mappings, lists, texts, numbers, truth values and None.
    """
    if is_dataclass(value):
        return _mapping(value, base)
    if isinstance(value, Mapping):
        return {key: write(item, base) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [write(item, base) for item in value]
    return str(value.resolve()) if isinstance(value, Path) else value


def _mapping(value: object, base: Path) -> dict[str, object]:
    form = form_of(type(value))
    entries: dict[str, object] = {}
    for key in keys_of(type(value)):
        item = getattr(value, key.field)
        if _is_left_out(key, item, form, value):
            continue
        named, keyed = key.mark(Named), key.mark(Keyed)
        written: Any = named.written(item, base) if named is not None and item is not None \
            else write(item, base)
        if keyed is not None:
            entries[next(name for name, kind in keyed.kinds.items() if type(item) is kind)] = \
                written
        elif form.rest == key.field:
            entries.update(written)
        else:
            entries[key.name] = written
    return {name: entries[name] for name in (*form.first, *entries) if name in entries}


def _is_left_out(key: Key, item: object, form: Form, value: object) -> bool:
    if key.mark(Folder) or key.mark(LeftOut) and item == key.default:
        return True
    beside = key.mark(OnlyWith)
    if beside is not None and all(
            getattr(value, name) in (None, ()) for name in beside.keys):
        return True
    if form.written == 'all' or key.field == form.rest:
        return False
    return bool(item == key.default) if form.written == 'changed' else item is None
