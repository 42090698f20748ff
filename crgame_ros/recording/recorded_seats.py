# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Who asked to drive what in a recorded run: the orders of its seats."""

import json
from pathlib import Path
from typing import NamedTuple

from crgame_ros.errors import InputError
from crgame_ros.game.documents import MALFORMED
from crgame_ros.game.driven_vehicle import VEHICLE_ID
from crgame_ros.messages.cdr import header_stamp_ns
from crgame_ros.messages.world_messages import VEHICLES_TOPIC
from crgame_ros.recording.epochs import read_epoch
from crgame_ros.recording.reader import BagReader

SEAT_ORDER_TOPIC = '/seats/order'


class SeatOrder(NamedTuple):
    """
    That somebody asked for a seat, or gave it back.

    :param n: simulation step of the newest state then.
    :param seat: the vehicle.
    :param source: whose commands it shall obey; `game` and `planner` give it back.
    """

    n: int
    seat: str
    source: str


def read_seat_orders(path: Path, epoch: int | None = None) -> tuple[SeatOrder, ...]:
    """
    Read the orders of a run from its recording.

    They carry no stamp: each belongs to the newest state that was recorded before it.

    :param epoch: which run, where a recording holds several; None for the last.
    :raises InputError: if there is no such run in it.
    """
    with BagReader(path, parts=True) as reader:
        topic = reader.topics.get(SEAT_ORDER_TOPIC)
        if topic is None or not topic.message_count:
            return ()
        run = read_epoch(reader, epoch)
        found: list[SeatOrder] = []
        newest: int | None = None
        for message in reader.messages([SEAT_ORDER_TOPIC, VEHICLES_TOPIC]):
            if message.topic == VEHICLES_TOPIC:
                stamp_ns = header_stamp_ns(message.data)
                held = run.holds(stamp_ns, message.log_time_ns)
                newest = run.game.scheduler.step_of_stamp(stamp_ns) if held else None
                continue
            if newest is None:
                # Before the run's first state, or of another run.
                continue
            try:
                found.append(_order(newest, str(reader.decode(message).message.data)))
            except InputError:
                # Anybody may have published on this topic.
                continue
        return tuple(found)


def _order(n: int, text: str) -> SeatOrder:
    try:
        content = json.loads(text)
        order = SeatOrder(n, content['seat'], content['source'])
        if not VEHICLE_ID.fullmatch(order.seat) or not isinstance(order.source, str):
            raise ValueError('no seat, or no source')
    except MALFORMED as error:
        raise InputError('is no order', SEAT_ORDER_TOPIC) from error
    return order
