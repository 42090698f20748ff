# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Seats in the browser: their holders, and the effects of input, silence and absence."""

from crgame_ros.cockpit.page_messages import Input
from crgame_ros.cockpit.seat_table import (
    AGAIN_S,
    GIVE_UP_S,
    HeldSeat,
    KEEP_S,
    SeatOrders,
    SeatTable,
    SILENCE_S,
)
from crgame_ros.driver.keyboard import KeyboardCycles, KeyState
from crgame_ros.errors import InputError
from crgame_ros.game.seat_documents import SeatDemand, SeatEntry, SeatPerson, SEATS
from crgame_ros.vehicle.driver_command import DriverCommand, RELEASED
import pytest

NAMES = {'c1': 'Ada', 'c2': 'Bob', 'c3': 'Cleo'}
DT = 0.01
THROTTLE = Input(seat='hv0', keys=(True, False, False, False))


@pytest.fixture
def table() -> SeatTable:
    """Return seats as /seats has them at the start of a game with one human and one AV."""
    table = SeatTable()
    table.update({'hv0': SeatEntry('game', 'keys:/home/me/games/cut_in.keys.yaml'),
                  'av0': SeatEntry('planner', 'idm')})
    return table


def test_a_seat_is_held_by_one(table: SeatTable) -> None:
    """A second client gets the holder's name and may ask for the seat."""
    table.claim('c1', 'hv0', NAMES)
    assert table.claim('c1', 'hv0', NAMES).holder == 'c1'
    with pytest.raises(InputError, match='hv0: Ada has the seat; ask for it'):
        table.claim('c2', 'hv0', NAMES)
    table.ask('c2', 'hv0')
    table.ask('c2', 'hv0')
    seat = table.document(NAMES, {})['seats']['hv0']
    assert (seat['holder'], seat['holder_name']) == ('c1', 'Ada')
    assert seat['requests'] == [{'client': 'c2', 'name': 'Bob'}]
    assert seat['others'] == [{'client': 'c3', 'name': 'Cleo'}]
    assert table.document(NAMES, {})['seats']['av0']['holder'] is None


def test_a_seat_is_handed_over_with_the_receivers_consent(table: SeatTable) -> None:
    """Only the holder offers; nothing changes until acceptance, which releases the controls."""
    first = table.claim('c1', 'hv0', NAMES)
    first.apply_input(THROTTLE, 0.0)
    table.ask('c2', 'hv0')
    table.ask('c3', 'hv0')
    with pytest.raises(InputError, match='hv0: you do not have the seat; claim it first'):
        table.offer('c2', 'hv0', 'c3')
    table.offer('c1', 'hv0', 'c2')
    assert table.document(NAMES, {})['seats']['hv0']['offer'] == {'client': 'c2', 'name': 'Bob'}
    with pytest.raises(InputError, match='not offered to you any more'):
        table.accept('c3', 'hv0')
    assert table.held['hv0'] is first and first.command(0, DT).throttle > 0.0
    assert table.accept('c2', 'hv0', 'p2') is first
    second = table.held['hv0']
    assert (second.holder, second.person, second.requests) == ('c2', 'p2', ['c3'])
    assert second.command(0, DT) == RELEASED


def test_an_offer_is_declined_withdrawn_or_ends_with_its_receiver(table: SeatTable) -> None:
    """In each case the seat stays where it is."""
    held = table.claim('c1', 'hv0', NAMES)
    for end in (lambda: table.decline('c2', 'hv0'), lambda: table.offer('c1', 'hv0', 'c1'),
                lambda: table.left('c2')):
        table.offer('c1', 'hv0', 'c2')
        end()
        assert held.offered_to is None and table.held['hv0'] is held
        with pytest.raises(InputError, match='not offered to you any more'):
            table.accept('c2', 'hv0')


def _driven(person: str = 'p1', here: bool = True) -> dict[str, SeatEntry]:
    return {'hv0': SeatEntry('cockpit', 'idle', SeatPerson(person, 'Ada'), here)}


def test_a_seat_is_kept_for_an_absent_driver(table: SeatTable) -> None:
    """For a minute only its driver and a director can claim it or give it back, then everyone."""
    seats = _driven(here=False)
    table.update(seats)
    table.note_absent({}, 100.0)
    assert table.document(NAMES, {}, 110.5)['seats']['hv0']['kept'] == {
        'name': 'Ada', 'for_s': 50}
    with pytest.raises(InputError, match='the seat is kept for Ada; it is free in 50 s'):
        table.claim('c2', 'hv0', NAMES, person='p2', may_displace=False, now_s=110.0)
    with pytest.raises(InputError, match='the seat is kept for Ada; it is free in 50 s'):
        table.release('c2', 'hv0', person='p2', may_displace=False, now_s=110.0)
    assert table.seat_kept_for('p1') == 'hv0' and table.seat_kept_for('p2') is None
    for person, may, now_s in (('p1', False, 110.0), ('p2', True, 110.0),
                               ('p2', False, 100.0 + KEEP_S)):
        assert table.claim('c2', 'hv0', NAMES, person=person, may_displace=may,
                           now_s=now_s).person == person
        del table.held['hv0']
        assert table.release('c2', 'hv0', person=person, may_displace=may, now_s=now_s) is None


