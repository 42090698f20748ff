# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
A Fast DDS profile with which a run's nodes take the run's own topics from each other alone.

The nodes' readers of these topics are in a DDS partition whose name only they know. Their writers
are in it and in the default one as well, so that every program of the domain can listen. Fast DDS
compares partitions when it matches a writer with a reader, so a message costs nothing more.
"""

from collections.abc import Collection, Iterator, Sequence
import copy
import os
from pathlib import Path
import secrets
from xml.etree import ElementTree

from crgame_ros.errors import InputError
from crgame_ros.messages.contract import load_contract
from crgame_ros.ros.environment import (
    is_loopback_profile,
    loopback_profile,
    network_is_open,
    PROFILE_VARIABLES,
)

FAST_DDS = 'rmw_fastrtps_cpp'
# What every program may publish, unless the run obeys its own nodes alone.
ORDER_TOPICS = ('/seats/order', '/trigger')
# A game that is chosen later may have vehicles with these numbers.
NUMBERS = range(16)
_NAMESPACE = 'http://www.eprosima.com/XMLSchemas/fastRTPS_Profiles'
# Profiles of these names apply to all services: requests are read by the first, written by the
# second.
_SERVICE, _CLIENT = 'service', 'client'


def can_believe() -> bool:
    """Return whether a profile can be given: with Fast DDS, and without a profile of the user."""
    given = [os.environ[name] for name in PROFILE_VARIABLES if os.environ.get(name)]
    return os.environ.get('RMW_IMPLEMENTATION', FAST_DDS) == FAST_DDS \
        and all(map(is_loopback_profile, given))


def check_believing(what: str) -> None:
    """
    Check that a profile can be given.

    :raises InputError: if it cannot.
    """
    if not can_believe():
        raise InputError('needs Fast DDS without a profile of your own', what,
                         f'unset {PROFILE_VARIABLES[0]} and RMW_IMPLEMENTATION')


def own_topics(humans: Sequence[str], avs: Sequence[str]) -> Iterator[str]:
    """Yield the names of the topics that only a run's own nodes publish, and read."""
    for topic in load_contract().topics.values():
        if topic.is_own:
            yield from topic.names(humans, avs)


def write_run_profile(path: Path, namespace: str, humans: Collection[str] = (),
                      avs: Collection[str] = (), own_orders: bool = False) -> None:
    """
    Write the profile of one run, which begins with the default one.

    :param path: of the file, which only its owner may read.
    :param humans: ids of the humans' vehicles, beside hv0 and so on with the first NUMBERS.
    :param avs: likewise of the AVs.
    :param own_orders: whether this holds for orders as well: services, and ORDER_TOPICS.
    """
    ElementTree.register_namespace('', _NAMESPACE)
    tree = ElementTree.parse(loopback_profile())
    profiles = tree.getroot()[0]
    writer = next(item for item in profiles if item.tag.endswith('}data_writer'))
    if network_is_open():
        for item in list(profiles):
            if item is not writer:
                profiles.remove(item)
    key = secrets.token_urlsafe(16)
    inside, both = key, f';{key}'
    topics = own_topics(sorted({*humans, *(f'hv{number}' for number in NUMBERS)}),
                        sorted({*avs, *(f'av{number}' for number in NUMBERS)}))
    named = (*topics, *(ORDER_TOPICS if own_orders else ()))
    names = [(f'{namespace.rstrip("/")}{topic}', inside) for topic in named]
    if own_orders:
        names += [(_SERVICE, inside), (_CLIENT, both)]
    for name, reads in names:
        reader = ElementTree.Element(f'{{{_NAMESPACE}}}data_reader')
        for element, partitions in ((reader, reads), (copy.deepcopy(writer), both)):
            element.attrib.clear()
            element.set('profile_name', name)
            element.append(_partitions(partitions))
            profiles.append(element)
    descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o600)
    with os.fdopen(descriptor, 'wb') as file:
        tree.write(file, 'utf-8', xml_declaration=True)


def check_profile(path: Path, namespace: str, own_orders: bool) -> None:
    """
    Check that a profile is one of a run.

    :param own_orders: whether it has to hold for orders as well.
    :raises InputError: if it is not.
    """
    covered = _covered(path)
    if f'{namespace.rstrip("/")}/clock' not in covered:
        raise InputError(f'is no profile of a run in the namespace {namespace or "/"}', str(path),
                         'name another file, or the namespace that it was made for')
    if own_orders and _SERVICE not in covered:
        raise InputError('was made without --own-orders', str(path), 'name another file')


def _covered(path: str | Path) -> set[str]:
    """Return for what a profile has readers; nothing if it cannot be read."""
    try:
        readers = ElementTree.parse(path).getroot().iter(f'{{{_NAMESPACE}}}data_reader')
    except (OSError, ElementTree.ParseError):
        return set()
    return {item.get('profile_name', '') for item in readers}


def open_topics(namespace: str, humans: Sequence[str], avs: Sequence[str]) -> list[str]:
    """
    Return those of a run's own topics that this process takes from every program all the same.

    :param humans: ids of the humans' vehicles in the present game.
    :param avs: ids of its AVs.
    :return: their names; none where this process has no profile of a run.
    """
    path = os.environ.get(PROFILE_VARIABLES[0])
    if not path or is_loopback_profile(path):
        return []
    covered = _covered(path)
    names = [f'{namespace.rstrip("/")}{topic}' for topic in own_topics(humans, avs)]
    missing = [name for name in names if name not in covered]
    return missing if len(missing) < len(names) else []


def _partitions(value: str) -> ElementTree.Element:
    """Return the property of an endpoint that is in these partitions, separated by `;`."""
    policy = ElementTree.Element(f'{{{_NAMESPACE}}}propertiesPolicy')
    item = policy
    for name in ('properties', 'property'):
        item = ElementTree.SubElement(item, f'{{{_NAMESPACE}}}{name}')
    for name, text in (('name', 'partitions'), ('value', value)):
        ElementTree.SubElement(item, f'{{{_NAMESPACE}}}{name}').text = text
    return policy
