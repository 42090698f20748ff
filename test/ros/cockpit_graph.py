# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The cockpit's live backend between pages and a graph with messages of the test."""

import asyncio
from collections.abc import Callable, Coroutine
import json
from typing import Any

from crgame_ros.cockpit.client import Client
from crgame_ros.cockpit.hub import Hub
from crgame_ros.cockpit.page_messages import parse_message
from crgame_ros.game.documents import GAME, OBJECTS
from crgame_ros.game.seat_documents import SeatEntry, SeatPerson, SEATS
from crgame_ros.messages.joints import vehicle_joint_names, vehicle_to_joints
from crgame_ros.nodes.cockpit.backend import LiveBackend
from crgame_ros.ros.messages import StateMessage
from crgame_ros.simulation.run_texts import describe_game
from crgame_ros.simulation.setup import Setup
from live_peer import Peer
import numpy as np
import rclpy
from rclpy.context import Context
from ros_domains import own_domain_id
from std_msgs.msg import String

OFFSET_NS = 1_000_000_000
PATIENCE_S = 60.0
SCRIPT = 'keys:cut_in.keys.yaml'


class Graph:
    """A backend with pages, and a peer in the role of the simulation."""

    def __init__(self, peer: Peer, hub: Hub, backend: LiveBackend, node: Any) -> None:
        self.peer = peer
        self.hub = hub
        self.backend = backend
        self.node = node
        self._publishers: dict[tuple[str, str], Any] = {}

    def page(self) -> Client:
        """Open a page."""
        client = self.hub.add(lambda: None, lambda: 0)
        self.backend.joined(client)
        return client

    async def ask(self, client: Client, kind: str, **fields: Any) -> str:
        """Send a request of a page."""
        return await self.backend.command(
            client, parse_message(json.dumps({'type': kind, 'id': 1, **fields})))

    async def say(self, name: str, message: Any, vehicle: str = '') -> None:
        """Publish a message of the simulation or a planner, once the cockpit hears it."""
        await self.meet((name, vehicle))
        self._publishers[name, vehicle].publish(message)

    async def meet(self, *topics: tuple[str, str]) -> None:
        """Wait until the cockpit hears what is published on these topics."""
        new = {topic: self.peer._endpoints.publisher(*topic)
               for topic in topics if topic not in self._publishers}
        for (name, _), publisher in new.items():
            # By the cockpit's own count: the first listener may be the peer itself.
            await self.until(lambda to=publisher: 0 < self.node.count_subscribers(to.topic_name)
                             <= to.get_subscription_count(), f'the listeners of {name}')
        if new:
            await asyncio.sleep(0.2)
        self._publishers |= new

    async def begin(self, setup: Setup, epoch: int = 0) -> None:
        """Publish the documents of a game, and wait for its scene."""
        texts = {'xml': setup.loaded.xml_text, 'objects': OBJECTS.write(setup.descriptions),
                 'game': GAME.write(describe_game(setup, epoch=epoch, clock_offset_ns=OFFSET_NS))}
        await self.meet(*((f'/scenario/{name}', '') for name in texts), ('/seats', ''))
        for name, text in texts.items():
            await self.say(f'/scenario/{name}', String(data=text))
        await self.until(lambda: self.scene.get('time', {}).get('epoch') == epoch, 'the scene')

    async def seats(self, source: str, driver: str = SCRIPT, page: Client | None = None) -> None:
        """Publish the driver of hv0, with the person at a page if there is one."""
        person = None if page is None else SeatPerson(page.person)
        await self.say('/seats', String(data=SEATS.write({
            'hv0': SeatEntry(source, driver, person, here=page is not None),
            'av0': SeatEntry('planner', 'idm')})))
        await self.until(lambda: self.seat().get('source') == source, f'/seats: {source}')

    async def state(self, setup: Setup, n: int) -> None:
        """Publish the first states of a game as those of step n."""
        message = StateMessage([name for vehicle in setup.vehicle_ids
                                for name in vehicle_joint_names(vehicle)])
        rows = [vehicle_to_joints(vehicle.state) for vehicle in setup.vehicles]
        for index, values in enumerate(
                (message.positions, message.velocities, message.accelerations)):
            values[:] = np.concatenate([row[index] for row in rows])
        await self.say('/vehicles/state', message.stamp(OFFSET_NS + n * 10_000_000))

    def document(self, kind: str) -> dict[str, Any]:
        """Return a document as pages have it."""
        return dict(json.loads(self.hub._documents.get(kind, b'{}')))

    @property
    def scene(self) -> dict[str, Any]:
        """Return the scene."""
        return self.document('scene')

    def seat(self, name: str = 'hv0') -> dict[str, Any]:
        """Return a seat as pages have it."""
        return dict(self.document('seats').get('seats', {}).get(name, {}))

    def orders(self) -> list[str]:
        """Return the sources that were ordered."""
        return [json.loads(item.data)['source'] for item in self.peer.messages['/seats/order']]

    def throttles(self) -> list[float]:
        """Return the throttle of each command that came from the cockpit."""
        return [item.axes[0] for item in self.peer.messages['/<v>/driver_command']]

    async def until(self, condition: Callable[[], object], what: str) -> None:
        """Run backend and peer until a condition holds."""
        loop = asyncio.get_running_loop()
        until_s = loop.time() + PATIENCE_S
        while not condition():
            assert loop.time() < until_s, f'waited in vain for {what}'
            self.peer.listen()
            await asyncio.sleep(0.005)

    async def hold(self, client: Client, seat: str, condition: Callable[[], object],
                   what: str, **keys: Any) -> None:
        """Repeat the keys of a page, as it does, until a condition holds."""
        loop = asyncio.get_running_loop()
        until_s = loop.time() + PATIENCE_S
        while not condition():
            assert loop.time() < until_s, f'waited in vain for {what}'
            await self.ask(client, 'input', seat=seat, **keys)
            await self.pause(0.05)

    async def pause(self, seconds: float) -> None:
        """Run backend and peer for a time."""
        until_s = asyncio.get_running_loop().time() + seconds
        while asyncio.get_running_loop().time() < until_s:
            self.peer.listen()
            await asyncio.sleep(0.005)


Check = Callable[[Graph], Coroutine[Any, Any, None]]


async def _run(check: Check) -> None:
    domain, context = own_domain_id(), Context()
    rclpy.init(context=context, domain_id=domain)
    node = rclpy.create_node('cockpit_node', context=context)
    hub, backend = Hub('live'), LiveBackend(node)
    try:
        with Peer(domain, '/seats/order', ('/<v>/driver_command', 'hv0'),
                  '/diagnostics', '/views/pictures') as peer:
            await backend.start(hub)
            await check(Graph(peer, hub, backend, node))
            assert backend._pump is not None and not backend._pump.done()
            await backend.stop()
    finally:
        node.destroy_node()
        rclpy.try_shutdown(context=context)


def lived(check: Check) -> None:
    """Run a test in an event loop, with a graph of its own."""
    asyncio.run(_run(check))
