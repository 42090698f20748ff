# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The rules by which orders change a seat, for all states that a seat can have."""

from itertools import product

from crgame_ros.driver.seat_state import after, GAME_DRIVER, home_of, PLANNER
from crgame_ros.errors import InputError
from crgame_ros.game.seat_documents import SeatDemand, SeatEntry, SeatPerson
import pytest

ADA, BOB = SeatPerson('p1', 'Ada'), SeatPerson('p2', 'Bob')
KEYS, COCKPIT = 'keys:a.yaml', 'cockpit'
EMPTY = [SeatEntry(source, driver) for source, driver in (
    (GAME_DRIVER, KEYS), ('joy', KEYS), (COCKPIT, KEYS), (COCKPIT, COCKPIT), (PLANNER, 'idm'))]
TAKEN = [SeatEntry(COCKPIT, driver, person, here, ready)
         for driver, person, (here, ready) in product(
             (KEYS, COCKPIT, 'idm'), (ADA, BOB), ((True, False), (True, True), (False, False)))]
ORDERS = [
    SeatDemand('v', COCKPIT, ADA), SeatDemand('v', COCKPIT, BOB, displaced='p1'),
    SeatDemand('v', COCKPIT), SeatDemand('v', GAME_DRIVER), SeatDemand('v', PLANNER),
    SeatDemand('v', 'joy'), SeatDemand('v', person=ADA, ready=True),
    SeatDemand('v', person=SeatPerson('p1', 'Ada L.')), SeatDemand('v', left='p2')]


def _home(seat: SeatEntry) -> str:
    return PLANNER if seat.driver == 'idm' else home_of(seat.driver)


@pytest.mark.parametrize('order', ORDERS, ids=range(len(ORDERS)))
def test_an_order_that_is_obeyed_changes_nothing_when_it_is_repeated(order: SeatDemand) -> None:
    """Orders are repeated until they are seen to be obeyed. Nobody sits in what a page has not."""
    obeyed = 0
    for seat in (*EMPTY, *TAKEN):
        try:
            once = after(seat, order, _home(seat))
        except InputError:
            continue
        obeyed += 1
        assert after(once, order, _home(seat)) == once
        assert once.person is None or once.source == COCKPIT
        assert once.driver == seat.driver and (once.here or not once.ready)
    assert obeyed


def test_a_seat_is_taken_from_nobody_but_whom_the_order_names() -> None:
    for seat in TAKEN:
        order = SeatDemand('v', COCKPIT, BOB)
        if seat.person == BOB:
            assert after(seat, order, GAME_DRIVER).ready == seat.ready
            continue
        with pytest.raises(InputError, match='Ada has v; ask for it'):
            after(seat, order, GAME_DRIVER)
        taken = after(seat, SeatDemand('v', COCKPIT, BOB, displaced='p1'), GAME_DRIVER)
        assert (taken.person, taken.here, taken.ready) == (BOB, True, False)


def test_given_back_it_is_the_games() -> None:
    for seat in (*EMPTY, *TAKEN):
        assert after(seat, SeatDemand('v', GAME_DRIVER), _home(seat)) == SeatEntry(
            _home(seat), seat.driver)
    with pytest.raises(InputError, match='v has no planner; give game'):
        after(TAKEN[0], SeatDemand('v', PLANNER), GAME_DRIVER)


def test_only_who_sits_there_leaves_or_is_ready() -> None:
    seat = after(EMPTY[3], SeatDemand('v', COCKPIT, ADA), COCKPIT)
    ready = after(seat, SeatDemand('v', person=ADA, ready=True), COCKPIT)
    assert ready.ready and after(ready, SeatDemand('v', person=BOB, ready=False), COCKPIT) == ready
    assert after(ready, SeatDemand('v', left='p2'), COCKPIT) == ready
    left = after(ready, SeatDemand('v', left='p1'), COCKPIT)
    assert (left.person, left.here, left.ready) == (ADA, False, False)
    with pytest.raises(InputError, match='no person has v; claim it'):
        after(EMPTY[0], SeatDemand('v', left='p1'), GAME_DRIVER)
