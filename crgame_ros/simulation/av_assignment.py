# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Assigns the planning problems of a scenario to AVs."""

from collections.abc import Mapping
from dataclasses import replace
import math
from typing import Final

from commonroad.planning.planning_problem import PlanningProblem
from crgame_ros.errors import InputError
from crgame_ros.game.game import AvSpec, Game
from crgame_ros.game.perception_spec import PerceptionSpec
from crgame_ros.game.traffic_spec import TrafficSpec
from crgame_ros.geometry.outline import placed_polygon
from crgame_ros.scenario.loading import LoadedScenario
from crgame_ros.scenario.spawn import problem_pose
from crgame_ros.vehicle.parameters import load_vehicle_parameters
import shapely

Part = tuple[AvSpec, PlanningProblem]
# Problems whose vehicles would touch at these times, each at its initial speed, are alternatives:
# no two planners could drive them at once [s].
_ON_ONE_SPOT_S = (0.0, 0.1, 0.2, 0.3, 0.4, 0.5)

# Number of alternatives listed in a notice, so that it stays readable.
NAMED = 8
# Keeps the setting of the game file.
OWN: Final = 'own'


def assign_avs(game: Game, loaded: LoadedScenario) -> tuple[list[Part], list[str]]:
    """
    Return the AVs of a game, each with its planning problem.

    An AV without a named problem gets the next free one. Problems that start on one spot are
    alternatives: the first of them is used. The problem of a recorded human is used only for an
    AV that names it.

    :return: AVs in the order of the game, their `planning_problem` filled in, and remarks for
        the user.
    :raises InputError: if a problem does not exist, is taken, or none is left.
    """
    problems = {problem.planning_problem_id: problem for problem in loaded.planning_problems}
    wanted = game.avs or ()
    _refuse_unknown(wanted, problems, loaded.source)
    named = [(spec, problems[spec.planning_problem]) for spec in wanted
             if spec.planning_problem is not None]
    free, notices = _free_problems(named, loaded)
    if game.avs is None:
        wanted = tuple(AvSpec(f'av{index}') for index in range(len(free)))
    parts: list[Part] = []
    for spec in wanted:
        if spec.planning_problem is None:
            if not free:
                raise InputError(
                    'no planning problem is left for it', f'{loaded.source}: {spec.id}',
                    f'the scenario has {len(problems)}: remove the AV from the game'
                    + (', or name its planning_problem' if notices else ''))
            spec = replace(spec, planning_problem=free.pop(0).planning_problem_id)
        parts.append((spec, problems[spec.planning_problem or 0]))
    return parts, notices


def _refuse_unknown(specs: tuple[AvSpec, ...], problems: dict[int, PlanningProblem],
                    source: str) -> None:
    taken: set[int] = set()
    for spec in specs:
        number = spec.planning_problem
        if number is None:
            continue
        if number not in problems:
            raise InputError(f'planning problem {number} does not exist', f'{source}: {spec.id}',
                             'use one of ' + ', '.join(map(str, problems)))
        if number in taken:
            raise InputError(f'planning problem {number} has an AV already',
                             f'{source}: {spec.id}', 'give each AV its own')
        taken.add(number)


def _free_problems(named: list[Part],
                   loaded: LoadedScenario) -> tuple[list[PlanningProblem], list[str]]:
    """Find the problems for AVs without a named one, in the order of the file."""
    taken = {problem.planning_problem_id: problem for _, problem in named}
    notices: list[str] = []
    free: list[PlanningProblem] = []
    alternatives: dict[int, list[int]] = {}
    for problem in loaded.planning_problems:
        number = problem.planning_problem_id
        if number in taken:
            continue
        if number in loaded.human_problems:
            notices.append(f'planning problem {number} belonged to a recorded human, now replayed '
                           f'as obstacle {loaded.human_problems[number]}: no AV gets it')
            continue
        rival = next((other for other in (*taken.values(), *free)
                      if _on_one_spot(problem, other)), None)
        if rival is None:
            free.append(problem)
        else:
            alternatives.setdefault(rival.planning_problem_id, []).append(number)
    for number, others in alternatives.items():
        more = f' and {len(others) - NAMED} more' if len(others) > NAMED else ''
        notices.append(
            f'planning problems {number}, {", ".join(map(str, others[:NAMED]))}{more} start on '
            f'one spot and are alternatives: {number} is driven (--problem, or planning_problem '
            'of an AV in the game, takes another)')
    return free, notices


def _on_one_spot(first: PlanningProblem, second: PlanningProblem) -> bool:
    """Return whether two vehicles touch at the start or too soon after it to prevent."""
    if first.initial_state.time_step != second.initial_state.time_step:
        return False
    return any(shapely.intersects(_placed(first, time_s), _placed(second, time_s))
               for time_s in _ON_ONE_SPOT_S)


def _placed(problem: PlanningProblem, time_s: float) -> shapely.Polygon:
    vehicle = load_vehicle_parameters()
    state = problem_pose(problem, vehicle.rear_to_center)
    x, y = state.center(vehicle.rear_to_center)
    return placed_polygon(vehicle.shape, x + time_s * state.speed * math.cos(state.yaw),
                          y + time_s * state.speed * math.sin(state.yaw), state.yaw)


def adapt_game(game: Game, loaded: LoadedScenario, *, seed: int, planner: str = OWN,
               options: Mapping[str, object] | None = None,
               perception: PerceptionSpec | str | None = OWN,
               traffic: TrafficSpec | str | None = OWN) -> Game:
    """
    Return a game with other planners, perception or traffic.

    :param seed: of everything random.
    :param planner: of all AVs, or OWN.
    :param options: of that planner.
    :param perception: of all AVs; None is perfect, OWN the game's.
    :param traffic: None is no traffic, OWN the game's.
    :raises InputError: if the scenario has no planning problems for the game's AVs.
    """
    specs = [spec for spec, _ in assign_avs(game, loaded)[0]]
    if planner != OWN:
        specs = [replace(spec, planner=planner, options=dict(options or {})) for spec in specs]
    if not isinstance(perception, str):
        specs = [replace(spec, perception=perception) for spec in specs]
    if not isinstance(traffic, str):
        game = replace(game, traffic=traffic)
    return replace(game, avs=tuple(specs), seed=seed)