def test_two_cockpits_agree(table: SeatTable) -> None:
    """A driver at the other cockpit has the seat here too, until that driver falls silent."""
    seats = _driven()
    table.update(seats)
    table.note_absent({'hv0': False}, 100.0)
    entry = table.document(NAMES, {})['seats']['hv0']
    assert (entry['holder'], entry['holder_name']) == ('p1', 'Ada')
    with pytest.raises(InputError, match='Ada drives in another cockpit'):
        table.claim('c2', 'hv0', NAMES, person='p2')
    with pytest.raises(InputError, match='Ada drives in another cockpit'):
        table.release('c2', 'hv0')
    # That cockpit was killed: no message told that the driver had gone.
    table.note_absent({'hv0': True}, 100.0)
    assert table.document(NAMES, {})['seats']['hv0']['holder'] is None
    assert table.claim('c2', 'hv0', NAMES, person='p2').holder == 'c2'
    # A quicker driver at the other cockpit gets the seat.
    assert [item.id for item in table.update(seats)] == ['hv0']


def test_an_order_in_vain_is_not_repeated() -> None:
    """An order ends when the simulation has given the seat to a driver at another cockpit."""
    orders = SeatOrders()
    demand = SeatDemand('hv0', 'cockpit', SeatPerson('p2'))
    orders.note(demand, _seats('game'), 0.0)
    seats = _driven()
    orders.answered(seats)
    assert 'hv0' not in orders
    displacing = SeatDemand('hv0', 'cockpit', SeatPerson('p2'), 'p1')
    orders.note(displacing, seats, 0.0)
    orders.answered(seats)
    assert 'hv0' in orders
    orders.answered(_driven('p2'))
    assert 'hv0' not in orders
    # Somebody else had the seat, and has left it: the order does not name them.
    orders.note(demand, _seats('game'), 0.0)
    orders.answered(_driven(here=False))
    assert 'hv0' not in orders


def test_release_gives_back(table: SeatTable) -> None:
    """The holder releases a seat, any client an abandoned one, no client another's seat."""
    table.claim('c1', 'hv0', NAMES)
    with pytest.raises(InputError, match='another person has the seat'):
        table.release('c2', 'hv0')
    assert table.release('c1', 'hv0').id == 'hv0'  # type: ignore[union-attr]
    with pytest.raises(InputError, match='no person at this cockpit has the seat'):
        table.release('c1', 'hv0')
    table.update({'hv0': SeatEntry('cockpit', 'idle')})
    assert table.release('c2', 'hv0') is None


def test_a_client_that_is_gone_leaves_nothing(table: SeatTable) -> None:
    """Its seat is free and its requests are forgotten."""
    table.claim('c1', 'hv0', NAMES)
    table.claim('c2', 'av0', NAMES)
    table.ask('c2', 'hv0')
    assert table.left('c2').id == 'av0'  # type: ignore[union-attr]
    assert 'av0' not in table.held and table.held['hv0'].requests == []
    assert table.left('c3') is None


def test_unknown_seat_lists_what_there_is(table: SeatTable) -> None:
    """The message names the wrong value and the valid ones, as all messages do."""
    for act in (lambda: table.claim('c1', 'hv7', NAMES), lambda: table.release('c1', 'hv7'),
                lambda: table.ask('c1', 'hv7'), lambda: table.offer('c1', 'hv7', 'c2')):
        with pytest.raises(InputError, match='hv7: there is no such seat; it has hv0, av0'):
            act()


def test_vehicles_of_another_game_lose_their_holders(table: SeatTable) -> None:
    """A seat that no longer exists has no holder."""
    table.claim('c1', 'av0', NAMES)
    assert [seat.id for seat in table.update({'hv0': SeatEntry('game', 'idle')})] \
        == ['av0']
    assert table.held == {}


def test_the_driver_is_named_without_the_way_to_its_file(table: SeatTable) -> None:
    """Remote clients get no path of this machine."""
    assert table.document(NAMES, {})['seats']['hv0']['driver'] == 'keys:cut_in.keys.yaml'


def test_keys_go_through_the_papers_filter() -> None:
    """CRG 18-19 apply in simulation time: commands equal a keyboard's at the same cycles."""
    seat, keyboard = HeldSeat('hv0', 'c1'), KeyboardCycles()
    seat.apply_input(Input(seat='hv0', keys=(True, False, True, False)), 0.0)
    for n in range(40):
        assert seat.command(n, DT) == keyboard.command(n, KeyState(True, False, True), DT)
    # r_th+ = 1.8 / s over 40 cycles of 10 ms, s_max = 0.65.
    assert seat.command(39, DT).throttle == pytest.approx(1.8 * 0.4)
    assert seat.command(39, DT).steering == pytest.approx(0.65)


