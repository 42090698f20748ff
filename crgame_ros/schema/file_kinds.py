# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The kinds of YAML files that users write, the classes that declare them, and JSON Schemas."""

from dataclasses import is_dataclass, MISSING
import importlib
import inspect
import math
from pathlib import Path
import types
from typing import Annotated, Any, get_args, get_origin, Literal, NamedTuple

from crgame_ros.registry import ANY_VALUE
from crgame_ros.schema.declaration import (
    choices_of,
    form_of,
    Key,
    keys_of,
    mark_of,
    sentences_of,
    split,
)
from crgame_ros.schema.marks import (
    Folder,
    Keyed,
    Listed,
    Meaning,
    Numbered,
    OnlyWith,
    Parts,
    Special,
    Within,
    Wording,
)
from crgame_ros.schema.reading import keys_beside
from crgame_ros.schema.writing import write

Schema = dict[str, object]
DIALECT = 'https://json-schema.org/draft/2020-12/schema'


def json_schema(kind: type[object], title: str) -> Schema:
    """
    Return the JSON Schema of the file from which `read` reads a dataclass.

    Checks that compare several values (repeated ids, lengths, time steps) are not part of it.

    :param title: title of the file, for people.
    """
    describer = _Describer()
    top = describer.describe(kind)
    return {'$schema': DIALECT, 'title': title, **top, '$defs': describer.definitions}


class _Describer:
    """A builder of schemas for types, which describes every dataclass once."""

    def __init__(self) -> None:
        self.definitions: dict[str, Schema] = {}

    def describe(self, hint: object, marks: tuple[object, ...] = ()) -> Schema:
        hint, own = split(hint)
        marks = (*marks, *own)
        special = mark_of(marks, Special)
        options = [special.json_schema()] if special is not None else [
            self.describe(choice, marks) if get_origin(choice) is Annotated
            else self._one(choice, marks) for choice in choices_of(hint)
            if choice is not types.NoneType]
        if types.NoneType in choices_of(hint):
            options.append({'type': 'null'})
        options += [{'const': mark.written} for mark in marks if isinstance(mark, Meaning)]
        return options[0] if len(options) == 1 else {'anyOf': options}

    def _one(self, hint: object, marks: tuple[object, ...]) -> Schema:
        plain = get_origin(hint) or hint
        if is_dataclass(hint):
            name = getattr(hint, '__name__', '')
            if name not in self.definitions:
                self.definitions[name] = {}
                self.definitions[name] = self._mapping(hint)
            return {'$ref': f'#/$defs/{name}'}
        if plain is Literal:
            return {'enum': list(get_args(hint))}
        if plain in (int, float):
            return _number(plain, mark_of(marks, Within) or Within())
        if plain is tuple:
            return self._list(get_args(hint), marks)
        if plain in (str, Path):
            wording = mark_of(marks, Wording)
            return {'type': 'string'} | ({'pattern': f'^(?:{wording.pattern})$'} if wording else
                                         {'minLength': 1} if plain is Path else {})
        if plain is bool:
            return {'type': 'boolean'}
        return {} if hint in ANY_VALUE else {'type': 'object'}

    def _list(self, items: tuple[object, ...], marks: tuple[object, ...]) -> Schema:
        bounds = tuple(mark for mark in marks if isinstance(mark, Within))
        if items[-1] is Ellipsis:
            listed = mark_of(marks, Listed) or Listed()
            return {'type': 'array', 'items': self.describe(items[0], bounds),
                    **({'minItems': listed.least} if listed.least else {}),
                    **({'maxItems': listed.most} if listed.most else {})}
        parts = mark_of(marks, Parts)
        return {'type': 'array', 'prefixItems': [self.describe(item, bounds) for item in items],
                'items': False, 'minItems': len(items) - (parts.optional if parts else 0)}

    def _mapping(self, kind: Any) -> Schema:
        form, keys = form_of(kind), keys_of(kind)
        properties: dict[str, Schema] = {}
        required = [key.name for key in keys if _is_required(key) and key.name != form.rest]
        schema: Schema = {
            'description': inspect.cleandoc(kind.__doc__ or '').split('\n')[0],
            'type': 'object', 'properties': properties, 'additionalProperties': False,
            'required': required}
        for key in keys:
            keyed = key.mark(Keyed)
            if keyed is not None:
                required.remove(key.name)
                properties |= {name: self.describe(one) for name, one in keyed.kinds.items()}
                schema['oneOf'] = [{'required': [name]} for name in keyed.kinds]
            elif form.rest == key.field:
                schema['additionalProperties'] = True
                if is_dataclass(key.hint):
                    own = list(properties) + [other.name for other in keys if other is not key]
                    needed = [other.name for other in keys_of(key.hint) if _is_required(other)]
                    properties |= {name: self._property(key.hint, other)
                                   for other in keys_of(key.hint) for name in needed
                                   if other.name == name}
                    schema['anyOf'] = [{'required': needed}, {'propertyNames': {'enum': own}}]
            elif key.mark(Folder) is None:
                properties[key.name] = self._property(kind, key)
        for name, section in form.moved:
            part = next(key for key in keys if key.name == section).hint
            properties[name] = self._property(
                part, next(key for key in keys_of(part) if key.name == name))
        if form.by:
            schema['allOf'] = _conditions(kind)
        if form.short is not None:
            return {'anyOf': [properties[form.short], schema]}
        return schema

    def _property(self, kind: Any, key: Key) -> Schema:
        sentence = sentences_of(kind).get(key.field)
        said: Schema = {'description': sentence} if sentence else {}
        default = key.default
        if default is not MISSING and default is not None and default != math.inf:
            said['default'] = write(default)
        return {**self.describe(key.hint, key.marks), **said}


