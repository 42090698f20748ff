# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Seats in a running graph are taken from the script or the planner, and given back."""

from collections.abc import Callable, Iterator
import json

from crgame_ros.ros.messages import from_time, to_joy
from crgame_ros.vehicle.driver_command import DriverCommand
from live_peer import Peer
from live_support import Launcher
import numpy as np
import pytest
from rclpy.publisher import Publisher
from std_msgs.msg import String
from std_srvs.srv import SetBool
from steady_game import THROTTLE, write_steady_game

TOPICS = ('/clock', '/scenario/game', '/seats', '/timing/cycle', '/vehicles/state',
          '/diagnostics', ('/<v>/driver_command', 'hv0'), ('/<av>/plan_request', 'av0'))
# float32 represents it exactly.
BRAKE = DriverCommand(brake=0.25)


@pytest.fixture(scope='module')
def running(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Peer]:
    """Keep one graph."""
    folder = tmp_path_factory.mktemp('seats')
    with Launcher([write_steady_game(folder)], folder / 'run') as launcher, \
            Peer(launcher.domain, *TOPICS) as peer:
        peer.wait_until(lambda: peer.n > 30 and _seats(peer), 'n = 30 and the seats')
        yield peer


@pytest.fixture
def peer(running: Peer) -> Iterator[Peer]:
    """Return the peer, and restore the seats after a test, also if it fails."""
    yield running
    for seat, own in (('hv0', 'game'), ('av0', 'planner')):
        if _seats(running)[seat]['source'] != own:
            Taker(running, seat).order('game', own)


def _seats(peer: Peer) -> dict[str, dict[str, str]]:
    """Return the newest content of /seats."""
    peer.listen()
    return json.loads(peer.messages['/seats'][-1].data) if peer.messages['/seats'] else {}


class Taker:
    """A driver of its own that orders a seat and commands its vehicle at every step."""

    def __init__(self, peer: Peer, seat: str) -> None:
        self.peer = peer
        self.seat = seat
        self._orders: Publisher = peer.publisher('/seats/order')
        self._commands: Publisher = peer.publisher('/<v>/driver_command', seat)

    def order(self, source: str, then: str) -> None:
        """Order a source and wait until /seats names the resulting one."""
        self._orders.publish(String(data=json.dumps({'seat': self.seat, 'source': source})))
        self.peer.wait_until(
            lambda: _seats(self.peer).get(self.seat, {}).get('source') == then,
            f'{self.seat} driven by {then}')

    def hold(self, command: DriverCommand, until: Callable[[], object], what: str,
             source: str = 'tester') -> None:
        """Repeat a command until something holds."""
        def send() -> object:
            # None right after `forget`.
            for stamp_ns in self.peer.clock_ns[-1:]:
                self._commands.publish(to_joy(command, stamp_ns, source))
            return until()
        self.peer.wait_until(send, what)

    def consumed(self) -> np.ndarray:
        """Return the commands (R, 4) that the vehicle obeyed since the last `forget`."""
        return self.peer.cycles().commands(self.seat)


def _last(taker: Taker, column: int, value: float) -> bool:
    """Return whether the last cycle consumed this."""
    return bool(taker.peer.messages['/timing/cycle']) and taker.consumed()[-1, column] == value


def _by_hand(peer: Peer) -> np.ndarray:
    """Return the steps n at which a driver drove av0, since the last `forget`."""
    cycles = peer.cycles()
    return cycles.column('n')[cycles.drove('av0')]


def _steps(peer: Peer) -> np.ndarray:
    """Return the steps n of the states since the last `forget`; -1 before the first."""
    scheduler = peer.games[-1].scheduler
    return np.array([scheduler.step_of_stamp(from_time(message.header.stamp))
                     for message in peer.messages['/vehicles/state']] or [-1])


def test_a_seat_is_taken_from_the_script_and_given_back(peer: Peer) -> None:
    """The vehicle obeys the holder of the seat only; its own driver falls silent."""
    taker = Taker(peer, 'hv0')
    entry = _seats(peer)['hv0']
    assert (entry['source'], entry['person'], entry['here']) == ('game', None, False)
    # Before the order no node listens to a stranger.
    peer.forget()
    # On a busy machine the script may be late, and the seat lets go for a moment.
    taker.hold(BRAKE, lambda: len(peer.messages['/timing/cycle']) > 20
               and np.all(taker.consumed()[-20:, :2] == (THROTTLE, 0.0)),
               'twenty cycles of nothing but the script')
    assert np.all(taker.consumed()[:, 1] != BRAKE.brake)
    taker.order('tester', 'tester')
    taker.hold(BRAKE, lambda: _last(taker, 1, 0.25), 'the brake of the one who has the seat')
    peer.forget()
    # On a busy machine the test may pause for longer than a driver may be silent.
    taker.hold(BRAKE, lambda: len(peer.messages['/timing/cycle']) > 50
               and np.all(taker.consumed()[-50:, :2] == (0.0, 0.25)),
               'fifty cycles of nothing but that brake')
    # No other pedal was ever obeyed, not the script's either.
    assert np.all(taker.consumed()[5:, 0] == 0.0)

    def spoken() -> list[str]:
        return [message.header.frame_id for message in peer.messages['/<v>/driver_command']]
    taker.hold(BRAKE, lambda: len(spoken()) > 100 and 'game' not in spoken()[-100:],
               'silence of the script')
    taker.order('game', 'game')
    peer.wait_until(lambda: _last(taker, 0, THROTTLE), 'the script in the seat again')


