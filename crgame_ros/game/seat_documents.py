# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The persons in seats as JSON text: parts of `/seats`, `/seats/order` and `/seats/drivers`."""

from dataclasses import dataclass
from typing import Annotated

from annotated_types import Len, Predicate
from crgame_ros.game.documents import VehicleId
from crgame_ros.game.game import MAX_VEHICLES
from crgame_ros.schema.document_marks import Bounded, Exact
from crgame_ros.schema.json_documents import JsonDocument

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

    def __post_init__(self) -> None:
        """Refuse an order without content."""
        if (self.source, self.person, self.left, self.ready) == (None,) * 4:
            raise ValueError('should order something')


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


@dataclass(frozen=True)
class DrivingSpells:
    """
    Who has driven in a run so far.

    :param epoch: of the run.
    :param drivers: their spells, in order.
    """

    epoch: int
    drivers: Annotated[tuple[DrivingSpell, ...], Bounded(100_000)]


@dataclass(frozen=True)
class SeatEntry:
    """
    A seat at present.

    :param source: the source of its commands.
    :param driver: the driver source named by the game.
    :param person: the present or last occupant; None if nobody has sat there.
    :param here: as in `SeatOccupant`, as is `ready`.
    """

    source: str
    driver: str
    person: SeatPerson | None = None
    here: Annotated[bool, Exact()] = False
    ready: Annotated[bool, Exact()] = False

    @property
    def occupant(self) -> SeatOccupant | None:
        """Return the present or last occupant."""
        return None if self.person is None else SeatOccupant(self.person, self.here, self.ready)


SEATS: JsonDocument[dict[str, SeatEntry]] = JsonDocument(
    Annotated[dict[VehicleId, SeatEntry], Bounded(MAX_VEHICLES)], '/seats', 'list of seats')
ORDER: JsonDocument[SeatDemand] = JsonDocument(
    SeatDemand, '/seats/order', 'order', 'give seat and source')
DRIVERS: JsonDocument[DrivingSpells] = JsonDocument(
    DrivingSpells, '/seats/drivers', 'list of drivers')
