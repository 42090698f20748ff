# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The criticality of a recorded run as frames of the page: as it was told, or measured anew."""

from pathlib import Path

from crgame_ros.analysis.criticality.criticality import Criticality
from crgame_ros.analysis.criticality.criticality_rows import criticality_rows, CRITICALITY_TOPIC
from crgame_ros.analysis.criticality.recorded_criticality import measure_log
from crgame_ros.cockpit.message_frames import MessageFrames
from crgame_ros.cockpit.replay_outline import pack
from crgame_ros.errors import InputError
from crgame_ros.recording.epochs import Epoch
from crgame_ros.recording.reader import BagReader
from crgame_ros.recording.run_log import read_run_log


def recorded_criticality(reader: BagReader, run: Epoch) -> bytes | None:
    """
    Return the frames of the whole run, each after its length in bytes; None if nobody recorded any.

    :param reader: the recording.
    :param run: in it.
    """
    if CRITICALITY_TOPIC not in reader.topics:
        return None
    frames, found = MessageFrames(run.game, run.descriptions), []
    for message in reader.readable([CRITICALITY_TOPIC]):
        try:
            frame = frames.criticality(message.message)
        except (InputError, IndexError, OverflowError):
            # Anybody may have published on it.
            continue
        if frame is not None:
            found.append(frame.data)
    return pack(found) if found else None


def measured_criticality(run: Epoch, path: Path) -> bytes:
    """
    Measure a run and give its frames, each after its length in bytes; takes seconds for minutes.

    :param path: of the recording.
    :raises InputError: if the run cannot be measured.
    """
    frames = MessageFrames(run.game, run.descriptions)
    found: list[bytes] = []

    def take(criticality: Criticality) -> None:
        rows = criticality_rows(criticality, run.game.epoch, criticality.n)
        if (frame := frames.criticality_of(rows)) is not None:
            found.append(frame.data)

    measure_log(read_run_log(path, run.game.epoch), on_tick=take)
    return pack(found)
