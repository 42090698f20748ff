# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The page of a search."""

from collections.abc import Sequence
from pathlib import Path

from crgame_ros.analysis.report.command import REPORT_FILE
from crgame_ros.evaluation.variants_page import (
    axis_values,
    Finding,
    VariantPoint,
    VariantsView,
    write_variants_page,
)
from crgame_ros.recording.offline_recording import GAME_FILE
from crgame_ros.search.findings import LIVE
from crgame_ros.search.search import SearchResult
from crgame_ros.search.text import boundary_slices, changes, told, verdict
from crgame_ros.search.trials import Outcome

PAGE = 'index.html'


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
        [VariantPoint(outcome.key, outcome.variant, outcome.values, verdict(outcome),
                      told(outcome)) for outcome in result.outcomes],
        list(boundary_slices(result)), links,
        [Finding(place.name, changes(result.space, outcome.variant), outcome.values,
                 links[outcome.key]['report'], f'./run.sh {place / LIVE}',
                 f'./run.sh --replay {place}')
         for outcome, place in found])
    return write_variants_page(view, folder, PAGE)
