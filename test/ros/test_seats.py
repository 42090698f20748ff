# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Seats of a run over DDS: losses, pauses, changes of hands and floods, step by step."""

from collections.abc import Iterator
import json
from typing import NamedTuple

from crgame_ros.driver.seat_state import GAME_DRIVER
from crgame_ros.driver.source import ReplayDriver
from crgame_ros.game.game import load_game
from crgame_ros.recording.recorded_game import RecordedInputs
from crgame_ros.ros.endpoints import Endpoints
from crgame_ros.ros.messages import to_joy
from crgame_ros.ros.seats import COMMAND_DEPTH, MAX_ORDERS, Seat, Seats
from crgame_ros.simulation.setup import build_setup
from crgame_ros.vehicle.driver_command import DriverCommand, RELEASED
from live_peer import Peer
from live_support import CUT_IN, wait_until
import numpy as np
import pytest
import rclpy
from rclpy.context import Context
from rclpy.node import Node
from rclpy.publisher import Publisher
from ros_domains import own_domain_id
from std_msgs.msg import String

MS = 1_000_000
OFFSET_NS = 1_000_000_000
FULL = DriverCommand(throttle=1.0)


class Table(NamedTuple):
    """The seats, and a stranger that commands and orders."""

    seats: Seats
    sources: dict[str, str]
    node: Node
    peer: Peer
    commands: Publisher
    orders: Publisher

    @property
    def human(self) -> Seat:
        """Return the seat of hv0."""
        return self.seats.humans[0]

    def say(self, command: DriverCommand, source: str = GAME_DRIVER) -> None:
        """Command hv0, and wait until it has come."""
        self.commands.publish(to_joy(command, OFFSET_NS, source))
        self.commands.wait_for_all_acked()

    def order(self, source: str, now_ns: int = 0) -> None:
        """Order a source for hv0, and have it obeyed."""
        self.orders.publish(String(data=json.dumps({'seat': 'hv0', 'source': source})))
        wait_until(lambda: self.seats.apply_orders(now_ns)[0], f'the order {source}')

    def drive(self, first_ms: int, last_ms: int) -> DriverCommand | None:
        """Drive hv0 at 20 m/s, a cycle each 10 ms of the steady clock; return the last command."""
        command = None
        for now_ms in range(first_ms, last_ms, 10):
            command = self.human.command(now_ms * MS, 0.01, 20.0)
        return command


@pytest.fixture
def table() -> Iterator[Table]:
    """Return seats of the cut-in game and a peer, after they are matched."""
    domain, context = own_domain_id(), Context()
    rclpy.init(context=context, domain_id=domain)
    node = rclpy.create_node('seats', context=context)
    sources: dict[str, str] = {}
    seats = Seats(Endpoints(node), build_setup(load_game(CUT_IN)), OFFSET_NS, sources)
    with Peer(domain) as peer:
        yield Table(seats, sources, node, peer, peer.publisher('/<v>/driver_command', 'hv0'),
                    peer.publisher('/seats/order'))
    node.destroy_node()
    rclpy.try_shutdown(context=context)


def _heard(table: Table, command: DriverCommand, source: str = GAME_DRIVER) -> None:
    """Send the seat a command at 0 ms of the steady clock."""
    def obeyed() -> bool:
        table.say(command, source)
        return table.human.command(0, 0.01, 20.0) == command
    wait_until(obeyed, 'the command')


def test_a_pause_is_no_loss(table: Table) -> None:
    """A pedal that is held goes on being held for as long after the pause as without one."""
    _heard(table, FULL)
    table.human.restart_timeout(5_000 * MS)
    assert table.drive(5_000, 5_190) == FULL
    assert table.human.losses == 0


def test_a_pause_gives_a_lost_driver_no_pedals_back(table: Table) -> None:
    """A driver died with the pedal down; pausing and stepping must not press it again."""
    _heard(table, FULL)
    lost = table.drive(10, 1_500)
    assert lost is not None and lost.throttle == 0.0 and lost.brake > 0.0 and table.human.lost
    # Ten single steps of ten cycles, each after a pause.
    for step in range(10):
        start_ms = 10_000 + 1_000 * step
        table.human.restart_timeout(start_ms * MS)
        for now_ms in range(start_ms, start_ms + 100, 10):
            command = table.human.command(now_ms * MS, 0.01, 20.0)
            assert command is not None and command.throttle == 0.0 and command.brake > 0.0
    assert table.human.losses == 1


def test_the_seat_of_a_lost_driver_is_taken_released(table: Table) -> None:
    """Pedals stay released: a claim is no command of the driver that died with the pedal down."""
    _heard(table, FULL)
    table.drive(10, 1_500)
    table.order('cockpit', 1_500 * MS)
    for now_ms in range(1_500, 1_700, 10):
        command = table.human.command(now_ms * MS, 0.01, 20.0)
        assert command is not None and command.throttle == 0.0
    table.say(FULL, 'cockpit')
    wait_until(lambda: table.human.listen(1_700 * MS) and not table.human.lost
               and (table.drive(1_700, 1_710) or RELEASED).throttle > 0.0, 'the new driver')