@pytest.mark.exhaustive
def test_an_av_is_taken_over_and_given_back(peer: Peer) -> None:
    """The AV obeys the driver; its planner still gets requests, and drives on afterwards."""
    taker = Taker(peer, 'av0')
    peer.wait_until(lambda: len(peer.messages['/timing/cycle']), 'a cycle')
    # There are no pedals and no steering wheel; its lights are those of its plan.
    assert np.isnan(taker.consumed()[-1, :4]).all()
    peer.forget()
    taker.order('tester', 'tester')
    taker.hold(BRAKE, lambda: _last(taker, 1, 0.25), 'the brake of the one who took over')
    cycles = peer.cycles()
    first = int(cycles.column('n')[cycles.commands('av0')[:, 1] > 0.0][0])
    taker.hold(BRAKE, lambda: _steps(peer)[-1] >= first + 110, 'a second')
    steps, rows = _steps(peer), peer.states('av0')
    speeds = rows[(steps >= first) & (steps <= first + 110), 4]
    # 0.25 of the pedal brake with clearly more than 0.5 m/s^2 for about a second; the watchdog's
    # 0.15 does, too, which brakes while this test is late.
    assert speeds[-1] < speeds[0] - 0.5
    assert np.all(np.diff(speeds) <= 1e-9)
    peer.wait_until(lambda: len(peer.messages['/<av>/plan_request']) >= 8, 'requests meanwhile')
    taker.order('game', 'planner')
    peer.wait_until(lambda: peer.cycles().column('n')[-1] >= _by_hand(peer)[-1] + 150
                    and _steps(peer)[-1] >= _by_hand(peer)[-1] + 150, 'a second and a half')
    by_hand = _by_hand(peer)
    assert np.array_equal(by_hand, np.arange(by_hand[0], by_hand[-1] + 1))
    rows = peer.states('av0')[_steps(peer) >= by_hand[-1]]
    ways = np.hypot(np.diff(rows[:, 1]), np.diff(rows[:, 2]))
    steps = np.diff(rows[:, 0]) * 1e-9
    # No jump at the give-back: each way agrees with the speeds around it within 2 cm.
    assert np.all(np.abs(ways - 0.5 * (rows[1:, 4] + rows[:-1, 4]) * steps) < 0.02)


@pytest.mark.clock
def test_a_silent_taker_is_braked(peer: Peer) -> None:
    """The seat's watchdog holds for every driver: pedals released, then 0.15 of the brake."""
    taker = Taker(peer, 'hv0')
    taker.order('tester', 'tester')
    taker.hold(DriverCommand(throttle=0.5), lambda: _last(taker, 0, 0.5), 'half the throttle')
    peer.forget()
    peer.wait_until(lambda: _last(taker, 1, float(np.float32(0.15))), 'the gentle brake')
    assert taker.consumed()[-1, 0] == 0.0
    taker.order('game', 'game')
    peer.wait_until(lambda: _last(taker, 0, THROTTLE), 'the script in the seat again')


def test_orders_that_make_no_sense_change_nothing(peer: Peer) -> None:
    """After an unknown seat, an unknown source or no JSON /seats stays and the run goes on."""
    before = _seats(peer)
    orders = peer.publisher('/seats/order')
    for text in ('{', '[]', '{"seat": "hv9", "source": "x"}', '{"seat": "hv0", "source": 7}',
                 '{"seat": "hv0", "source": ""}', '{"seat": "hv0", "source": "planner"}',
                 json.dumps({'seat': 'hv0', 'source': 'x' * 41}), '[' * 100_000):
        orders.publish(String(data=text))
    n = peer.n
    peer.wait_until(lambda: peer.n > n + 50, 'half a second')
    assert _seats(peer) == before


@pytest.mark.exhaustive
def test_seats_outlive_a_reset(peer: Peer) -> None:
    """A driver keeps the seat in the next epoch."""
    taker = Taker(peer, 'hv0')
    taker.order('tester', 'tester')
    epoch = peer.games[-1].epoch
    assert peer.call('/sim/reset').success
    peer.wait_until(lambda: peer.games[-1].epoch > epoch and peer.n > 5, 'a new epoch')
    assert _seats(peer)['hv0']['source'] == 'tester'
    taker.hold(BRAKE, lambda: _last(taker, 1, 0.25), 'the brake of the one who has the seat')
    taker.order('game', 'game')


def test_planner_stop_and_go(peer: Peer) -> None:
    """A stopped planner gets no request; told to go, it plans again."""
    client = peer.node.create_client(SetBool, '/av0/planner_run')
    peer.wait_until(client.service_is_ready, 'the service')

    def order(run: bool) -> None:
        future = client.call_async(SetBool.Request(data=run))
        peer.wait_until(future.done, 'its answer')
        assert future.result().success

    order(False)
    peer.forget()
    peer.wait_until(lambda: peer.statuses('sim_node: av0 plans')[-1:]
                    and peer.statuses('sim_node: av0 plans')[-1][1]['running'] == 'false',
                    'a report that the planner is stopped')
    n = peer.n
    peer.wait_until(lambda: peer.n > n + 30, 'three ticks')
    peer.forget()
    peer.wait_until(lambda: peer.n > n + 100, 'seven ticks')
    assert not peer.messages['/<av>/plan_request']
    order(True)
    peer.wait_until(lambda: len(peer.messages['/<av>/plan_request']) > 3, 'requests again')
    stamps = [from_time(m.header.stamp) for m in peer.messages['/<av>/plan_request']]
    assert stamps == sorted(stamps)
    peer.node.destroy_client(client)
