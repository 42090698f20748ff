# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The found variants as files: to read, to replay, and to drive in."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
import shutil

from crgame_ros.analysis.report.run_files import write_run_files
from crgame_ros.analysis.runs.run import Run
from crgame_ros.evaluation.cell_run import cell_setup
from crgame_ros.evaluation.folder import EvaluationFolder
from crgame_ros.paths import make_folder
from crgame_ros.search.live_game import for_a_person
from crgame_ros.search.search import SearchResult
from crgame_ros.search.text import values_text
from crgame_ros.search.trials import Outcome
from crgame_ros.simulation.offline import run_offline
from crgame_ros.variation.space import VariantSpace
from crgame_ros.whole_file import write_text

FOUND = 'found'
LIVE = 'live.yaml'
# Two findings are no closer than this, in ranges or standard deviations.
_APART = 0.1


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
