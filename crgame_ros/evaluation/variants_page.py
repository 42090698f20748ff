# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The page of a game's variants: which of them a planner passes, and which it fails."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field
import json
from pathlib import Path
from typing import Literal

from crgame_ros.analysis.report.document import Article, Page
from crgame_ros.analysis.report.section import free, number, plain, Section, table
from crgame_ros.evaluation.cell_grid import CellGrid
from crgame_ros.evaluation.cell_scene import CellScene
from crgame_ros.evaluation.file_names import REPORTS
from crgame_ros.evaluation.judging import expectations_of, shortfalls, worst_of
from crgame_ros.evaluation.results.parts import stored_rows
from crgame_ros.evaluation.summary.measures import better_of
from crgame_ros.game.expectation import Expectation
from crgame_ros.paths import page_directory
from crgame_ros.variation.space import Axis, space_of, Variant
from crgame_ros.version import __version__
from crgame_ros.whole_file import write_text

Verdict = Literal['pass', 'failure', 'excused', 'unknown']
_KEY = (('pass', 'kept'), ('failure', 'failure'), ('excused', 'no AV to blame'),
        ('unknown', 'could not be run'))
Row = Mapping[str, object]
_GOALS = ('min_distance',)


@dataclass(frozen=True)
class VariantPoint:
    """
    A variant that was run.

    :param cell: key of its cell.
    :param variant: its values.
    :param values: of the goals; None where one is undefined.
    :param verdict: on it.
    :param told: why, for people.
    """

    cell: str
    variant: Variant
    values: Sequence[float | None]
    verdict: Verdict
    told: str = ''


@dataclass(frozen=True)
class Finding:
    """
    A variant with a folder of its own.

    :param name: of the folder.
    :param told: what it changes, in words.
    :param values: of the goals.
    :param report: address of its report, relative to the page.
    :param drive: command with which a person drives in it.
    :param replay: command that shows its recording.
    """

    name: str
    told: str
    values: Sequence[float | None]
    report: str
    drive: str
    replay: str


@dataclass(frozen=True)
class VariantsView:
    """
    The content of the page.

    :param lines: what was found, a line each.
    :param goals: names of the measures of its points.
    :param axes: of what varies, as `axis_values` returns them.
    :param nominal: values of the game as it is.
    :param slices: probability of a failure over pairs of dimensions: names x and y, and rows of
        probabilities from low to high y.
    :param links: by cell, addresses relative to the page by what they are.
    :param findings: variants with a folder of their own.
    """

    title: str
    lines: Sequence[str]
    goals: Sequence[str]
    axes: Sequence[Mapping[str, object]]
    nominal: Variant
    points: Sequence[VariantPoint]
    slices: Sequence[Mapping[str, object]] = ()
    links: Mapping[str, Mapping[str, str]] = field(default_factory=dict)
    findings: Sequence[Finding] = ()


def write_variants_page(view: VariantsView, folder: Path, name: str) -> Path:
    """
    Write the page, completely or not at all.

    :param folder: of the evaluation.
    :param name: name of the file in it.
    :return: its path.
    :raises InputError: if it cannot be written.
    """
    there = {point.verdict for point in view.points}
    key = ''.join(f'<span class="{kind}">{words}</span>' for kind, words in _KEY if kind in there)
    boundary = '<p class="note">The ground is the estimated probability of a failure, averaged ' \
        'over the other dimensions.</p>' if view.slices else ''
    sections = [
        Section('found', 'What was found', '<ul>' + ''.join(
            f'<li>{plain(line)}</li>' for line in view.lines) + '</ul>' + _findings(view)),
        Section('variants', 'All variants', f'<p class="key">{key}</p>'
                '<p class="note">A line is a variant; click on one, or on a point below, to see '
                'it.</p><div id="lines"></div><div id="chosen" class="chosen-variant">'
                '<p>No variant is chosen.</p></div>'),
        Section('coverage', 'Coverage', '<p class="note">Each point is a variant; the cross is '
                f'the game as it is.</p>{boundary}<div id="maps" class="maps"></div>')]
    page = page_directory() / 'variants'
    data = {'axes': list(view.axes), 'goals': list(view.goals),
            'nominal': dict(view.nominal), 'points': [asdict(point) for point in view.points],
            'slices': list(view.slices), 'links': dict(view.links),
            'command': f'crgame evaluate {folder} --cell'}
    path = folder / name
    write_text(Page(
        view.title, free(f'{len(view.points)} variants'), (), (Article(sections),),
        f'crgame_ros {__version__}', (page / 'variants.css').read_text(encoding='utf-8'),
        'variants/variants.ts', data).html(), path)
    return path


