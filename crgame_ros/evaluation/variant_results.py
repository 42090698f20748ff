# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The variants of an evaluation's games as pages, one for each game."""

from collections.abc import Iterator, Mapping, Sequence
import json
from pathlib import Path
from typing import Any

from crgame_ros.evaluation.cell_grid import CellGrid
from crgame_ros.evaluation.cell_scene import CellScene
from crgame_ros.evaluation.file_names import REPORTS
from crgame_ros.evaluation.judging import expectations_of, shortfalls, worst_of
from crgame_ros.evaluation.results.parts import stored_rows
from crgame_ros.evaluation.variants_page import (
    axis_values,
    VariantPoint,
    VariantsView,
    write_variants_page,
)
from crgame_ros.game.expectation import Expectation
from crgame_ros.variation.space import space_of

Row = Mapping[str, Any]
_GOALS = ('min_distance',)


def write_variant_pages(folder: Path, grid: CellGrid, goals: Sequence[str]) -> Iterator[Path]:
    """
    Write a page for each game of an evaluation that varies.

    :param folder: of the evaluation.
    :param grid: its grid.
    :param goals: measures to show; none for the least distance.
    :return: the files.
    :raises InputError: if a part is damaged, or a page cannot be written.
    """
    # The tables are read once for all games.
    rows: dict[str, list[tuple[Row, Sequence[Row]]]] = {
        scene.game: [] for scene in grid.scenes if scene.variants}
    for row, vehicles in stored_rows(folder):
        if row['game'] in rows:
            rows[row['game']].append((row, vehicles))
    for scene in grid.scenes:
        if scene.variants:
            yield _write(folder, grid, scene, rows.pop(scene.game), goals or _GOALS)


def _write(folder: Path, grid: CellGrid, scene: CellScene,
           rows: Sequence[tuple[Row, Sequence[Row]]], goals: Sequence[str]) -> Path:
    space = space_of(scene.values, scene.label)
    expectations = expectations_of(scene.values, scene.label)
    axes, nominal = [axis_values(axis) for axis in space.axes], dict(space.nominal)
    planners = [planner.label for planner in grid.planners]
    if len(planners) > 1:
        axes.append({'name': 'planner', 'values': planners})
    points = [_point(row, vehicles, expectations, goals)
              for row, vehicles in rows]
    failures = sum(point.verdict == 'failure' for point in points)
    view = VariantsView(
        f'{scene.label}: its variants',
        [f'{len(points)} cells, {failures} failures',
         *(f'expected: {each.told()}' for each in expectations)],
        goals, axes, nominal, points,
        links={point.cell: {'report': f'{REPORTS}/{point.cell}.html'} for point in points
               if (folder / REPORTS / f'{point.cell}.html').exists()})
    return write_variants_page(view, folder, f'variants-{scene.label}.html')


def _point(row: Row, vehicles: Sequence[Row], expectations: Sequence[Expectation],
           goals: Sequence[str]) -> VariantPoint:
    variant = {**json.loads(row['variant'] or '{}'), 'planner': row['planner']}
    values = [worst_of(goal, vehicles, 1) for goal in goals]
    if row['status'] != 'ok':
        return VariantPoint(row['cell'], variant, values, 'unknown', row['reason'] or '')
    broken = [line for each in expectations for line in shortfalls(each, vehicles)]
    return VariantPoint(row['cell'], variant, values, 'failure' if broken else 'pass',
                        '; '.join(broken))
