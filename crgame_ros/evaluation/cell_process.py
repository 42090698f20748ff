# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Computes cells in a separate process, so that a hang, excess memory or crash affects only it."""

from collections.abc import Iterator, Mapping
from contextlib import suppress
import json
import os
from pathlib import Path
from queue import SimpleQueue
import resource
import select
import signal
import struct
import subprocess
import sys
import tempfile
import threading
import time
import traceback
from typing import BinaryIO, IO, NamedTuple, NoReturn

from crgame_ros.errors import CrgameError
from crgame_ros.evaluation.cell import Cell, condition_of
from crgame_ros.evaluation.content import ContentStore
from crgame_ros.evaluation.results.cell_rows import CellRows
from crgame_ros.evaluation.source_digest import engine_digest
from distributed import get_worker

_LENGTH = struct.Struct('<Q')
# Libraries use one thread each: results do not depend on it, and workers share the processors.
_ONE_THREAD = dict.fromkeys((
    'OMP_NUM_THREADS', 'OPENBLAS_NUM_THREADS', 'MKL_NUM_THREADS', 'NUMBA_NUM_THREADS'), '1')
# Length of the output of a cell that is reported when its process died [bytes].
_TOLD_BYTES = 2000
_STARTS_S, _ENDS_S = 120.0, 5.0
# Each thread of a worker has its own process, so that several cells are computed at once.
_OF_THREAD = threading.local()


class CellProcess:
    """
    A process that computes cells one after the other; it is replaced by a new one if it ends.

    :param contents: folder of the store with the cells' contents.
    :param memory_bytes: greatest data size of the process.
    """

    def __init__(self, contents: Path, memory_bytes: int) -> None:
        self._contents, self._memory_bytes = contents, memory_bytes
        self._process: subprocess.Popen[bytes] | None = None
        self._errors: BinaryIO | None = None

    def compute(self, cell: str, timeout_s: float) -> CellRows:
        """
        Compute a cell.

        :param cell: as JSON.
        :param timeout_s: wall time after which the cell fails.
        :return: its rows, as `cell_run.compute_cell` returns them; for a cell that failed, the
            status and the reason.
        """
        start_s = time.perf_counter()
        rows = self._once(cell, timeout_s)
        if rows['cell']['status'] == 'died' and signal.SIGKILL.name in str(rows['cell']['reason']):
            # Another process killed it: the cell may not be the cause.
            rows = self._once(cell, timeout_s)
        rows.setdefault('work', {})['wall_s'] = time.perf_counter() - start_s
        return rows

    def _once(self, cell: str, timeout_s: float) -> CellRows:
        process = self._started()
        assert process.stdin is not None and process.stdout is not None
        try:
            _write(process.stdin, cell.encode())
            answer = _read(process.stdout, timeout_s)
        except TimeoutError:
            self.close()
            rows = _failed('timeout', f'not done after {timeout_s:g} s of wall time')
        except (OSError, EOFError):
            rows = self._dead(process)
        else:
            rows = json.loads(answer)
            if rows['cell']['status'] == 'memory':
                # The remaining memory is fragmented.
                self.close()
        return rows

    def close(self) -> None:
        """End the process."""
        process, self._process = self._process, None
        if process is not None:
            process.kill()
            process.wait()
            for stream in (process.stdin, process.stdout, self._errors):
                with suppress(OSError):
                    if stream is not None:
                        stream.close()

    def _started(self) -> 'subprocess.Popen[bytes]':
        if self._process is None or self._process.poll() is not None:
            self.close()
            self._errors = tempfile.TemporaryFile()
            self._process = subprocess.Popen(
                [sys.executable, '-m', __spec__.name, str(self._contents),
                 str(self._memory_bytes)],
                stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=self._errors,
                env=os.environ | _ONE_THREAD)
            assert self._process.stdout is not None
            with suppress(OSError, EOFError, TimeoutError):
                # The process reports when its modules are loaded: no cell's time includes that.
                _read(self._process.stdout, _STARTS_S)
        return self._process

    def _dead(self, process: 'subprocess.Popen[bytes]') -> CellRows:
        try:
            code = process.wait(_ENDS_S)
        except subprocess.TimeoutExpired:
            # It has closed its pipes, but still runs.
            process.kill()
            code = process.wait()
        said = ''
        if self._errors is not None:
            with suppress(OSError):
                self._errors.seek(0, os.SEEK_END)
                self._errors.seek(max(0, self._errors.tell() - _TOLD_BYTES))
                said = self._errors.read().decode(errors='replace').strip()
        self.close()
        how = f'exit code {code}' if code >= 0 else signal.Signals(-code).name
        return _failed('died', f'its process ended with {how}', said)


def _failed(status: str, reason: str, trace: str = '') -> CellRows:
    return {'cell': {'status': status, 'reason': reason, 'traceback': trace}, 'vehicles': []}


def _write(stream: IO[bytes], data: bytes) -> None:
    stream.write(_LENGTH.pack(len(data)) + data)
    stream.flush()


