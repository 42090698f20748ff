# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The kinds of YAML files that users write, and the classes that declare them."""

import importlib
from typing import Any, NamedTuple

from crgame_ros.schema.json_schema import json_schema


class FileKind(NamedTuple):
    """
    A kind of file.

    :param module: module that declares it.
    :param name: name of the class there.
    :param title: title for people.
    """

    module: str
    name: str
    title: str

    @property
    def declared(self) -> type[Any]:
        """Return the class that declares it."""
        kind: type[Any] = getattr(importlib.import_module(self.module), self.name)
        return kind

    def schema(self) -> dict[str, Any]:
        """Return its JSON Schema."""
        return json_schema(self.declared, self.title)

    def keys(self) -> frozenset[str]:
        """Return the top-level keys of such a file."""
        schema = self.schema()
        root = schema['$defs'][schema['$ref'].rpartition('/')[2]]
        return frozenset(root.get('properties', ()))


FILE_KINDS = {
    'game': FileKind('crgame_ros.game.game', 'Game', 'Game file'),
    'vehicle': FileKind('crgame_ros.vehicle.parameters', 'VehicleParameters', 'Vehicle'),
    'steering': FileKind('crgame_ros.vehicle.steering', 'SteeringRatioTable',
                         'Table of steering ratios'),
    'device': FileKind('crgame_ros.driver.device_map', 'DeviceFile', 'Device map'),
    'timeline': FileKind('crgame_ros.driver.timeline_file', 'TimelineFile', 'Scripted driver'),
    'occupancy': FileKind('crgame_ros.occupancy.map_file', 'MapEntry', 'Occupancy map'),
    'study': FileKind('crgame_ros.study.file', 'StudyFile', 'Study'),
    'questionnaire': FileKind('crgame_ros.study.questionnaire', 'Questionnaire', 'Questionnaire'),
    'control': FileKind('crgame_ros.vehicle.control_settings', 'ControlSettings',
                        'Gains and lags')}
