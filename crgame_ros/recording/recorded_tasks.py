# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What happened in the tasks of a recorded run."""

from pathlib import Path

from crgame_ros.errors import InputError
from crgame_ros.game.task_documents import LOG_TOPIC, parse_log, TaskEntry
from crgame_ros.recording.reader import BagReader


def read_task_entries(path: Path, epoch: int) -> tuple[TaskEntry, ...]:
    """
    Read what happened in the tasks of one run, in order; nothing of a game without tasks.

    :param epoch: which run.
    :raises InputError: if the recording cannot be read.
    """
    found: list[TaskEntry] = []
    with BagReader(path, parts=True) as reader:
        for _, _, _, message in reader.readable([LOG_TOPIC]):
            try:
                number, entries = parse_log(message.data)
            except InputError:
                # Anybody may have published on this topic.
                continue
            if number == epoch:
                found += entries
    return tuple(found)