def test_a_change_of_hands_keeps_the_command_until_the_new_one_speaks(table: Table) -> None:
    """The pedals do not dip, but for no longer than the watchdog waits for any driver."""
    _heard(table, FULL)
    table.order('cockpit')
    assert table.drive(0, 200) == FULL
    command = table.drive(200, 400)
    assert command is not None and command.throttle < 1.0 and table.human.lost


@pytest.mark.parametrize('ordered', [['cockpit', 'game'], ['game', 'cockpit', 'game']], ids=len)
def test_given_back_is_forgotten(table: Table, ordered: list[str]) -> None:
    """In the next game, that one's driver has the seat: nothing of this game's driver is kept."""
    for source in ordered:
        table.orders.publish(String(data=json.dumps({'seat': 'hv0', 'source': source})))
    wait_until(lambda: table.seats.apply_orders(0) and table.human.source == 'game'
               and 'hv0' not in table.sources, 'the seat given back')


def test_released_in_a_cockpit_game_it_is_the_next_games_drivers(table: Table) -> None:
    """Its home is the cockpit there; the scripted game after it is driven by its script."""
    table.human.home = 'cockpit'
    table.order('cockpit')
    assert table.sources == {'hv0': 'cockpit'}
    table.orders.publish(String(data='{"seat": "hv0", "source": "game"}'))
    wait_until(lambda: table.seats.apply_orders(0) is not None and not table.sources, 'the order')
    seats = Seats(Endpoints(table.node), build_setup(load_game(CUT_IN)), OFFSET_NS, table.sources)
    assert seats.humans[0].source == GAME_DRIVER


def test_a_flood_does_not_hold_up_a_cycle(table: Table) -> None:
    """Of a hundred waiting orders a cycle takes ten, of commands what fits into the queue."""
    for _ in range(3 * MAX_ORDERS):
        table.orders.publish(String(data='nonsense'))
    table.orders.wait_for_all_acked()
    taken = []
    wait_until(lambda: taken.append(len(table.seats.apply_orders(0)[1]))
               or sum(taken) == 3 * MAX_ORDERS, 'all refusals')
    assert max(taken) <= MAX_ORDERS
    asked = 0

    class Flood:
        """A slot that is never empty."""

        def pop(self) -> object:
            """Return another command."""
            nonlocal asked
            asked += 1
            return to_joy(FULL, OFFSET_NS, GAME_DRIVER)
    table.human.commands = Flood()  # type: ignore[assignment]
    assert table.human.listen(0)
    assert asked == COMMAND_DEPTH


def test_what_makes_no_command_is_counted(table: Table) -> None:
    """A command of an earlier run or another source, without axes or not finite does not drive."""
    _heard(table, RELEASED)
    old, empty, stranger = (to_joy(FULL, stamp_ns, source) for stamp_ns, source in (
        (OFFSET_NS - 1, GAME_DRIVER), (OFFSET_NS, GAME_DRIVER), (OFFSET_NS, 'stranger')))
    empty.axes = []
    for message in (old, empty, stranger, to_joy(
            DriverCommand(float('nan'), float('inf'), float('-inf')), OFFSET_NS, GAME_DRIVER),
            to_joy(DriverCommand(7.0, 1.0, -3.0), OFFSET_NS, GAME_DRIVER)):
        table.commands.publish(message)
    found = []
    wait_until(lambda: found.append(table.human.command(0, 0.01, 20.0))
               or found[-1] != RELEASED, 'the last of them')
    assert found[-1] == DriverCommand(1.0, 1.0, -1.0)
    assert (table.human.outdated, table.human.malformed) == (1, 2)


def test_a_command_without_a_stamp_is_meant_for_now(table: Table) -> None:
    """As `ros2 topic pub` sends it."""
    _heard(table, RELEASED)
    table.commands.publish(to_joy(FULL, 0, GAME_DRIVER))
    wait_until(lambda: table.human.command(0, 0.01, 20.0) == FULL, 'the command')
    assert table.human.outdated == 0


