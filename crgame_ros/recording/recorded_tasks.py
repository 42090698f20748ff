# Copyright 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.
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
