# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The cockpit's handling of good and bad messages, and of seats that change."""

from array import array
import asyncio
from dataclasses import replace
import json
from typing import Any

from cockpit_graph import Graph, lived, OFFSET_NS
from crgame_ros.cockpit.client import NOT_SEEN
from crgame_ros.cockpit.page_messages import SeenView, Sound
from crgame_ros.cockpit.rights import Rights
from crgame_ros.errors import InputError
from crgame_ros.game.documents import EVENTS, FiredEvents
from crgame_ros.game.events import FiredEvent
from crgame_ros.game.game import load_game
from crgame_ros.game.instruments_spec import GazeSpec, InstrumentsSpec
from crgame_ros.game.view_documents import VIEW_PICTURE
from crgame_ros.messages.status_values import read_status
from crgame_ros.nodes.cockpit.backend import LEAST_PICTURE_S
from crgame_ros.ros.messages import from_time, to_time
from crgame_ros.simulation.setup import build_setup, Setup
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from live_support import SCENARIOS
from nav_msgs.msg import OccupancyGrid, Odometry
import numpy as np
from perception_samples import estimate, grid, perceiving_setup, scan
import pytest
from sensor_msgs.msg import LaserScan
from std_msgs.msg import Float64MultiArray, MultiArrayDimension, String
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

FULL = {'keys': [1, 0, 0, 0], 'reverse': 0}


@pytest.fixture(scope='module')
def setup(tmp_path_factory: pytest.TempPathFactory) -> Setup:
    """Load the cut-in game, with an AV that perceives."""
    return perceiving_setup(tmp_path_factory.mktemp('perceiving'))


def _trajectory(*points: int, names: tuple[str, ...] = ()) -> JointTrajectory:
    """Make a trajectory whose points have so many positions, and nothing else."""
    message = JointTrajectory(joint_names=list(names))
    message.header.stamp = to_time(OFFSET_NS)
    message.points = [JointTrajectoryPoint(positions=array('d', [float('nan')] * count))
                      for count in points]
    return message


def _cycle(columns: int, numbers: int) -> Float64MultiArray:
    message = Float64MultiArray(data=array('d', [0.0] * numbers))
    message.layout.dim = [MultiArrayDimension(), MultiArrayDimension(size=columns)]
    return message


MALFORMED = [
    ('/vehicles/state', '', [_trajectory(), _trajectory(8), _trajectory(3), _trajectory(8, 8)]),
    ('/traffic/objects', '', [_trajectory(), _trajectory(0), _trajectory(1), _trajectory(3)]),
    ('/<av>/plan', 'av0', [_trajectory(), _trajectory(4), _trajectory(*[4] * 2000)]),
    ('/<av>/plan_request', 'av0', [
        _trajectory(), _trajectory(4, 3, names=('hv0/x',)), _trajectory(0, names=('hv0/x',)),
        _trajectory(1, names=('hv0/x',)), _trajectory(*[1] * 2000, names=('hv0/x',))]),
    ('/<av>/scan', 'av0', [LaserScan(), scan('front', 10, ranges=array('f', [])),
                           scan('front', 10, range_max=float('nan')), scan('none', 10),
                           scan('front', 10, ranges=array('f', [1.0] * 20_000))]),
    ('/<av>/localization', 'av0', [Odometry(), estimate(10, float('nan'))]),
    ('/occupancy', '', [OccupancyGrid(), grid(3, 3, [0] * 8), grid(0, 0, [])]),
    ('/timing/cycle', '', [Float64MultiArray(), _cycle(20, 0), _cycle(20, 19), _cycle(7, 700)]),
    *((name, '', [String(data=text) for text in (
        '', '{', '[]', '{}', '[' * 100_000, '{"hv0": 3}', '{"hv0": {}}', '{"k": "x"}',
        '{"a b": {"source": "game", "driver": "idle"}}', '{"epoch": 1e400}', 'x' * 100_000,
        '{"hv0": {"source": ["cockpit"], "driver": "idle"}}', '{"fired": [{"name": 3}]}',
        '{"hv0": {"source": "cockpit", "driver": null}}', '{"states": 7, "k": NaN}')])
      for name in ('/seats', '/scenario/events', '/scenario/signals', '/scenario/game',
                   '/scenario/objects')),
    ('/diagnostics', '', [DiagnosticArray(status=[
        DiagnosticStatus(name=name) for name in ('', ': ', '/drivability', 'hv9/drivability',
                                                 'sim_node: run', 'sim_node: hv0 plans')])]),
]


