# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The found variants as files: to read, to replay, to drive in; and the page of the search."""

from collections.abc import Sequence
from dataclasses import replace
import math
from pathlib import Path
import shutil

from crgame_ros.analysis.report.command import REPORT_FILE
from crgame_ros.analysis.report.run_files import write_run_files
from crgame_ros.analysis.runs.run import Run
from crgame_ros.evaluation.cell_run import cell_setup
from crgame_ros.evaluation.folder import EvaluationFolder
from crgame_ros.evaluation.variants_page import (
    axis_values,
    Finding,
    VariantsView,
    write_variants_page,
)
from crgame_ros.game.game import Game, HumanSpec, LaneletSpawn, PoseSpawn
from crgame_ros.game.object_spec import BICYCLE_TYPES, ObjectSpec
from crgame_ros.paths import make_folder
from crgame_ros.recording.run_folder import GAME_FILE
from crgame_ros.search.search import SearchResult
from crgame_ros.search.text import boundary_slices, changes, points, values_text
from crgame_ros.search.trials import Outcome
from crgame_ros.simulation.offline import run_offline
from crgame_ros.variation.space import VariantSpace
from crgame_ros.vehicle.parameters import load_vehicle_parameters
from crgame_ros.whole_file import write_text

FOUND = 'found'
LIVE = 'live.yaml'
# Two findings are no closer than this, in ranges or standard deviations.
_APART = 0.1
PAGE = 'index.html'


def chosen(result: SearchResult, number: int) -> list[tuple[str, Outcome]]:
    """
    Return the failures to show, by name: the nearest one, and the worst that differ.

    :param number: of the worst ones.
    """
    worst = _different(result.space, result.failures, number)
    found = [(f'{place + 1}', outcome) for place, outcome in enumerate(worst)]
    if result.smallest is not None:
        found.insert(0, ('smallest', result.smallest))
    return found


def _different(space: VariantSpace, outcomes: Sequence[Outcome], number: int) -> list[Outcome]:
    found: list[Outcome] = []
    for outcome in outcomes:
        if len(found) == number:
            break
        if all(space.distance(outcome.variant, other.variant) >= _APART for other in found):
            found.append(outcome)
    return found


def write_findings(result: SearchResult, folder: Path, number: int) -> list[tuple[Outcome, Path]]:
    """
    Run the failures to show again, and write a folder for each.

    It has the report, the recording, the CommonRoad scenario, the game, and the game for a person
    to drive.

    :param folder: of the search.
    :param number: of the worst ones.
    :return: the failures with their folders.
    :raises InputError: if they cannot be written.
    """
    place = EvaluationFolder(folder)
    cells = {cell.key: cell for cell in place.grid()}
    shutil.rmtree(folder / FOUND, ignore_errors=True)
    found = []
    for name, outcome in chosen(result, number):
        out = folder / FOUND / name
        make_folder(out, 'choose another place with --out')
        setup = cell_setup(cells[outcome.key], place.store.folder)
        # The title tells people which variant they have before them.
        values = values_text(outcome.variant)
        game = replace(setup.game, title=f'{setup.game.title} ({values})'.strip(),
                       expect=result.expectations)
        offline = run_offline(setup, keep_messages=True)
        run = Run(f'{Path(result.settings.game).stem}: {values}', result=offline)
        write_run_files(run, offline, game, out)
        write_text(for_a_person(game).dump(), out / LIVE)
        found.append((outcome, out))
    return found


def for_a_person(game: Game) -> Game:
    """
    Return a game whose humans wait for people.

    In a game without humans, the first moving car among its objects becomes hv0, at the same pose
    and speed. The game has no time limit of its own then.
    """
    if game.humans:
        return replace(game, expect=(), humans=tuple(
            replace(human, driver='auto') for human in game.humans))
    car = next((item for item in game.objects
                if item.kind == 'bicycle' and item.type in BICYCLE_TYPES), None)
    if car is None:
        return replace(game, expect=())
    return replace(game, expect=(), humans=(HumanSpec('hv0', spawn=_spawn(car)),),
                   objects=tuple(item for item in game.objects if item is not car))


def _spawn(item: ObjectSpec) -> LaneletSpawn | PoseSpawn:
    rear_to_center = load_vehicle_parameters().rear_to_center
    if item.lanelet is not None:
        return LaneletSpawn(item.lanelet, max(0.0, item.s - rear_to_center), 0.0,
                            item.mover.speed)
    if item.trajectory:
        (t0, x, y, yaw), (t1, x1, y1, _) = item.timed_trajectory[:2]
        speed = math.dist((x, y), (x1, y1)) / max(t1 - t0, 1e-6)
    else:
        (x, y), (x1, y1) = item.path[:2]
        yaw = math.atan2(y1 - y, x1 - x)
        speed = item.speeds[0] if item.speeds else item.mover.speed
    if item.start > 0.0:
        speed = 0.0
    return PoseSpawn(x - rear_to_center * math.cos(yaw), y - rear_to_center * math.sin(yaw), yaw,
                     speed)


def write_search_page(result: SearchResult, words: Sequence[str],
                      found: Sequence[tuple[Outcome, Path]], folder: Path) -> Path:
    """
    Write the page of a search into its folder.

    :param words: what was found, as `lines` yields it.
    :param found: failures with their folders.
    :return: its file.
    :raises InputError: if it cannot be written.
    """
    links = {outcome.key: {
        'report': (place / REPORT_FILE).relative_to(folder).as_posix(),
        'game': (place / GAME_FILE).relative_to(folder).as_posix()} for outcome, place in found}
    view = VariantsView(
        f'{Path(result.settings.game).stem}: where '
        f'{result.settings.planner.rpartition("/")[2] or "its planner"} fails',
        words,
        [goal.measure for goal in result.settings.goals],
        [axis_values(axis) for axis in result.space.axes], result.space.nominal,
        points(result), list(boundary_slices(result)), links,
        [Finding(place.name, changes(result.space, outcome.variant), outcome.values,
                 links[outcome.key]['report'], f'./run.sh {place / LIVE}',
                 f'./run.sh --replay {place}')
         for outcome, place in found])
    return write_variants_page(view, folder, PAGE)