def test_axes_pass_as_they_are() -> None:
    """Axes are not changed, as the page has calibrated them."""
    seat = HeldSeat('hv0', 'c1')
    seat.apply_input(Input(seat='hv0', axes=(0.25, 0.0, -0.5), reverse=True), 0.0)
    assert seat.command(3, DT) == DriverCommand(0.25, 0.0, -0.5, True)


def test_hands_off_means_released_at_once() -> None:
    """The next command is released without a ramp; the filter restarts after the return."""
    seat = HeldSeat('hv0', 'c1')
    seat.apply_input(THROTTLE, 0.0)
    for n in range(50):
        seat.command(n, DT)
    seat.apply_input(Input(seat='hv0', away=True), 0.5)
    assert seat.away and seat.command(50, DT) == RELEASED
    seat.apply_input(THROTTLE, 0.6)
    assert seat.command(60, DT).throttle == pytest.approx(1.8 * DT)


def test_silence_is_noticed() -> None:
    """A page that hangs sends no message at all, so its silence must be detected."""
    seat = HeldSeat('hv0', 'c1')
    assert not seat.is_silent(100.0)
    seat.apply_input(THROTTLE, 100.0)
    assert not seat.is_silent(100.0 + 0.9 * SILENCE_S)
    assert seat.is_silent(100.0 + 1.1 * SILENCE_S)
    seat.release()
    assert not seat.is_silent(200.0)


def test_a_new_run_begins_at_cycle_0() -> None:
    """After a reset the step counter falls, and the filter follows it without an error."""
    seat = HeldSeat('hv0', 'c1')
    seat.apply_input(THROTTLE, 0.0)
    for n in range(500, 550):
        seat.command(n, DT)
    assert seat.command(0, DT).throttle == pytest.approx(1.8 * DT)


def _seats(source: str, driver: str = 'idle') -> dict[str, SeatEntry]:
    return {'hv0': SeatEntry(source, driver)}


def test_what_was_said_before_an_order_arrived_takes_nothing_away(table: SeatTable) -> None:
    """The seat stays held until the answer arrives; from then on /seats decides."""
    orders = SeatOrders()
    table.claim('c1', 'hv0', NAMES)
    orders.note(SeatDemand('hv0', 'cockpit'), table.seats, 0.0)
    for source, awaited, held in (('game', True, True), ('cockpit', False, True),
                                  ('game', False, False)):
        orders.answered(_seats(source))
        table.update(_seats(source), orders)
        assert ('hv0' in orders, 'hv0' in table.held) == (awaited, held)


def test_orders_are_repeated_and_given_up(table: SeatTable) -> None:
    """Orders repeat every 0.5 s for 10 s, as a reset with a big map can block for seconds."""
    orders = SeatOrders()
    taken, given = SeatDemand('hv0', 'cockpit'), SeatDemand('hv0', 'game')
    orders.note(taken, table.seats, 100.0)
    assert orders.due(100.0 + 0.9 * AGAIN_S) == []
    assert orders.due(100.0 + AGAIN_S) == [taken]
    assert orders.due(100.0 + 1.9 * AGAIN_S) == []
    # The later order counts.
    orders.note(given, table.seats, 101.0)
    assert orders.due(101.0 + AGAIN_S) == [given]
    assert orders.due(101.0 + GIVE_UP_S) == [] and 'hv0' not in orders


@pytest.mark.parametrize(('ordered', 'source', 'driver'), [
    ('cockpit', 'cockpit', 'idle'), ('game', 'game', 'idle'), ('game', 'other', 'idle'),
    ('game', 'cockpit', 'cockpit')], ids=['taken', 'given back', 'to another', 'at home'])
def test_what_is_so_already_needs_no_answer(ordered: str, source: str, driver: str) -> None:
    """The simulation sends no answer if the seat does not change."""
    orders = SeatOrders()
    demand = SeatDemand('hv0', ordered)
    orders.note(demand, _seats(source, driver), 0.0)
    assert 'hv0' not in orders
    orders.note(demand, {}, 0.0)
    assert 'hv0' in orders
    orders.answered(_seats(source, driver))
    assert 'hv0' not in orders


@pytest.mark.parametrize('text', [
    '', '[]', '7', '[' * 100_000, '{"hv0": 3}', '{"hv0": {"source": "game"}}',
    '{"hv0": {"source": 1, "driver": "idle"}}', '{"a b": {"source": "game", "driver": "idle"}}',
    '{"hv0000": {"source": "game", "driver": "idle"}}',
    '{"hv0": {"source": "game", "driver": "idle", "here": 1}}'])
def test_seats_that_are_none_are_refused(text: str) -> None:
    """A bad name would become a topic, and a missing source an error during the drive."""
    with pytest.raises(InputError, match='/seats: is no list of seats'):
        SEATS.read(text)