@pytest.mark.matrix('_vehicles_state', '_scenario_game')
@pytest.mark.parametrize(('name', 'vehicle', 'messages'), MALFORMED,
                         ids=[case[0].replace('/', '_') for case in MALFORMED])
def test_no_message_stops_the_pump(setup: Setup, name: str, vehicle: str,
                                   messages: list[Any]) -> None:
    """After any message of a peer the next good state is shown, and a driver drives."""
    async def check(graph: Graph) -> None:
        page = graph.page()
        page.wants_predictions = page.wants_scans = True
        page.perceives_as = 'av0'
        await graph.begin(setup)
        await graph.seats('cockpit')
        for message in messages:
            await graph.say(name, message, vehicle)
            await graph.pause(0.06)
        await graph.seats('cockpit')
        await graph.ask(page, 'claim', seat='hv0')
        before = graph.hub._frames.get('state')
        await graph.ask(page, 'input', seat='hv0', **FULL)
        await graph.state(setup, 10)
        await graph.until(lambda: graph.hub._frames.get('state') is not before, 'the state')
        frame = np.frombuffer(graph.hub._frames['state'].data)
        assert frame[2] == 10 and frame[6:9].tolist() == [*setup.humans[0].state[:3]]
        await graph.hold(page, 'hv0', lambda: any(graph.throttles()), 'the throttle', **FULL)
        assert 'hv9' not in graph.document('status').get('drivability', {})
    lived(check)


def test_a_refused_claim_takes_nothing_away(setup: Setup) -> None:
    """A client that asks for a taken seat keeps its own."""
    async def check(graph: Graph) -> None:
        first, second = graph.page(), graph.page()
        await graph.begin(setup)
        await graph.seats('game')
        await graph.ask(first, 'claim', seat='hv0')
        await graph.ask(second, 'claim', seat='av0')
        with pytest.raises(InputError, match='ask for it'):
            await graph.ask(second, 'claim', seat='hv0')
        await graph.until(lambda: len(graph.orders()) >= 2, 'two orders')
        assert graph.seat('av0')['holder'] == second.id
        assert graph.seat('hv0')['holder'] == first.id
        assert 'game' not in graph.orders()
    lived(check)


def test_giving_back_lets_go_of_the_pedals(setup: Setup) -> None:
    """The last command is released: no held pedal is left for the next driver."""
    async def check(graph: Graph) -> None:
        page = graph.page()
        await graph.begin(setup)
        await graph.seats('cockpit')
        await graph.ask(page, 'claim', seat='hv0')
        # During a pause: no cycle comes, the page repeats its keys.
        await graph.until(lambda: graph.peer.node.count_publishers('/hv0/driver_command'),
                          'the cockpit as a driver')
        await graph.hold(page, 'hv0', lambda: any(graph.throttles()), 'the throttle', **FULL)
        await graph.ask(page, 'release', seat='hv0')
        await graph.until(lambda: graph.throttles()[-1] == 0.0, 'the pedal released')
        await graph.pause(0.3)
        assert graph.throttles()[-1] == 0.0
    lived(check)


def test_what_the_person_in_a_seat_hears_and_sees_is_told(setup: Setup) -> None:
    """It is published at each change and each second, with the run's time, for drivers only."""
    def told(graph: Graph, what: str = 'sound') -> list[tuple[int, dict[str, str]]]:
        return [(from_time(message.header.stamp), read_status(status).values)
                for message in graph.peer.messages['/diagnostics'] for status in message.status
                if status.name == f'cockpit_node: hv0 {what}']

    async def check(graph: Graph) -> None:
        page, other = graph.page(), graph.page()
        await graph.meet(('/vehicles/state', ''))
        await graph.begin(setup)
        await graph.seats('cockpit')
        await graph.state(setup, 20)
        await graph.until(lambda: 'state' in graph.hub._frames, 'the state')
        other.sound = Sound(on=True, volume=1.0, rumble=1.0)
        await graph.pause(0.3)
        assert told(graph) == []
        await graph.ask(page, 'claim', seat='hv0')
        await graph.until(lambda: told(graph), 'the sound of the seat')
        silent = {'on': 'false', 'volume': '0.00', 'rumble': '0.00'}
        assert told(graph)[0] == (OFFSET_NS + 200_000_000, silent)
        page.sound = Sound(on=True, volume=0.6, rumble=0.5)
        loud = {'on': 'true', 'volume': '0.60', 'rumble': '0.50'}
        await graph.until(lambda: told(graph)[-1][1] == loud, 'the new sound')
        await graph.until(lambda: [values for _, values in told(graph)].count(loud) > 1,
                          'the same once more')
        assert all(values in (silent, loud) for _, values in told(graph))
        assert told(graph, 'view')[0][1]['shown'] == ''
        page.view = SeenView(
            shown='driver', inset=True, plans=False, mirrors=False, bare=False, software=False,
            across_deg=75.0, ratio=0.5, rate_hz=30.0, renderer='a card', width_px=1280.0,
            height_px=720.0, away='focus', full_screen=True)
        seen = {'shown': 'driver', 'inset': 'true', 'plans': 'false', 'mirrors': 'false',
                'bare': 'false', 'across_deg': '75.0', 'screen_width_m': '',
                'eye_distance_m': '', 'width_px': '1280', 'height_px': '720', 'ratio': '0.500',
                'rate_hz': '30.0', 'renderer': 'a card', 'software': 'false',
                'away': 'focus', 'full_screen': 'true', 'device': ''}
        await graph.until(lambda: told(graph, 'view')[-1][1] == seen, 'the new view')
        assert told(graph, 'view')[-1][0] == OFFSET_NS + 200_000_000
    lived(check)