def test_a_recording_drives_by_the_step(table: Table) -> None:
    """
    Row n counts in cycle n, however late it is; a taken seat is given back to row n.

    After the last row the seat is empty: the pedals go up and the brake holds. An AV is driven
    in the rows in which it was taken over, and follows its plan elsewhere.
    """
    setup = build_setup(load_game(CUT_IN))
    rows = np.array([[0.01 * n, 0.0, 0.0, 0.0] for n in range(100)])
    taken = np.full((100, 4), np.nan)
    taken[40:50] = (0.0, 1.0, 0.0, 0.0)
    intervals = np.linspace(0.005, 0.015, 100)
    seats = Seats(Endpoints(table.node), setup, OFFSET_NS, {}, RecordedInputs(
        {'hv0': ReplayDriver(rows), 'av0': ReplayDriver(taken)}, intervals))
    table = table._replace(seats=seats)
    seat, av = seats.humans[0], seats.avs[0]
    # A second between two cycles is no loss, and other messages for the seat are not heard.
    table.say(FULL)
    given = [seat.command(n * 1000 * MS, 0.01, 20.0, n) for n in range(0, 40)]
    assert [command.throttle for command in given] == rows[:40, 0].tolist()
    assert [seats.interval_s(n) for n in range(100)] == intervals.tolist()
    told = []
    for n, command in ((39, None), (40, DriverCommand(0.0, 1.0)), (49, DriverCommand(0.0, 1.0)),
                       (50, None)):
        assert av.command(0, 0.01, 10.0, n) == command
        told.append((seats.repetition_changed(), json.loads(seats.document())['av0']['source']))
    assert told == [(False, 'planner'), (True, 'replay'), (False, 'replay'), (True, 'planner')]
    wait_until(lambda: table.orders.get_subscription_count() > 1, 'the second seats')
    table.order('cockpit', 40_000 * MS)
    # What was commanded last holds until the new driver speaks, over measured intervals.
    assert seat.command(40_000 * MS, 0.01, 20.0, 60) == given[-1]
    assert seats.interval_s(60) is None
    table.order('game', 40_000 * MS)
    assert seat.command(41_000 * MS, 0.01, 20.0, 61).throttle == rows[61, 0]
    after = [seat.command(41_000 * MS, 0.01, 20.0, n) for n in range(99, 200)]
    assert after[0].throttle == 0.99
    # r_p- = 2.2 /s: 0.99 is gone after 45 steps of 10 ms, then the brake rises to 0.15 and stays.
    assert [command.throttle > 0.0 for command in after] == [True] * 45 + [False] * 56
    assert after[-1] == DriverCommand(0.0, 0.15)
    assert seats.interval_s(100) is None and not seat.losses


def _demand(table: Table, **fields: object) -> tuple[bool, list[str]]:
    """Send an order about hv0 and return whether anything changed, and the refusals."""
    table.orders.publish(String(data=json.dumps({'seat': 'hv0', **fields})))
    told: list[tuple[bool, list[str]]] = []

    def obeyed() -> bool:
        told.append(table.seats.apply_orders(0))
        return told[-1] != (False, [])
    wait_until(obeyed, 'the order')
    return told[-1]


def test_of_two_cockpits_the_first_gets_the_seat(table: Table) -> None:
    """A claim that names the displaced person gets it; one that assumes a free seat does not."""
    ada, bob = {'id': 'p1', 'name': 'Ada'}, {'id': 'p2', 'name': 'Bob'}
    assert _demand(table, source='cockpit', person=ada) == (True, [])
    assert _demand(table, source='cockpit', person=bob)[1] == [
        '/seats/order: Ada has hv0; ask for it']
    assert _demand(table, source='cockpit')[1] == ['/seats/order: Ada has hv0; ask for it']
    assert _demand(table, person=ada, ready=True) == (True, []) and table.human.ready
    assert _demand(table, left='p1') == (True, []) and not table.human.ready
    entry = json.loads(table.seats.document())['hv0']
    assert (entry['source'], entry['here']) == ('cockpit', False)
    assert entry['person']['name'] == 'Ada'
    assert _demand(table, source='cockpit', person=bob, displaced='p1') == (True, [])
    assert [item[:2] + (item[3],) for item in table.seats.driven()] == [
        ('hv0', 'cockpit', table.human.tenant.person)]  # type: ignore[union-attr]
    # A message about another person changes nothing, whatever its sender.
    table.orders.publish(String(data=json.dumps({'seat': 'hv0', 'left': 'p1'})))
    assert _demand(table, source='game') == (True, [])
    assert json.loads(table.seats.document())['hv0']['person'] is None


@pytest.mark.parametrize('person', [
    {'name': 'x'}, {'id': ''}, {'id': 7}, {'id': 'p1', 'name': 'x' * 81},
    {'id': 'p1', 'device': 'a\nb'}, {'id': 'p1', 'role': None}, [], 'p1'])
def test_people_that_cannot_be_shown_are_refused(table: Table, person: object) -> None:
    """Any peer may order, and the text of its order goes into pages and recordings."""
    changed, refusals = _demand(table, source='cockpit', person=person)
    assert not changed and len(refusals) == 1 and refusals[0].startswith('/seats/order: ')
    assert table.human.source == GAME_DRIVER