def _findings(view: VariantsView) -> str:
    rows = [(f'<a href="{plain(each.report)}">{plain(each.name)}</a>', plain(each.told),
             *(number(value) for value in each.values),
             f'<code>{plain(each.replay)}</code><br><code>{plain(each.drive)}</code>')
            for each in view.findings]
    head = ('report', 'changed in the game', *map(plain, view.goals),
            'see it again, and drive in it yourself')
    return table('Failures to look at', head, rows) if rows else ''


def axis_values(axis: Axis) -> dict[str, object]:
    """Return the name of a dimension with its ends, or with its values if these are names."""
    if not axis.is_numeric:
        return {'name': axis.name, 'values': list(axis.spec.values)}
    ends = axis.spec.values or (axis.value(0.0), axis.value(1.0))
    numbers = [float(end) for end in ends if isinstance(end, int | float)]
    return {'name': axis.name, 'low': min(numbers), 'high': max(numbers)}


def write_variant_pages(folder: Path, grid: CellGrid, goals: Sequence[str]) -> Iterator[Path]:
    """
    Write a page for each game of an evaluation that varies.

    :param folder: of the evaluation.
    :param goals: measures to show; none for the least distance.
    :return: the files.
    :raises InputError: if a part is damaged, or a page cannot be written.
    """
    # The tables are read once for all games.
    rows: dict[object, list[tuple[Row, Sequence[Row]]]] = {
        scene.label: [] for scene in grid.scenes if scene.variants}
    for row, vehicles in stored_rows(folder):
        label = row['human'] or row['game'] or row['scenario']
        if label in rows:
            rows[label].append((row, vehicles))
    for scene in grid.scenes:
        if scene.variants:
            yield _write(folder, grid, scene, rows.pop(scene.label), goals or _GOALS)


def _write(folder: Path, grid: CellGrid, scene: CellScene,
           rows: Sequence[tuple[Row, Sequence[Row]]], goals: Sequence[str]) -> Path:
    space = space_of(scene.values, scene.label)
    expectations = expectations_of(scene.values, scene.label)
    axes, nominal = [axis_values(axis) for axis in space.axes], dict(space.nominal)
    planners = [planner.label for planner in grid.planners]
    if len(planners) > 1:
        axes.append({'name': 'planner', 'values': planners})
    points = [_point(row, vehicles, expectations, goals) for row, vehicles in rows]
    failures = sum(point.verdict == 'failure' for point in points)
    view = VariantsView(
        f'{scene.label}: its variants',
        [f'{len(points)} cells, {failures} failures',
         *(f'expected: {each.told()}' for each in expectations)],
        goals, axes, nominal, points,
        links={point.cell: {'report': f'{REPORTS}/{point.cell}.html'} for point in points
               if (folder / REPORTS / f'{point.cell}.html').exists()})
    # Runs of one name are told apart by the folders above them.
    return write_variants_page(view, folder, f'variants-{scene.label.replace("/", "-")}.html')


def _point(row: Row, vehicles: Sequence[Row], expectations: Sequence[Expectation],
           goals: Sequence[str]) -> VariantPoint:
    variant = {**json.loads(str(row['variant'] or '{}')), 'planner': row['planner']}
    values = [worst_of(goal, vehicles, better_of(goal) or 1) for goal in goals]
    if row['status'] != 'ok':
        return VariantPoint(str(row['cell']), variant, values, 'unknown', str(row['reason'] or ''))
    broken = [line for each in expectations for line in shortfalls(each, vehicles)]
    return VariantPoint(str(row['cell']), variant, values, 'failure' if broken else 'pass',
                        '; '.join(broken))
