# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The folder of an evaluation: its plan and files beside the tables, to repeat any cell."""

from collections.abc import Iterable
from dataclasses import asdict, replace
import json
import os
from pathlib import Path
from typing import Any

from crgame_ros.analysis.tables.column import TableDeclaration
from crgame_ros.analysis.tables.data_package import PROFILE, table_schema
from crgame_ros.errors import InputError, refusing
from crgame_ros.evaluation.cell import Cell
from crgame_ros.evaluation.cell_grid import CellGrid
from crgame_ros.evaluation.content import ContentStore
from crgame_ros.evaluation.file_names import FILES, GRID_FILE, VARIANTS_FILE
from crgame_ros.evaluation.plan import EvaluationPlan, parse_plan
from crgame_ros.evaluation.results.cell_rows import TABLES_OF_CELLS
from crgame_ros.evaluation.results.parts import LOCK
from crgame_ros.recording.export import prepare_folder
from crgame_ros.recording.run_folder import PACKAGE_FILE
from crgame_ros.schema.writing import write
from crgame_ros.variation.space import Variant
from crgame_ros.version import __version__
from crgame_ros.whole_file import write_text

FORMAT = 1


class EvaluationFolder:
    """An evaluation on disk."""

    def __init__(self, path: Path) -> None:
        # The games of its cells name files in it.
        self.path = path = path.resolve()
        self.store = ContentStore(path / FILES)

    def check(self) -> None:
        """
        Create the folder, before anything is written into it.

        :raises InputError: if the folder cannot be written, or contains other files.
        """
        prepare_folder(self.path)
        names = {item.name for item in self.path.iterdir()}
        # One that was interrupted early has only files, or the tables' lock.
        if names - {FILES} and not names & {GRID_FILE, LOCK}:
            raise InputError('something else is in it', str(self.path), 'name another folder')

    def begin(self, plan: EvaluationPlan, grid: CellGrid) -> None:
        """
        Write the plan and the grid, after `check`.

        :raises InputError: if the folder cannot be written.
        """
        note = {'format': FORMAT, 'version': __version__, 'plan': write(plan),
                'base': str(plan.base.resolve()), 'grid': asdict(grid)}
        write_text(json.dumps(note, indent=1) + '\n', self.path / GRID_FILE)
        package = {
            '$schema': PROFILE.format('datapackage'),
            'name': 'evaluation', 'description': 'Cells of an evaluation; SI units and radians.',
            'resources': [_resource(table) for table in TABLES_OF_CELLS]}
        write_text(json.dumps(package, indent=1, ensure_ascii=False) + '\n',
                   self.path / PACKAGE_FILE)

    def add_variants(self, variants: Iterable[Variant]) -> None:
        """
        Add variants to those of the only scene of the grid.

        :raises InputError: if the folder cannot be written.
        """
        path = self.path / VARIANTS_FILE
        with refusing('cannot be written', path, 'check the folder and the space in it'):
            with path.open('a', encoding='utf-8') as stream:
                # The line break comes first: it ends a line that was cut off.
                stream.write(''.join('\n' + json.dumps(each) for each in variants))
                stream.flush()
                os.fsync(stream.fileno())

    def find(self, key: str) -> Cell:
        """
        Return a cell by its key, or by enough first digits to identify it.

        :raises InputError: if there is none, or several.
        """
        found = [cell for cell in self.grid() if cell.key.startswith(key)]
        if len(found) != 1:
            raise InputError(f'{"no" if not found else len(found)} cells begin with it', key,
                             'the column "cell" of the tables has their keys')
        return found[0]

    def grid(self) -> CellGrid:
        """
        Read the grid of the cells planned.

        :raises InputError: if the folder holds no evaluation.
        """
        grid = CellGrid.from_dict(self._note()['grid'])
        path = self.path / VARIANTS_FILE
        if not path.exists():
            return grid
        scene = grid.scenes[0]
        # A search that was stopped may have added some again when it went on.
        lines = dict.fromkeys(path.read_text(encoding='utf-8').split('\n'))
        return replace(grid, scenes=(replace(scene, variants=(
            *scene.variants, *(json.loads(line) for line in lines if line.endswith('}')))),))

    def plan(self, where: str) -> EvaluationPlan:
        """
        Read the plan.

        :param where: the folder, for messages.
        :raises InputError: if the folder holds no evaluation.
        """
        note = self._note()
        return parse_plan(note['plan'], where, Path(note['base']))

    def _note(self) -> dict[str, Any]:
        path = self.path / GRID_FILE
        try:
            note: dict[str, object] = json.loads(path.read_bytes())
            if note['format'] != FORMAT:
                raise InputError(f'is of format {note["format"]}, not {FORMAT}', str(path),
                                 'use the version that wrote it')
        except OSError as error:
            raise InputError(f'holds no evaluation ({error.strerror})', str(self.path),
                             'name the folder that `crgame evaluate` wrote') from error
        except (ValueError, LookupError, TypeError) as error:
            raise InputError('is damaged', str(path), 'run the plan again in another folder') \
                from error
        return note


def _resource(table: TableDeclaration) -> dict[str, object]:
    return {'name': table.name, 'type': 'table', 'path': f'{table.name}/*.parquet',
            'format': 'parquet', 'description': f'One row is {table.row}.',
            'schema': table_schema(table, None)}
