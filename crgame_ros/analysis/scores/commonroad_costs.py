# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""CommonRoad's cost functions of a trajectory, by the drivability checker's own evaluator."""

from collections.abc import Sequence
from dataclasses import dataclass
from importlib.metadata import version
from itertools import chain
import math
import re
from typing import NamedTuple, TYPE_CHECKING

from commonroad.common.solution import CostFunction, VehicleType
from commonroad.planning.planning_problem import PlanningProblem
from commonroad.scenario.scenario import Scenario
from commonroad.scenario.trajectory import Trajectory
from crgame_ros.errors import one_line

if TYPE_CHECKING:
    from crgame_ros.analysis.scores.checker import CostFunctionEvaluator, LaneletRouteMatcher

_PATH_LENGTH = 'the code takes the path length L where the site has the offset from the lane'


class CostDefinition(NamedTuple):
    """A cost function as in the checker's code: a sentence, and how the website differs."""

    definition: str
    variant: str


COSTS = {
    'JB1': CostDefinition('T', 'the same on the site'),
    'SA1': CostDefinition('0.1 SA + 0.1 SR + 1e5 D', 'weights differ from the site; the code '
                          'does not see obstacles turned by exactly 0 rad in D'),
    'WX1': CostDefinition('10 T + V + 0.1 A + 0.1 J + 0.1 D + 10 L', _PATH_LENGTH),
    'SM1': CostDefinition('50 A + 50 SA + 50 SR + L + 20 V + 50 O', _PATH_LENGTH),
    'SM2': CostDefinition('50 A + 50 SA + 50 SR + L + 50 O', _PATH_LENGTH),
    'SM3': CostDefinition('50 A + 50 SA + 50 SR + 20 V + 50 O', 'weights differ from the site'),
    'MW1': CostDefinition('5 Jlat + 0.5 Jlon + 0.2 Vlon + ID',
                          'in the code Jlat is of the lateral speed, Vlon is 0, and ID is 10'),
    'TR1': CostDefinition('0.01 Jlon + 22 SR + 8 D + 0.5 LC', 'not on the site'),
}


CHECKER = 'commonroad-drivability-checker'


@dataclass(frozen=True)
class TrajectoryCost:
    """
    The cost of a trajectory by one function.

    :param total: its value; None where it cannot be computed.
    :param parts: its partial costs without weights, by name.
    :param reason: why there is no value; empty otherwise.
    """

    name: str
    total: float | None
    parts: dict[str, float]
    reason: str = ''

    def as_dict(self) -> dict[str, object]:
        """Return the fields as a JSON-compatible dictionary."""
        if self.total is None:
            return {'total': None, 'reason': self.reason}
        return {'total': self.total, 'parts': self.parts}


def checker_version() -> str:
    """Return the name of the checker with its version."""
    return f'{CHECKER} {version(CHECKER)}'


def evaluate_costs(scenario: Scenario, problem: PlanningProblem, trajectory: Trajectory,
                   kind: VehicleType, names: Sequence[str] = tuple(COSTS)
                   ) -> tuple[TrajectoryCost, ...]:
    """
    Evaluate cost functions.

    :param scenario: the scenario without the vehicle itself.
    :param problem: the planning problem that the trajectory solves.
    :param trajectory: states of the centre, as in CommonRoad's vehicle models.
    :param kind: vehicle type, which gives the width.
    """
    from crgame_ros.analysis.scores.checker import (
        CostFunctionEvaluator,
        LaneletRouteMatcher,
    )
    evaluators = [CostFunctionEvaluator(CostFunction[name], kind) for name in names]
    along_lanes = _along_lanes(LaneletRouteMatcher(scenario, kind), trajectory, evaluators)
    found = tuple(_evaluate(scenario, problem, trajectory, evaluator, along_lanes)
                  for evaluator in evaluators)
    # The checker caches its last scenario until exit, at which its package would warn.
    LaneletRouteMatcher.scenario_cc.cache_clear()
    return found


class _AlongLanes(NamedTuple):
    """A trajectory in the coordinates of its lanes, and what cost functions ask of these."""

    trajectory: Trajectory
    properties: dict[object, object]


def _along_lanes(matcher: 'LaneletRouteMatcher', trajectory: Trajectory,
                 evaluators: Sequence['CostFunctionEvaluator']) -> _AlongLanes | None:
    """Convert a trajectory once for all functions; None where a function asks for too much."""
    asked = dict.fromkeys(chain.from_iterable(each.required_properties for each in evaluators))
    try:
        converted, _, properties = matcher.compute_curvilinear_coordinates(
            trajectory, required_properties=list(asked))
    except Exception:  # the checker can raise any exception: each function then tells its own
        return None
    return _AlongLanes(converted, properties)


def _evaluate(scenario: Scenario, problem: PlanningProblem, trajectory: Trajectory,
              evaluator: 'CostFunctionEvaluator', along_lanes: _AlongLanes | None,
              ) -> TrajectoryCost:
    """Evaluate a function, as the checker's `evaluate_pp_solution` does."""
    from crgame_ros.analysis.scores.checker import PartialCostFunctionMapping
    name = evaluator.cost_function_id.name
    try:
        if along_lanes is None:
            costs = evaluator.evaluate_pp_solution(scenario, problem, trajectory).partial_costs
        else:
            costs = {part: PartialCostFunctionMapping[part](scenario, problem, *along_lanes)
                     for part, _ in evaluator.partial_cost_funcs}
        parts = {part.name: float(value) for part, value in costs.items()}
        total = float(sum(costs[part] * weight for part, weight in evaluator.partial_cost_funcs))
    except Exception as error:  # the checker can raise any exception
        return TrajectoryCost(name, None, {}, _reason(error))
    if not math.isfinite(total):
        return TrajectoryCost(name, None, {}, 'a part of it is not finite')
    return TrajectoryCost(name, total, parts)


def _reason(error: BaseException) -> str:
    """Return in a line why the checker failed: the cause, where the error has one."""
    cause = error.__cause__ or error
    lacking = re.search(r"has no attribute '(\w+)'", str(cause))
    if isinstance(cause, AttributeError) and lacking:
        return f'its states have no {lacking[1]}'
    if cause is error:
        # Before it computes costs, the checker searches for a route along the lanes.
        return one_line(f'the checker finds no lanes for it ({type(cause).__name__}: {cause})')
    return one_line(f'{type(cause).__name__}: {cause}')
