# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What a Dask worker does: it keeps a process for cells, and hands them to it."""

from collections.abc import Mapping
import json
from pathlib import Path
import signal
import threading
from typing import Any, NamedTuple

from crgame_ros.errors import CrgameError
from crgame_ros.evaluation.cell import cell_of
from crgame_ros.evaluation.cell_process import CellProcess
from crgame_ros.evaluation.content import ContentStore
from crgame_ros.evaluation.source_digest import engine_digest
from distributed import get_worker

# Of each thread of the worker its own: a worker of several computes several cells at once.
_OF_THREAD = threading.local()


def dask_setup(_worker: Any) -> None:
    """Let Ctrl-C be for the command alone, which ends its workers."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)


class Limits(NamedTuple):
    """
    What a cell may take.

    :param timeout_s: of wall time.
    :param memory_bytes: of data.
    """

    timeout_s: float
    memory_bytes: int


def packed_content(packed: Mapping[str, bytes]) -> Mapping[str, bytes]:
    """Return a content: as a task, so that workers hand it on and lost ones come back."""
    return packed


def compute(text: str, contents: Mapping[str, Mapping[str, bytes]],
            limits: Limits) -> dict[str, Any]:
    """
    Compute a cell in the process of this worker's thread.

    :param text: the cell as JSON.
    :param contents: what it names, packed, by digest.
    :return: its rows.
    :raises CrgameError: if this worker has another version than who asked.
    """
    worker = get_worker()
    if cell_of(text).code[0] != engine_digest():
        raise CrgameError(f'worker {worker.address} has another crgame_ros than this one: install '
                          'the same there')
    store = ContentStore(Path(worker.local_directory) / 'crgame-contents')
    for digest, packed in contents.items():
        store.unpack(digest, packed)
    kept: dict[Any, CellProcess] = vars(_OF_THREAD).setdefault('processes', {})
    place = (store.folder, limits.memory_bytes)
    if place not in kept:
        for other in kept.values():
            other.close()
        kept.clear()
        kept[place] = CellProcess(*place)
    rows = kept[place].compute(text, limits.timeout_s)
    rows['work']['worker'] = worker.address
    # Text is small on its way, and no object of ours has to be known to the scheduler.
    return {'rows': json.dumps(rows)}