def _is_required(key: Key) -> bool:
    return key.required and key.mark(Numbered) is None and key.mark(Folder) is None


def _number(kind: type[object], within: Within) -> Schema:
    schema: Schema = {'type': 'number' if kind is float else 'integer'}
    if within.low != -math.inf:
        schema['exclusiveMinimum' if within.above else 'minimum'] = within.low
    if within.high != math.inf:
        schema['maximum'] = within.high
    return {'anyOf': [schema, {'const': 0}]} if within.or_zero else schema


def _conditions(kind: type[object]) -> list[Schema]:
    """Return the conditions on combinations of keys and values."""
    form = form_of(kind)
    found: list[Schema] = []
    for by, places in form.one_of.items():
        then: Schema = {
            'oneOf': [{'required': [place]} for place in places],
            'properties': {place: False for place in form.places if place not in places}
            | {key: {'enum': list(choices[by])} for key, choices in form.choices.items()}}
        found.append({'if': {'properties': {form.by: {'const': by}}, 'required': [form.by]},
                      'then': then})
    for place in form.places:
        needed = [key.name for key in keys_of(kind) if (beside := key.mark(OnlyWith)) is not None
                  and place in beside.keys and (beside.needed or key.name == place)]
        found.append({'if': {'required': [place]}, 'then': {
            'propertyNames': {'enum': list(keys_beside(kind, place))}, 'required': needed,
            'properties': {name: {'not': {'type': 'null'}} for name in needed}}})
    return found


class FileKind(NamedTuple):
    """A kind of file: module and name of the class that declares it, and a title for people."""

    module: str
    name: str
    title: str

    @property
    def declared(self) -> type[object]:
        """Return the class that declares it."""
        return getattr(importlib.import_module(self.module), self.name)

    def schema(self) -> Schema:
        """Return its JSON Schema."""
        return json_schema(self.declared, self.title)


FILE_KINDS = {
    'game': FileKind('crgame_ros.game.game', 'Game', 'Game file'),
    'vehicle': FileKind('crgame_ros.vehicle.parameters', 'VehicleParameters', 'Vehicle'),
    'steering': FileKind('crgame_ros.vehicle.steering', 'SteeringRatioTable',
                         'Table of steering ratios'),
    'device': FileKind('crgame_ros.driver.device_map', 'DeviceMap', 'Device map'),
    'timeline': FileKind('crgame_ros.driver.timeline', 'TimelineFile', 'Scripted driver'),
    'occupancy': FileKind('crgame_ros.occupancy.map_file', 'MapEntry', 'Occupancy map'),
    'study': FileKind('crgame_ros.study.file', 'StudyFile', 'Study'),
    'questionnaire': FileKind('crgame_ros.study.questionnaire', 'Questionnaire', 'Questionnaire'),
    'control': FileKind('crgame_ros.vehicle.control_settings', 'ControlSettings',
                        'Gains and lags')}
