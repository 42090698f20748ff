# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The interface contract `msg_defs/interfaces.yaml`, read and checked; needs no rclpy."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
import functools
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from crgame_ros.errors import InputError
from crgame_ros.paths import share_directory
from crgame_ros.yaml_text import read_yaml

PLACEHOLDERS = ('<hv>', '<av>', '<v>')
# Stands for programs that are not of this package, among producers and consumers.
EXTERNAL = 'external'


@dataclass(frozen=True)
class Qos:
    """Quality of service of a topic; history is keep-last."""

    depth: int
    reliability: str
    durability: str


@dataclass(frozen=True)
class Row:
    """
    One row of the contract.

    :param name: with a placeholder <hv>, <av> or <v> for a vehicle's id, if each of them has one.
    :param type_name: package/msg/Type.
    :param optional: whether it is left out where its type's package is not installed.
    """

    name: str
    type_name: str
    optional: bool

    @property
    def available(self) -> bool:
        """Return whether it is available; only an optional one may not be."""
        return not self.optional or find_spec(self.type_name.partition('/')[0]) is not None


@dataclass(frozen=True)
class Topic(Row):
    """
    A topic.

    :param producers: nodes that publish it; `external` stands for others.
    :param consumers: nodes that subscribe to it; `external` stands for others.
    :param record: whether the recorder records it.
    :param rate: nominal rate [Hz], or a description.
    :param fields: meaning and unit of each field that is used.
    :param max_bytes: of a serialised message; longer ones are refused.
    :param points: fewest and most points of a trajectory.
    :param finite: whether all positions and velocities of a trajectory are finite.
    """

    qos: Qos
    producers: tuple[str, ...]
    consumers: tuple[str, ...]
    record: bool
    rate: str
    fields: Mapping[str, str]
    max_bytes: int
    points: tuple[int, int]
    finite: bool

    @property
    def is_own(self) -> bool:
        """Return whether only the nodes of this package publish it, for each other too."""
        return EXTERNAL not in self.producers and set(self.consumers) != {EXTERNAL}

    @property
    def placeholder(self) -> str | None:
        """Return the placeholder in the name, if any."""
        return next((item for item in PLACEHOLDERS if item in self.name), None)

    def names(self, humans: Sequence[str], avs: Sequence[str]) -> tuple[str, ...]:
        """Return the topic's names in a run with these vehicles."""
        groups = {'<hv>': humans, '<av>': avs, '<v>': (*humans, *avs)}
        if self.placeholder is None:
            return (self.name,)
        return tuple(self.name.replace(self.placeholder, vehicle)
                     for vehicle in groups[self.placeholder])

    def name_for(self, vehicle_id: str) -> str:
        """Return the topic's name for one vehicle."""
        return self.name if self.placeholder is None else self.name.replace(
            self.placeholder, vehicle_id)


@dataclass(frozen=True)
class Service(Row):
    """A service or action, offered by sim_node."""

    what: str

    def names(self, avs: Sequence[str]) -> tuple[str, ...]:
        """Return the service's names in a run with these AVs."""
        if '<av>' not in self.name:
            return (self.name,)
        return tuple(self.name.replace('<av>', av) for av in avs)


@dataclass(frozen=True)
class Contract:
    """The whole contract, by name."""

    topics: Mapping[str, Topic]
    services: Mapping[str, Service]
    actions: Mapping[str, Service]
    parameters: Mapping[str, Mapping[str, Mapping[str, str]]]


@functools.cache
def load_contract(path: Path | None = None) -> Contract:
    """
    Read the contract.

    :raises InputError: if a row is incomplete.
    """
    path = share_directory() / 'msg_defs' / 'interfaces.yaml' if path is None else path
    content = read_yaml(path, 'contract')
    topics, profiles = {}, {}
    services: dict[str, Service] = {}
    actions: dict[str, Service] = {}
    name = 'qos'
    try:
        for name, row in content['qos'].items():
            profiles[name] = Qos(**row)
        for name, row in content['topics'].items():
            topics[name] = _topic(name, row, profiles, content['max_bytes'])
        for section, found in (('services', services), ('actions', actions)):
            for name, row in content[section].items():
                found[name] = Service(name, row['type'], bool(row.get('optional', False)),
                                      row['what'])
    except (KeyError, TypeError, AttributeError) as error:
        raise InputError(f'{error} is missing or wrong', f'{path}: {name}') from error
    return Contract(topics, services, actions, content['parameters'])


def _topic(name: str, row: Mapping[str, Any], profiles: Mapping[str, Qos],
           max_bytes: int) -> Topic:
    qos = profiles[row['qos']] if isinstance(row['qos'], str) else Qos(**row['qos'])
    producer = row['producer']
    producers = (producer,) if isinstance(producer, str) else tuple(producer)
    return Topic(name, row['type'], bool(row.get('optional', False)), qos, producers,
                 tuple(row['consumers']), row['record'], str(row['rate_hz']), row['fields'],
                 int(row.get('max_bytes', max_bytes)), tuple(row.get('points', (1, 1))),
                 bool(row.get('finite', False)))
