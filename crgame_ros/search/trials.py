# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Runs variants of a game as cells of an evaluation, each once, also after an interruption."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

from crgame_ros.errors import InputError
from crgame_ros.evaluation.cell_batches import CellBatches
from crgame_ros.evaluation.cell_grid import CellGrid
from crgame_ros.evaluation.cell_process import Limits
from crgame_ros.evaluation.cell_scene import variant_text
from crgame_ros.evaluation.evaluation import rows_of
from crgame_ros.evaluation.folder import EvaluationFolder
from crgame_ros.evaluation.judging import shortfalls, worst_of
from crgame_ros.evaluation.results.cell_rows import CellRows
from crgame_ros.evaluation.results.parts import ResultParts, stored_rows
from crgame_ros.evaluation.source_digest import engine_digest
from crgame_ros.game.expectation import Expectation
from crgame_ros.game.objects import Role
from crgame_ros.search.settings import SearchSettings
from crgame_ros.variation.space import Variant
from distributed import Client

# Variants that are run before any of their outcomes is told.
_TOGETHER = 32
# Blames of a contact that an AV could have avoided, and of a run without a contact.
AVOIDABLE = ('', 'avoidable')


@dataclass(frozen=True)
class Outcome:
    """
    What became of a variant.

    :param number: of the variant in the search, from 0.
    :param variant: its values.
    :param key: of its cell.
    :param status: of its cell; `ok` if it could be run.
    :param reason: why it could not be run, or what of its planner failed.
    :param values: of the goals' measures, of the worst AV; None where one is undefined.
    :param broken: how it breaks the expectations, a line each; empty if it keeps them.
    :param excused: why no AV can be blamed; empty if one can, or nothing is broken.
    """

    number: int
    variant: Variant
    key: str
    status: str
    reason: str
    values: tuple[float | None, ...]
    broken: tuple[str, ...]
    excused: str = ''

    @property
    def is_known(self) -> bool:
        """Return whether it could be run."""
        return self.status == 'ok'

    @property
    def is_failure(self) -> bool:
        """Return whether an AV breaks an expectation, and can be blamed."""
        return bool(self.broken) and not self.excused


class Trials:
    """
    The variants of a search, run in batches on the workers of an evaluation.

    :param expectations: what a run has to keep.
    :param grid: grid of one scene without variants.
    :param told: called with each outcome.
    """

    def __init__(self, settings: SearchSettings, expectations: Sequence[Expectation],
                 place: EvaluationFolder, grid: CellGrid, parts: ResultParts, client: Client,
                 limits: Limits, told: Callable[[Outcome, bool], object]) -> None:
        self._settings, self._expectations = settings, expectations
        self._place, self._parts = place, parts
        self._grid = grid
        self._client, self._limits, self._told = client, limits, told
        self.outcomes: list[Outcome] = []
        self._by_text: dict[str, Outcome] = {}
        self._earlier: dict[str, CellRows] = {
            str(row['cell']): {'cell': row, 'vehicles': vehicles}
            for row, vehicles in stored_rows(place.path)}

    @property
    def left(self) -> int:
        """Return how many runs of the budget are left."""
        return self._settings.budget - len(self.outcomes)

    @property
    def known(self) -> list[Outcome]:
        """Return the outcomes of the variants that could be run."""
        return [outcome for outcome in self.outcomes if outcome.is_known]

    @property
    def failures(self) -> list[Outcome]:
        """Return the outcomes in which an AV fails, and can be blamed."""
        return [outcome for outcome in self.outcomes if outcome.is_failure]

    def run(self, variants: Iterable[Variant]) -> list[Outcome]:
        """
        Run variants; of more than the budget has left, the first ones.

        :return: their outcomes, in the order of the variants. One that was run before is not run
            again, and costs nothing.
        :raises CrgameError: if the scheduler is lost; what was finished is kept.
        :raises InputError: if another version of the program began the search.
        """
        texts: list[str] = []
        new: dict[str, Variant] = {}
        for variant in variants:
            text = variant_text(variant)
            if text not in self._by_text and text not in new:
                if len(new) >= self.left:
                    break
                new[text] = variant
            texts.append(text)
        # In parts, so that progress is seen and few rows are in memory.
        items = list(new.items())
        for first in range(0, len(items), _TOGETHER):
            self._run(dict(items[first:first + _TOGETHER]))
        return [self._by_text[text] for text in texts]

    def _run(self, new: Mapping[str, Variant]) -> None:
        scene = self._grid.scenes[0]
        cells = {cell.key: cell for cell in replace(self._grid, scenes=(
            replace(scene, variants=tuple(new.values())),))}
        known = cells.keys() & self._earlier.keys()
        missing = [cell for key, cell in cells.items() if key not in known]
        if missing and self._grid.engine != engine_digest():
            raise InputError('another version of crgame_ros began it', str(self._place.path),
                             'search again in another folder: --out')
        if missing:
            # Before their rows: a cell is found by the variants in the folder.
            self._place.add_variants(variant for key, variant in zip(
                cells, new.values(), strict=True) if key not in known)
            batches = CellBatches(self._client, self._place.store, self._limits, iter(missing),
                                  len(missing))
            for ended in batches.results():
                rows = [rows_of(cell, found) for cell, found in ended]
                self._parts.add(*rows)
                for row in rows:
                    self._earlier[str(row['cell']['cell'])] = row
        for key, (text, variant) in zip(cells, new.items(), strict=True):
            # What is kept of a run is small: memory does not grow with the tables.
            outcome = self._outcome(key, variant, self._earlier.pop(key))
            self.outcomes.append(outcome)
            self._by_text[text] = outcome
            self._told(outcome, key not in known)

    def _outcome(self, key: str, variant: Variant, row: CellRows) -> Outcome:
        status = str(row['cell']['status'])
        vehicles = row['vehicles']
        broken = [line for each in self._expectations for line in shortfalls(each, vehicles)] \
            if status == 'ok' else []
        blames = [str(vehicle.get('blame') or '') for vehicle in vehicles
                  if vehicle['role'] == Role.AUTONOMOUS.value and vehicle['collided']]
        excused = '' if self._settings.unavoidable or not broken or not blames \
            or any(blame in AVOIDABLE for blame in blames) else blames[0]
        return Outcome(
            len(self.outcomes), dict(variant), key, status,
            str(row['cell'].get('reason') or ''),
            tuple(worst_of(goal.measure, vehicles, goal.sign)
                  for goal in self._settings.goals), tuple(broken), excused)
