# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Who drove in a recorded run, and how long their input took."""

from collections import defaultdict
from pathlib import Path
import re
import statistics
from typing import NamedTuple

from crgame_ros.errors import InputError
from crgame_ros.game.seat_documents import DRIVERS_TOPIC, DrivingSpell, parse_spells
from crgame_ros.messages.status_values import read_status
from crgame_ros.recording.epochs import read_epoch
from crgame_ros.recording.reader import BagReader

_DIAGNOSTICS = '/diagnostics'
# Of people at pages, and of devices at the machine of the game.
_DRIVER = re.compile('(?:cockpit|driver)_node: (.+) driver')
_DELAYS = ('input_delay_ms', 'round_trip_ms')


class RecordedDriver(NamedTuple):
    """
    One stretch of a run that somebody drove.

    :param spell: who, which seat, from which step to which.
    :param input_delay_ms: median from the hand to the first later state, at the page (drawing is
        more) or at the machine of a device [ms]; None if not measured.
    :param round_trip_ms: median from the page to the simulation and back [ms]; likewise.
    """

    spell: DrivingSpell
    input_delay_ms: float | None
    round_trip_ms: float | None


def read_drivers(path: Path, epoch: int | None = None) -> tuple[RecordedDriver, ...]:
    """
    Read who drove in a run from its recording; nobody, in one that does not say it.

    :param epoch: which run, where a recording holds several; None for the last.
    :raises InputError: if there is no such run in it.
    """
    with BagReader(path, parts=True) as reader:
        topic = reader.topics.get(DRIVERS_TOPIC)
        if topic is None or not topic.message_count:
            return ()
        wanted = read_epoch(reader, epoch).game.epoch
        spells: tuple[DrivingSpell, ...] = ()
        # By seat, person and name of the value.
        delays_ms: dict[tuple[str, str, str], list[float]] = defaultdict(list)
        for message in reader.messages([DRIVERS_TOPIC, _DIAGNOSTICS]):
            content = reader.decode(message).message
            if message.topic == DRIVERS_TOPIC:
                spells = _newer(spells, str(content.data), wanted)
            else:
                for status in map(read_status, content.status):
                    if found := _DRIVER.fullmatch(status.name):
                        for name in _DELAYS:
                            _note(delays_ms[found[1], status.values.get('person', ''), name],
                                  status.values.get(name, ''))
    return tuple(RecordedDriver(item, *(_median(delays_ms.get(
        (item.seat, '' if item.person is None else item.person.id, name)))
        for name in _DELAYS)) for item in spells)


def _newer(spells: tuple[DrivingSpell, ...], text: str,
           wanted: int) -> tuple[DrivingSpell, ...]:
    """Take what a message says of the wanted run: each says all so far."""
    try:
        epoch, newer = parse_spells(text)
    except InputError:
        # Anybody may have published on this topic.
        return spells
    return newer if epoch == wanted else spells


def _note(delays_ms: list[float], text: str) -> None:
    try:
        delays_ms.append(float(text))
    except ValueError:
        # Not measured yet.
        return


def _median(values: list[float] | None) -> float | None:
    return statistics.median(values) if values else None
