# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""How orders change a seat: the rules by which sim_node obeys them, and cockpits wait for it."""

from dataclasses import replace

from crgame_ros.driver.source import COCKPIT
from crgame_ros.errors import InputError
from crgame_ros.game.seat_documents import ORDER, SeatDemand, SeatEntry

# The game's own driver, an AV's planner, and the recorded take-over of an AV; any other source
# names its own driver.
GAME_DRIVER = 'game'
PLANNER = 'planner'
REPLAY = 'replay'
# These return a seat to whom the game gives it.
RETURNING = (GAME_DRIVER, PLANNER)


def home_of(driver: str) -> str:
    """Return the source of a human's seat that the game gives to a driver source."""
    return COCKPIT if driver.strip() == COCKPIT else GAME_DRIVER


def after(seat: SeatEntry, demand: SeatDemand, home: str) -> SeatEntry:
    """
    Return a seat after an order; one that is obeyed already changes nothing.

    :param home: the source that has the seat by the game.
    :raises InputError: if the order is refused.
    """
    if demand.source is None:
        return _with_person(seat, demand)
    if demand.source == COCKPIT:
        return _at_cockpit(seat, demand)
    if demand.source == PLANNER != home:
        raise InputError(f'{demand.seat} has no planner', ORDER.topic, 'give game')
    return SeatEntry(home if demand.source in RETURNING else demand.source, seat.driver)


def _at_cockpit(seat: SeatEntry, demand: SeatDemand) -> SeatEntry:
    """Seat a person at a page, unless somebody else sits there."""
    sits, taker = seat.person, demand.person
    if sits is not None and (taker is None or sits.id not in (taker.id, demand.displaced)):
        raise InputError(f'{sits.name or "another person"} has {demand.seat}', ORDER.topic,
                         'ask for it')
    if seat.source != COCKPIT:
        seat = SeatEntry(COCKPIT, seat.driver)
    if taker is None:
        return seat
    same = seat.person is not None and seat.person.id == taker.id
    return replace(seat, person=taker, here=True, ready=same and seat.ready)


def _with_person(seat: SeatEntry, demand: SeatDemand) -> SeatEntry:
    """Update the person in a seat, who may have left."""
    if seat.person is None:
        raise InputError(f'no person has {demand.seat}', ORDER.topic, 'claim it')
    if demand.left == seat.person.id:
        return replace(seat, here=False, ready=False)
    if demand.person is None or demand.person.id != seat.person.id:
        return seat
    ready = seat.ready if demand.ready is None else demand.ready
    return replace(seat, person=demand.person, ready=seat.here and ready)