def test_the_page_of_a_seat_alone_tells_what_its_view_shows(setup: Setup) -> None:
    """Not a second page, not of another run, not if nobody asks, and not too often."""
    watched = replace(setup, game=replace(setup.game, instruments=InstrumentsSpec(
        gaze=(GazeSpec('Eyes', 'hv0'),))))

    def picture(name: str, seat: str = 'hv0', epoch: int = 1) -> dict[str, Any]:
        return {'seat': seat, 'epoch': epoch, 'steady_s': 1.0, 'clock_error_ms': 0.5,
                'place': [0, 0, 9, 9, 9, 9, 1], 'eye': [0, 0, 0, 1.2, 0, 1, 1],
                'shown': [['vehicle', name, 0, 0, 1, 1, 5.0]]}

    def told(graph: Graph) -> list[str]:
        return [VIEW_PICTURE.read(message.data).shown[0].id
                for message in graph.peer.messages['/views/pictures']]

    async def check(graph: Graph) -> None:
        page, other = graph.page(), graph.page()
        await graph.begin(setup)
        await graph.seats('cockpit')
        await graph.ask(page, 'claim', seat='hv0')
        await graph.until(lambda: graph.seat().get('holder') == page.id, 'the seat')
        with pytest.raises(InputError, match='nobody asks'):
            await graph.ask(page, 'picture', picture=picture('unasked', epoch=0))
        await graph.begin(watched, epoch=1)
        for client, shown, why in (
                (other, picture('of_another'), 'not the page'),
                (page, picture('of_the_av', 'av0'), 'nobody asks'),
                (page, picture('of_a_run_before', epoch=0), 'nobody asks')):
            with pytest.raises(InputError, match=why):
                await graph.ask(client, 'picture', picture=shown)
        await graph.until(lambda: graph.node.count_subscribers('/views/pictures'), 'the peer')
        began_s = asyncio.get_running_loop().time()
        for name in ('first', *['hasty'] * 50):
            await graph.ask(page, 'picture', picture=picture(name))
        took_s = asyncio.get_running_loop().time() - began_s
        await graph.pause(2 * LEAST_PICTURE_S)
        await graph.ask(page, 'picture', picture=picture('last'))
        await graph.until(lambda: 'last' in told(graph), 'the pictures')
        first, *hasty, last = told(graph)
        assert (first, last) == ('first', 'last')
        # On a busy machine some of them are not hasty.
        assert len(hasty) <= took_s / LEAST_PICTURE_S
    lived(check)


def test_the_page_of_an_avs_rider_is_the_first_that_may_take_its_seat(setup: Setup) -> None:
    """Spectators, drivers with a link for another seat and later pages tell no pictures of it."""
    watched = replace(setup, game=replace(setup.game, instruments=InstrumentsSpec(
        gaze=(GazeSpec('Eyes', 'av0'),))))
    picture = {'seat': 'av0', 'epoch': 0, 'steady_s': 1.0, 'clock_error_ms': 0.5,
               'place': [0, 0, 9, 9, 9, 9, 1], 'eye': [0, 0, 0, 1.2, 0, 1, 1], 'shown': []}

    async def check(graph: Graph) -> None:
        await graph.begin(watched)
        pages = [graph.page() for _ in range(4)]
        pages[0].rights = Rights.for_role('watch')
        pages[1].rights = Rights.for_role('drive', 'hv0')
        for page in pages:
            page.view = NOT_SEEN.model_copy(update={'stage': 'av0'})
        await graph.ask(pages[2], 'picture', picture=picture)
        for page in (pages[0], pages[1], pages[3]):
            with pytest.raises(InputError, match='not the page'):
                await graph.ask(page, 'picture', picture=picture)
    lived(check)


