# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""All tables of a run, computed once and cached by the content of its recording."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
import hashlib
import json
from pathlib import Path
import shutil
from typing import Any

from crgame_ros.analysis.behaviour.task_events import task_events
from crgame_ros.analysis.runs.run import Run
from crgame_ros.analysis.tables.run_tables import tables_of
from crgame_ros.errors import refusing
from crgame_ros.evaluation.source_digest import engine_digest
from crgame_ros.finite_json import finite
from crgame_ros.recording.run_folder import bags_of
from crgame_ros.whole_file import whole_folder
import pyarrow as pa
import pyarrow.parquet as pq

SUMMARY = 'run.json'
# Names the other files of an entry with their hashes; whatever has been damaged is made anew.
DIGESTS = 'files.sha256'
_PIECE = 1 << 20


@dataclass(frozen=True)
class RunTables:
    """
    A run with cached tables.

    :param key: hash of everything that they depend on.
    :param folder: of the tables.
    :param summary: further facts: humans, planners, seed, drivers with input delays, the events of
        tasks.
    """

    key: str
    folder: Path
    summary: Mapping[str, Any]

    def table(self, name: str) -> pa.Table:
        """Read one of its tables."""
        return pq.read_table(self.folder / f'{name}.parquet')


class RunTablesCache:
    """
    Measures runs, and caches the results.

    :param folder: of the cache; created if missing.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._used: set[str] = set()

    def measured(self, run: Path, name: str,
                 progress: Callable[[str, float], object]) -> RunTables:
        """
        Return a run's tables; compute them if they are not cached.

        :param run: folder of the run, complete.
        :param name: of the run in the tables.
        :raises InputError: if it cannot be measured, or the cache is not writable.
        """
        key = _key(run, name)
        self._used.add(key)
        folder = self._folder / key
        if not _is_whole(folder):
            self._measure(run, name, folder, progress)
        return RunTables(key, folder, json.loads((folder / SUMMARY).read_text('utf-8')))

    def forget_others(self) -> None:
        """Remove entries that no run of the study has used, and leftovers of killed processes."""
        for path in self._folder.iterdir() if self._folder.is_dir() else ():
            if path.name not in self._used:
                shutil.rmtree(path, ignore_errors=True)

    def _measure(self, run: Path, name: str, folder: Path,
                 progress: Callable[[str, float], object]) -> None:
        tabulated = Run.of_recording(run, progress=progress)
        tabulated.id = name
        tables = tables_of([tabulated])
        with refusing('cannot be written', self._folder, 'make room, or make the folder writable'):
            self._folder.mkdir(parents=True, exist_ok=True)
            # A power cut may leave files without content: their hashes differ.
            with whole_folder(folder) as part:
                part.mkdir()
                for table, rows in tables.items():
                    pq.write_table(rows, part / f'{table}.parquet', compression='zstd')
                text = json.dumps(_summary(tabulated), indent=1, ensure_ascii=False)
                (part / SUMMARY).write_text(text + '\n', encoding='utf-8')
                (part / DIGESTS).write_text(_digests(part), encoding='utf-8')


def _digests(folder: Path) -> str:
    """Return the names and hashes of an entry's files, as sha256sum writes them."""
    return ''.join(f'{hashlib.sha256(path.read_bytes()).hexdigest()}  {path.name}\n'
                   for path in sorted(folder.iterdir()) if path.name != DIGESTS)


def _is_whole(folder: Path) -> bool:
    try:
        return (folder / DIGESTS).read_text(encoding='utf-8') == _digests(folder)
    except (OSError, ValueError):
        return False


def _summary(run: Run) -> dict[str, object]:
    game = run.game
    return {
        'benchmark_id': game.benchmark_id, 'seed': game.seed, 'epoch': game.epoch,
        'humans': {item.id: item.driver for item in game.humans},
        'planners': {item.id: item.planner for item in game.avs},
        # For each seat, the last driver with known delay.
        **{name: {item.spell.seat: delay_ms for item in run.record.drivers
                  if (delay_ms := getattr(item, name)) is not None}
           for name in ('input_delay_ms', 'round_trip_ms')},
        # The periods of each seat's views.
        'views': (run.timing or {}).get('view') or {},
        'tasks': [{
            'kind': str(each.kind), 'what': each.what, 'name': each.name, 'seat': each.seat,
            'outcome': each.outcome, 'onset_s': each.onset_s,
            'duration_s': finite(each.duration_s),
            'response_time_s': finite(each.response_time_s)} for each in task_events(run.record)]}


def _key(run: Path, name: str) -> str:
    """Return a hash of what a run's tables depend on: the recording and the measuring code."""
    digest = hashlib.sha256(f'{engine_digest()}\n{name}\n'.encode())
    for bag in bags_of(run):
        for file in sorted(bag.iterdir()):
            digest.update(f'{bag.name}/{file.name}\n'.encode())
            with refusing('cannot be read', file, 'put it back, or leave out the run'):
                with file.open('rb') as stream:
                    while piece := stream.read(_PIECE):
                        digest.update(piece)
    return digest.hexdigest()[:32]
