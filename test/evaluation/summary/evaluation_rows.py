# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Evaluations made of rows, as `crgame evaluate` leaves them behind."""

from collections.abc import Mapping, Sequence
import hashlib
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

FACTORS = {'scenario': 'ZAM_One-1_1_T-1', 'game': '', 'planner': 'idm', 'human': '',
           'perception': '', 'traffic': '', 'seed': 0}
Row = dict[str, Any]


def key_of(factors: Mapping[str, Any]) -> str:
    """Return the key of a cell."""
    return hashlib.blake2b(repr(sorted(factors.items())).encode(), digest_size=16).hexdigest()


class Evaluation:
    """An evaluation's rows, before they are written."""

    def __init__(self) -> None:
        self.cells: list[Row] = []
        self.vehicles: list[Row] = []

    def add(self, status: str = 'ok', reason: str = '', traceback: str = '',
            avs: Sequence[Mapping[str, Any]] = (), hv: Mapping[str, Any] | None = None,
            **factors: Any) -> str:
        """Add a cell, its AVs with their measures, and perhaps a human."""
        own = FACTORS | factors
        key = key_of(own)
        self.cells.append({'cell': key, **own, 'status': status, 'reason': reason,
                           'traceback': traceback, 'simulated_s': 20.0, 'state_hash': key})
        for role, rows in (('autonomous', avs), ('human', () if hv is None else (hv,))):
            self.vehicles += [{'cell': key, **own, 'vehicle': f'{role[:1]}v{number}',
                               'role': role, **row} for number, row in enumerate(rows)]
        return key

    def write(self, folder: Path, parts: int = 1, seed: int | None = None) -> Path:
        """Write it in so many parts, shuffled where a seed is given."""
        for name, rows in (('cells', self.cells), ('vehicles', self.vehicles)):
            (folder / name).mkdir(parents=True)
            if not rows:
                continue
            columns = dict.fromkeys(column for row in rows for column in row)
            table = pa.table({column: [row.get(column) for row in rows] for column in columns})
            write_parts(table, folder / name, parts, seed)
        return folder


def write_parts(table: pa.Table, folder: Path, parts: int, seed: int | None = None) -> None:
    """Write a table in so many parts, of different length where a seed shuffles it."""
    bounds = np.linspace(0, len(table), parts + 1).astype(int)
    if seed is not None:
        random = np.random.default_rng(seed)
        table = table.take(pa.array(random.permutation(len(table))))
        bounds[1:-1] = np.sort(random.integers(0, len(table), parts - 1))
    for number, (start, end) in enumerate(zip(bounds[:-1], bounds[1:], strict=True)):
        pq.write_table(table.slice(start, end - start), folder / f'part-{number:06d}.parquet')


def many(cells: int, scenarios: int, planners: Sequence[str] = ('idm', 'mine')) -> Evaluation:
    """Make cells whose scenarios differ more than the cells of each."""
    random = np.random.default_rng(5)
    of_scenario = random.normal(3.0, 1.0, scenarios)
    found = Evaluation()
    for number in range(cells):
        pair, planner = divmod(number, len(planners))
        scenario = pair % scenarios
        ttc = max(0.1, of_scenario[scenario] + 0.3 * planner + random.normal(0.0, 0.3))
        failed = random.random() < 0.1
        found.add(
            'error' if failed else 'ok', 'no path' if failed else '',
            scenario=f'ZAM_Made-{scenario}_1_T-1', planner=planners[planner],
            seed=pair // scenarios, human=('', 'timid')[pair % 2],
            avs=() if failed else [
                {'worst_ttc': None if random.random() < 0.1 else ttc, 'distance': 100.0 * ttc,
                 'collided': random.random() < 0.1, 'fallbacks': number % 3}
                for _ in range(1 + number % 2)],
            hv=None if failed else {'worst_ttc': 0.01, 'distance': 1e6})
    return found
