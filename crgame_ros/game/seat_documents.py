# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The persons in seats as JSON text: parts of `/seats`, `/seats/order` and `/seats/drivers`."""

from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass
import json
from typing import Any

from crgame_ros.errors import InputError
from crgame_ros.game.documents import MALFORMED, SEATS_TOPIC
from crgame_ros.game.driven_vehicle import VEHICLE_ID

ORDER_TOPIC = '/seats/order'
DRIVERS_TOPIC = '/seats/drivers'
MAX_PERSON_TEXT = 80
MAX_SOURCE_LENGTH = 40


@dataclass(frozen=True)
class SeatPerson:
    """
    A person in a seat, described only by their own entries.

    :param id: constant for the lifetime of the person's page.
    :param name: as typed.
    :param device: the input device in use.
    :param browser: of the page, empty outside a browser.
    :param role: in the experiment.
    """

    id: str  # noqa: A003
    name: str = ''
    device: str = ''
    browser: str = ''
    role: str = ''


@dataclass(frozen=True)
class SeatOccupant:
    """
    The present or last occupant of a seat.

    :param person: the occupant.
    :param here: false once the connection to their page has ended.
    :param ready: whether they have confirmed to be ready at the start.
    """

    person: SeatPerson
    here: bool = True
    ready: bool = False


@dataclass(frozen=True)
class SeatDemand:
    """
    The content of an order; None means unchanged.

    :param seat: the vehicle.
    :param source: the source of its commands.
    :param person: the new occupant, or a new description of the present one.
    :param displaced: id of the person who is displaced: the order is valid for no other.
    :param left: id of the person whose connection has ended.
    :param ready: whether the person in the seat is ready.
    """

    seat: str
    source: str | None = None
    person: SeatPerson | None = None
    displaced: str | None = None
    left: str | None = None
    ready: bool | None = None


@dataclass
class DrivingSpell:
    """
    One stretch of steps in which a seat was driven by one source and one person.

    :param seat: the vehicle.
    :param source: the source of its commands.
    :param driver: the driver source named by the game.
    :param person: in a cockpit; None elsewhere, and while the seat was left.
    :param from_n: the first step.
    :param until_n: the first step of the next spell; None if it has not ended.
    """

    seat: str
    source: str
    driver: str
    person: SeatPerson | None
    from_n: int
    until_n: int | None = None


def seat_entry(source: str, driver: str, tenant: SeatOccupant | None) -> dict[str, Any]:
    """Return a seat's entry of `/seats`."""
    entry: dict[str, Any] = {'source': source, 'driver': driver}
    if tenant is not None:
        entry.update(person=asdict(tenant.person), here=tenant.here, ready=tenant.ready)
    return entry


def parse_tenants(text: str) -> dict[str, SeatOccupant]:
    """
    Read the occupants of the seats from `/seats`.

    :raises InputError: if it does not follow the contract.
    """
    try:
        return {str(name): SeatOccupant(_person(entry['person']), entry['here'] is True,
                                        entry['ready'] is True)
                for name, entry in json.loads(text).items() if entry.get('person') is not None}
    except (*MALFORMED, InputError) as error:
        raise InputError('is not what the contract says', SEATS_TOPIC) from error


def demand_text(demand: SeatDemand) -> str:
    """Return an order as JSON."""
    content = {key: value for key, value in asdict(demand).items() if value is not None}
    return json.dumps(content)


def parse_demand(text: str) -> SeatDemand:
    """
    Read an order.

    :raises InputError: if it is malformed.
    """
    try:
        content = json.loads(text)
        person, ready = content.get('person'), content.get('ready')
        demand = SeatDemand(
            str(content['seat']), content.get('source'),
            None if person is None else _person(person), content.get('displaced'),
            content.get('left'), None if ready is None else ready is True)
    except MALFORMED as error:
        raise InputError('is no order', ORDER_TOPIC, 'give seat and source') from error
    if (demand.source, demand.person, demand.left, demand.ready) == (None,) * 4:
        raise InputError('is no order', ORDER_TOPIC, 'give seat and source')
    if demand.source is not None and not is_short(demand.source, MAX_SOURCE_LENGTH):
        raise InputError('the source is no name', ORDER_TOPIC, 'give game or a driver')
    return demand


def spells_document(epoch: int, spells: Iterable[DrivingSpell]) -> str:
    """Return the text of `/seats/drivers`."""
    return json.dumps({'epoch': epoch, 'drivers': [asdict(item) for item in spells]})


def parse_spells(text: str) -> tuple[int, tuple[DrivingSpell, ...]]:
    """
    Read `/seats/drivers`.

    :return: the epoch, and its driving spells.
    :raises InputError: if it is not what `spells_document` writes.
    """
    try:
        content = json.loads(text)
        spells = tuple(
            DrivingSpell(str(item['seat']), str(item['source']), str(item['driver']),
                         None if item['person'] is None else _person(item['person']),
                         int(item['from_n']),
                         None if item['until_n'] is None else int(item['until_n']))
            for item in content['drivers'])
        epoch = int(content['epoch'])
    except (*MALFORMED, InputError) as error:
        raise InputError('is not what the contract says', DRIVERS_TOPIC) from error
    if not all(VEHICLE_ID.fullmatch(item.seat) for item in spells):
        raise InputError('is not what the contract says', DRIVERS_TOPIC)
    return epoch, spells


def is_short(text: object, length: int, least: int = 1) -> bool:
    """Return whether a value is a printable text of one line."""
    return isinstance(text, str) and least <= len(text) <= length and text.isprintable()


def _person(entry: Mapping[str, Any]) -> SeatPerson:
    person = SeatPerson(entry['id'], *(entry.get(name, '') for name in (
        'name', 'device', 'browser', 'role')))
    if not is_short(person.id, MAX_SOURCE_LENGTH) or not all(
            is_short(text, MAX_PERSON_TEXT, 0)
            for text in (person.name, person.device, person.browser, person.role)):
        raise InputError('the person is not described as the contract says', ORDER_TOPIC)
    return person