def _read(stream: IO[bytes] | IO[str], timeout_s: float) -> bytes:
    """
    Read a message.

    :raises TimeoutError: if it does not arrive in time.
    :raises EOFError: if the stream has ended.
    """
    end_s = time.monotonic() + timeout_s
    data, wanted = b'', _LENGTH.size
    while len(data) < wanted:
        if not select.select([stream], [], [], max(0.0, end_s - time.monotonic()))[0]:
            raise TimeoutError
        piece = os.read(stream.fileno(), min(wanted - len(data), 1 << 20))
        if not piece:
            raise EOFError
        data += piece
        if len(data) == _LENGTH.size:
            wanted += _LENGTH.unpack(data)[0]
    return data[_LENGTH.size:]


def _messages() -> Iterator[str]:
    """Yield the texts of cells; end the process at once when the parent is gone."""
    waiting: SimpleQueue[str] = SimpleQueue()

    def listen() -> None:
        while True:
            try:
                waiting.put(_read(sys.stdin, threading.TIMEOUT_MAX).decode())
            except (OSError, EOFError):
                os._exit(0)

    threading.Thread(target=listen, daemon=True).start()
    while True:
        yield waiting.get()


def dask_setup(_worker: object) -> None:
    """Ignore Ctrl-C in the worker: the command handles it, and ends its workers."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)


class Limits(NamedTuple):
    """
    The limits of a cell, and of a batch of them.

    :param timeout_s: wall time of a cell [s]
    :param memory_bytes: size of a cell's data.
    :param batch_s: wall time that a batch should take; after twice this, no further cell of it is
        begun [s]
    """

    timeout_s: float
    memory_bytes: int
    batch_s: float


def packed_content(packed: Mapping[str, bytes]) -> Mapping[str, bytes]:
    """Return a content; as a Dask task, so that workers share it and lost ones are recomputed."""
    return packed


def compute(batch: str, contents: Mapping[str, Mapping[str, bytes]], limits: Limits) -> list[str]:
    """
    Compute a batch of cells in the process of this worker's thread, one after the other.

    :param batch: the conditions of its cells, each with its seeds, as JSON.
    :param contents: their contents, packed, by digest.
    :return: the rows of each cell, as JSON: small to transfer, and the scheduler needs none of
        the project's classes; the last cells have none where there was no time for them.
    :raises CrgameError: if this worker's version differs from the client's.
    """
    end_s = time.monotonic() + 2.0 * limits.batch_s
    worker = get_worker()
    cells = [Cell(condition, seed) for values, seeds in json.loads(batch)
             for condition in (condition_of(values),) for seed in seeds]
    if any(cell.condition.code[0] != engine_digest() for cell in cells):
        raise CrgameError(f'worker {worker.address} has another crgame_ros than this one, or '
                          'other packages: install the same there')
    store = ContentStore(Path(worker.local_directory) / 'crgame-contents')
    for digest, packed in contents.items():
        store.unpack(digest, packed)
    kept: dict[object, CellProcess] = vars(_OF_THREAD).setdefault('processes', {})
    place = (store.folder, limits.memory_bytes)
    if place not in kept:
        for other in kept.values():
            other.close()
        kept.clear()
        kept[place] = CellProcess(*place)
    done: list[str] = []
    for cell in cells:
        rows = kept[place].compute(cell.text, limits.timeout_s)
        rows['work']['worker'] = worker.address
        done.append(json.dumps(rows))
        if time.monotonic() > end_s:
            break
    return done


def main() -> NoReturn:
    """Compute the cells from standard input until it ends; write results to standard output."""
    contents, memory_bytes = Path(sys.argv[1]), int(sys.argv[2])
    # Ctrl-C is for the parent process; this one ends together with it.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    answers = os.fdopen(os.dup(1), 'wb')
    # Output of planners must not mix with the results.
    os.dup2(2, 1)
    from crgame_ros.evaluation.cell import cell_of
    from crgame_ros.evaluation.cell_run import compute_cell
    from crgame_ros.evaluation.content import PREFIX
    resource.setrlimit(resource.RLIMIT_DATA, (memory_bytes, memory_bytes))
    _write(answers, b'')
    for text in _messages():
        with suppress(OSError):
            os.ftruncate(2, 0)
            os.lseek(2, 0, os.SEEK_SET)
        try:
            rows = compute_cell(cell_of(text), contents)
        except MemoryError:
            rows = _failed('memory', f'it wanted more than {memory_bytes / 1e9:g} GB',
                           traceback.format_exc())
        except CrgameError as error:
            rows = _failed('error', str(error))
        except Exception as error:
            rows = _failed('error', f'{type(error).__name__}: {error}', traceback.format_exc())
        # The folder of the files differs between machines.
        here = json.dumps(f'{contents}/')[1:-1]
        _write(answers, json.dumps(rows).replace(here, PREFIX).encode())
    sys.exit(0)


if __name__ == '__main__':
    main()
