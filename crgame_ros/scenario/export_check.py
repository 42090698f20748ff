# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Checks, before the first step, whether a run in a scenario can be exported."""

from collections.abc import Sequence
import pickle

from crgame_ros.errors import InputError
from crgame_ros.game.objects import ObjectDescription
from crgame_ros.scenario.export_elements import planning_problem, static_obstacle, whole
from crgame_ros.scenario.export_goals import goals_of
from crgame_ros.scenario.export_ids import IdPool
from crgame_ros.scenario.export_network import framed, schema_errors, used_ids, write_roads
from crgame_ros.scenario.loading import LoadedScenario
from lxml import etree

# Cache of runs that can be exported, by what determines that, the oldest first; and its size.
_writable: dict[tuple[object, ...], None] = {}
_KEPT = 64
_ORIGIN = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


def refuse_unwritable(loaded: LoadedScenario, objects: Sequence[ObjectDescription],
                      problems: Sequence[int]) -> None:
    """
    Write everything that does not depend on the run's course, and check it by the schema.

    :param objects: objects that can appear in the run; their shapes are checked.
    :param problems: ids of the planning problems that are driven.
    :raises InputError: if the run could not be exported.
    """
    shapes = tuple(dict.fromkeys(item.shape for item in objects))
    known = {problem.planning_problem_id: problem for problem in loaded.planning_problems}
    decides = (loaded.sha256, shapes, pickle.dumps([known[number] for number in problems]))
    if decides in _writable:
        return
    roads = write_roads(loaded, 0, [])
    frame = framed(roads.elements)
    ids = IdPool(used_ids([frame]), [])
    text = [static_obstacle(ids.fresh(), 'unknown', whole(shape), _ORIGIN[:3]) for shape in shapes]
    written = [planning_problem(ids.fresh(), _ORIGIN, goals_of(
        known[number], str(number), 0, 1, roads.lanelets, [])) for number in problems]
    last = frame[-1]
    for element in map(etree.fromstring, text):
        last.addprevious(element)
    frame.extend(map(etree.fromstring, written))
    if errors := schema_errors(frame):
        raise InputError(f'a run in it could not be exported ({errors[0]})', loaded.source,
                         'correct the scenario')
    _writable[decides] = None
    if len(_writable) > _KEPT:
        del _writable[next(iter(_writable))]
