# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The planners of one AV: which one is active, on which roads, after which events."""

from dataclasses import replace
from typing import ClassVar

from crgame_ros.errors import InputError, PlanningError
from crgame_ros.game.events import EventSpec, PlannerSwap, SpeedLimit
from crgame_ros.messages.plan import Plan, PlanRequest
from crgame_ros.paths import scenarios_directory
from crgame_ros.planner.interface import Planner, PlannerContext
from crgame_ros.planner.manager import PlannerManager
from crgame_ros.planner.path_planner import initial_state
from crgame_ros.roads.network import RoadNetwork
from crgame_ros.scenario.loading import load_scenario
from crgame_ros.vehicle.parameters import load_vehicle_parameters
import pytest

TOWN = 50.0 / 3.6
SLOW = EventSpec('slow', SpeedLimit(5.0))
SWAP = EventSpec('swap', PlannerSwap('av0', f'{__file__}:Witness', {'name_tag': 'b'}))
ELSEWHERE = EventSpec('elsewhere', PlannerSwap('av1', 'no-such-planner'))
FAILING = EventSpec('failing', PlannerSwap('av0', f'{__file__}:Witness', {'name_tag': 'bad'}))


class Witness(Planner):
    """A planner that remembers the limits of lanelet 11 from its setups; one tag fails."""

    name: ClassVar[str] = 'witness'

    def __init__(self, name_tag: str = 'a') -> None:
        self.name_tag = name_tag
        self.limits: list[float | None] = []

    def setup(self, context: PlannerContext) -> None:
        """Read the limit."""
        if self.name_tag == 'bad':
            raise PlanningError('no way')
        self.limits.append(RoadNetwork(context.scenario.lanelet_network).speed_limit(11))

    def plan(self, request: PlanRequest) -> Plan:
        """Raise an error: the tests do not ask for plans."""
        raise PlanningError('none')


@pytest.fixture(scope='module')
def context() -> PlannerContext:
    """Return a planner's context on the street of the crossing."""
    loaded = load_scenario(scenarios_directory() / 'ZAM_Crossing-1_1_T-1.xml')
    return PlannerContext('av0', loaded.scenario, loaded.planning_problems[0],
                          load_vehicle_parameters('bmw_320i'), {}, 0.1)


def manager_of(context: PlannerContext, *events: EventSpec) -> PlannerManager:
    """Make a manager that begins with witness a."""
    return PlannerManager(context, f'{__file__}:Witness', {'name_tag': 'a'}, events)


def present(manager: PlannerManager) -> tuple[str, list[float | None]]:
    """Return the active planner, and the limits that it was set up with."""
    planner = manager.adapter.planner
    return planner.name_tag, [round(limit, 3) for limit in planner.limits]


def test_in_office_and_after_each_event(context: PlannerContext) -> None:
    """For any order of the events, the active planner knows the current limit."""
    town = round(TOWN, 3)
    manager = manager_of(context, SLOW, SWAP, ELSEWHERE)
    assert present(manager) == ('a', [town])
    assert manager.apply(['slow']) == ['speed limit 5 m/s']
    assert present(manager) == ('a', [town, 5.0])
    assert manager.apply(['slow', 'elsewhere', 'swap']) == [f'planner {__file__}:Witness']
    assert present(manager) == ('b', [town, 5.0])
    assert manager.apply(['slow', 'elsewhere', 'swap']) == []
    other = manager_of(context, SLOW, SWAP)
    # Set up once before the run: the swap itself costs no time.
    other.apply(['swap'])
    assert present(other) == ('b', [town])
    other.apply(['swap', 'slow'])
    assert present(other) == ('b', [town, 5.0])
    assert RoadNetwork(context.scenario.lanelet_network).speed_limit(11) \
        == pytest.approx(TOWN, abs=1e-4)


def test_answers_of_all_planners_are_counted_together(context: PlannerContext) -> None:
    """A swap loses no count."""
    manager = manager_of(context, SWAP)
    request = PlanRequest(0, 0, 0.1, initial_state(context))
    manager.plan(request)
    manager.apply(['swap'])
    manager.plan(replace(request, stamp_ns=100_000_000, k=1))
    assert (manager.statistics.plans, manager.statistics.fallbacks) == (2, 2)
    assert manager.last_reason == 'none'


def test_failure_is_told(context: PlannerContext) -> None:
    """A new planner that cannot be set up answers by braking, and reports the reason."""
    manager = manager_of(context, FAILING)
    assert manager.failure is None
    assert manager.apply(['failing']) == [f'planner {__file__}:Witness: setup failed: no way']
    assert manager.plan(PlanRequest(0, 0, 0.1, initial_state(context))).fallback


def test_unknown_planner_is_refused_before_the_run(context: PlannerContext) -> None:
    """The refusal does not come in the middle of the run."""
    with pytest.raises(InputError, match='there is no planner "ghost"'):
        manager_of(context, EventSpec('swap', PlannerSwap('av0', 'ghost')))