def test_an_order_is_repeated_until_it_is_answered(setup: Setup) -> None:
    """While the simulation loads a game it gets no order; no seat is lost by that."""
    async def check(graph: Graph) -> None:
        page = graph.page()
        await graph.begin(setup)
        await graph.seats('game')
        await graph.ask(page, 'claim', seat='hv0')
        await graph.until(lambda: graph.orders()[:3] == ['cockpit'] * 3, 'the order three times')
        # Messages from before the order arrived take nothing away; its result ends the repetition.
        await graph.seats('other')
        assert graph.seat()['holder'] == page.id
        await graph.seats('cockpit', page=page)
        # One may be on its way.
        most = len(graph.orders()) + 1
        await graph.pause(1.2)
        assert len(graph.orders()) <= most
        assert graph.seat()['holder'] == page.id
        # Now an outside driver takes the seat.
        await graph.seats('other')
        await graph.until(lambda: graph.seat()['holder'] is None, 'the seat taken away')
    lived(check)


@pytest.mark.exhaustive
def test_a_seat_that_was_the_cockpits_before_can_be_taken_away(setup: Setup) -> None:
    """After a restart of the cockpit a claim changes nothing on /seats: it holds at once."""
    async def check(graph: Graph) -> None:
        page = graph.page()
        await graph.begin(setup)
        await graph.seats('cockpit')
        await graph.ask(page, 'claim', seat='hv0')
        await graph.seats('other')
        await graph.until(lambda: graph.seat()['holder'] is None, 'the seat taken away')
        with pytest.raises(InputError, match='you do not have the seat'):
            await graph.ask(page, 'input', seat='hv0', **FULL)
    lived(check)


def test_another_game_leaves_nothing_behind(setup: Setup) -> None:
    """Publishers and subscriptions of vehicles that take no part any more are given up."""
    async def check(graph: Graph) -> None:
        await graph.begin(build_setup(load_game(SCENARIOS / 'two_avs.yaml')))
        await graph.say('/seats', String(data=json.dumps(
            {name: {'source': 'game', 'driver': 'idle'} for name in ('hv0', 'av0', 'av1')})))
        topics = ('/av1/plan', '/av1/plan_request', '/av1/drivability')
        await graph.until(lambda: graph.seat('av1'), 'the seat of av1')
        assert graph.node.count_publishers('/av1/driver_command') == 1
        assert [graph.node.count_subscribers(topic) for topic in topics] == [1, 1, 1]
        await graph.begin(setup, epoch=1)
        await graph.seats('game')
        await graph.until(
            lambda: not any(graph.node.count_subscribers(topic) for topic in topics)
            and not graph.node.count_publishers('/av1/driver_command'), 'the end of av1')
    lived(check)


def test_events_and_signals_are_passed_on(setup: Setup) -> None:
    """Events of this epoch only; nothing that a peer adds can pose as another document."""
    async def check(graph: Graph) -> None:
        await graph.begin(setup)
        before = graph.scene
        fired = FiredEvent('box', 30, 3, 'trigger')
        await graph.say('/scenario/events', String(data=EVENTS.write(FiredEvents(7, (fired,)))))
        await graph.pause(0.3)
        assert graph.document('events')['fired'] == []
        await graph.say('/scenario/events', String(data=EVENTS.write(
            FiredEvents(0, (replace(fired, name='rain'),)))))
        await graph.until(lambda: graph.document('events')['fired'], 'the event')
        assert graph.document('events')['fired'] == [
            {'name': 'rain', 'n': 30, 'k': 3, 'by': 'trigger'}]
        await graph.say('/scenario/signals', String(data=json.dumps(
            {'type': 'scene', 'k': 4, 'states': {'7': 'red'}, 'objects': {'o7': 9}})))
        await graph.until(lambda: graph.document('signals'), 'the signals')
        assert graph.document('signals') == {
            'type': 'signals', 'k': 4, 'states': {'7': 'red'}, 'objects': {'o7': 9}}
        assert graph.scene == before
    lived(check)
