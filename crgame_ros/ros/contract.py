# Copyright 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The interface contract `msg_defs/interfaces.yaml`, read and checked; needs no rclpy."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
import functools
from pathlib import Path
from typing import Any

import yaml

from crgame_ros.errors import InputError
from crgame_ros.paths import share_directory

PLACEHOLDERS = ('<hv>', '<av>', '<v>')


@dataclass(frozen=True)
class Qos:
    """Quality of service of a topic; history is keep-last."""

    depth: int
    reliability: str
    durability: str


@dataclass(frozen=True)
class Topic:
    """
    One row of the contract.

    :param name: with a placeholder <hv>, <av> or <v> for a vehicle's id.
    :param type_name: package/msg/Type.
    :param producers: nodes that publish it.
    :param consumers: nodes that subscribe to it; `external` stands for others.
    :param record: whether the recorder takes it.
    :param rate: nominal rate [Hz], or words.
    :param fields: meaning and unit of each field that is used.
    """

    name: str
    type_name: str
    qos: Qos
    producers: tuple[str, ...]
    consumers: tuple[str, ...]
    record: bool
    rate: str
    fields: Mapping[str, str]

    @property
    def placeholder(self) -> str | None:
        """The placeholder in the name, if any."""
        return next((item for item in PLACEHOLDERS if item in self.name), None)

    def names(self, humans: Sequence[str], avs: Sequence[str]) -> tuple[str, ...]:
        """Give the topic's names in a run with these vehicles."""
        groups = {'<hv>': humans, '<av>': avs, '<v>': (*humans, *avs)}
        if self.placeholder is None:
            return (self.name,)
        return tuple(self.name.replace(self.placeholder, vehicle)
                     for vehicle in groups[self.placeholder])

    def name_for(self, vehicle_id: str) -> str:
        """Give the topic's name for one vehicle."""
        return self.name if self.placeholder is None else self.name.replace(
            self.placeholder, vehicle_id)


@dataclass(frozen=True)
class Service:
    """
    One service of the contract, offered by sim_node.

    :param name: with a placeholder <av> for an AV's id, if there is one of each.
    """

    name: str
    type_name: str
    what: str

    def names(self, avs: Sequence[str]) -> tuple[str, ...]:
        """Give the service's names in a run with these AVs."""
        if '<av>' not in self.name:
            return (self.name,)
        return tuple(self.name.replace('<av>', av) for av in avs)


@dataclass(frozen=True)
class Contract:
    """The whole contract, by name."""

    topics: Mapping[str, Topic]
    services: Mapping[str, Service]
    parameters: Mapping[str, Mapping[str, Mapping[str, str]]]

    def topic(self, name: str) -> Topic:
        """Look a topic up by its name in the contract."""
        return self.topics[name]


@functools.cache
def load_contract(path: Path | None = None) -> Contract:
    """
    Read the contract.

    :raises InputError: if a row is incomplete.
    """
    path = share_directory() / 'msg_defs' / 'interfaces.yaml' if path is None else path
    content = yaml.safe_load(path.read_text(encoding='utf-8'))
    topics, services, profiles = {}, {}, {}
    name = 'qos'
    try:
        for name, row in content['qos'].items():
            profiles[name] = Qos(**row)
        for name, row in content['topics'].items():
            topics[name] = _topic(name, row, profiles)
        for name, row in content['services'].items():
            services[name] = Service(name, row['type'], row['what'])
    except (KeyError, TypeError, AttributeError) as error:
        raise InputError(f'{error} is missing or wrong', f'{path}: {name}') from error
    return Contract(topics, services, content['parameters'])


def _topic(name: str, row: Mapping[str, Any], profiles: Mapping[str, Qos]) -> Topic:
    qos = profiles[row['qos']] if isinstance(row['qos'], str) else Qos(**row['qos'])
    producer = row['producer']
    producers = (producer,) if isinstance(producer, str) else tuple(producer)
    return Topic(name, row['type'], qos, producers, tuple(row['consumers']), row['record'],
                 str(row['rate_hz']), row['fields'])
