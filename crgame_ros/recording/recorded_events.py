# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Reads the events of a recorded run, and when they took effect."""

from pathlib import Path
from typing import NamedTuple

from crgame_ros.errors import InputError
from crgame_ros.game.documents import EVENTS, GAME
from crgame_ros.game.events import FiredEvent
from crgame_ros.recording.reader import BagReader


class RecordedEvents(NamedTuple):
    """
    The events of a recorded run.

    :param known: names of the events of the recorded game.
    :param fired: the events that took effect, in order.
    """

    known: frozenset[str]
    fired: tuple[FiredEvent, ...]


def read_run_events(path: Path, epoch: int | None = None) -> RecordedEvents:
    """
    Read the events of a run from its recording.

    :param epoch: which run, where a recording holds several; None for the last.
    :raises InputError: if there is no such run in it.
    """
    games, fired = {}, {}
    with BagReader(path, parts=True) as reader:
        for topic, _, _, message in reader.readable([GAME.topic, EVENTS.topic]):
            try:
                if topic == GAME.topic:
                    game = GAME.read(message.data)
                    games[game.epoch] = game
                else:
                    # Each message holds all events since the start of its run.
                    events = EVENTS.read(message.data)
                    fired[events.epoch] = events.fired
            except InputError:
                # The message may come from a foreign publisher.
                continue
    chosen = max(games, default=None) if epoch is None else epoch
    if chosen is None or chosen not in games:
        raise InputError('no such run in it' if games else f'no {GAME.topic} in it', str(path),
                         'record all topics, from before the start of the run')
    return RecordedEvents(frozenset(event.name for event in games[chosen].events),
                          fired.get(chosen, ()))
