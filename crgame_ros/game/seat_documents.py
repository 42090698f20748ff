# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The persons in seats as JSON text: parts of `/seats`, `/seats/order` and `/seats/drivers`."""

from collections.abc import Iterable
from dataclasses import asdict, dataclass
import json
from typing import Annotated, Any

from annotated_types import Len, Predicate
from crgame_ros.errors import InputError
from crgame_ros.game.driven_vehicle import VehicleId
from crgame_ros.game.game import MAX_VEHICLES
from crgame_ros.schema.bounded import Bounded, Exact
from crgame_ros.schema.json_documents import DocumentReader

SEATS_TOPIC = '/seats'
ORDER_TOPIC = '/seats/order'
DRIVERS_TOPIC = '/seats/drivers'
MAX_SOURCE_LENGTH = 40
# Printable, in one line.
SourceName = Annotated[str, Len(1, MAX_SOURCE_LENGTH), Predicate(str.isprintable)]
PersonText = Annotated[str, Len(0, 80), Predicate(str.isprintable)]


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

    id: SourceName  # noqa: A003
    name: PersonText = ''
    device: PersonText = ''
    browser: PersonText = ''
    role: PersonText = ''


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
    source: SourceName | None = None
    person: SeatPerson | None = None
    displaced: str | None = None
    left: str | None = None
    ready: Annotated[bool, Exact()] | None = None


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

    seat: VehicleId
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


@dataclass(frozen=True)
class _SeatEntry:
    """An entry of `/seats`; without a person, nobody has sat there."""

    source: str
    driver: str
    person: SeatPerson | None = None
    here: Annotated[bool, Exact()] = False
    ready: Annotated[bool, Exact()] = False


_SEATS: DocumentReader[dict[str, _SeatEntry]] = DocumentReader(
    Annotated[dict[VehicleId, _SeatEntry], Bounded(MAX_VEHICLES)], SEATS_TOPIC, 'list of seats')


def parse_seats(text: str) -> tuple[dict[str, dict[str, str]], dict[str, SeatOccupant]]:
    """
    Read `/seats`.

    :return: source and driver of each seat, and its present or last occupant, by vehicle.
    :raises InputError: if it does not follow the contract.
    """
    entries = _SEATS.read(text)
    return ({name: {'source': entry.source, 'driver': entry.driver}
             for name, entry in entries.items()},
            {name: SeatOccupant(entry.person, entry.here, entry.ready)
             for name, entry in entries.items() if entry.person is not None})


def demand_text(demand: SeatDemand) -> str:
    """Return an order as JSON."""
    content = {key: value for key, value in asdict(demand).items() if value is not None}
    return json.dumps(content)


def parse_demand(text: str) -> SeatDemand:
    """
    Read an order.

    :raises InputError: if it is malformed.
    """
    demand = _DEMAND.read(text)
    if (demand.source, demand.person, demand.left, demand.ready) == (None,) * 4:
        raise InputError('is no order', ORDER_TOPIC, 'give seat and source')
    return demand


_DEMAND: DocumentReader[SeatDemand] = DocumentReader(
    SeatDemand, ORDER_TOPIC, 'order', 'give seat and source')


@dataclass(frozen=True)
class _Spells:
    epoch: int
    drivers: Annotated[tuple[DrivingSpell, ...], Bounded(100_000)]


_SPELLS: DocumentReader[_Spells] = DocumentReader(_Spells, DRIVERS_TOPIC, 'list of drivers')


def spells_document(epoch: int, spells: Iterable[DrivingSpell]) -> str:
    """Return the text of `/seats/drivers`."""
    return json.dumps(asdict(_Spells(epoch, tuple(spells))))


def parse_spells(text: str) -> tuple[int, tuple[DrivingSpell, ...]]:
    """
    Read `/seats/drivers`.

    :return: the epoch, and its driving spells.
    :raises InputError: if it is not what `spells_document` writes.
    """
    found = _SPELLS.read(text)
    return found.epoch, found.drivers
