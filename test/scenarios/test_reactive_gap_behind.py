# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The reactive planner before a parked car, beside a human that reacts to nothing."""

from pathlib import Path

from crgame_ros.game.game import AvSpec, Game, HumanSpec, PoseSpawn
from crgame_ros.simulation.offline import OfflineResult, run_offline
from crgame_ros.simulation.setup import build_setup
import numpy as np
import pytest

# The lanes' centre lines are at y = 2 and 6 m, the AV starts at x = 15.6 m with 20 m/s, and the
# parked car's rear is 28.5 m ahead: the braking distance from 20 m/s at 7 m/s^2.
BESIDE = 6.0


def drive(shared_scenarios: Path, spawn: PoseSpawn | None, duration_s: float) -> OfflineResult:
    """Drive the critical scenario with an idle human."""
    human = HumanSpec('hv0', 'idle', **({} if spawn is None else {'spawn': spawn}))
    game = Game(shared_scenarios / 'more' / 'DEU_Crit-1_1_T-1.xml', humans=(human,),
                avs=(AvSpec('av0', 'reactive'),))
    result = run_offline(build_setup(game), duration_s=duration_s)
    # The map begins where the human starts furthest behind.
    assert [item for item in result.violations if item.collision] == []
    return result


@pytest.mark.exhaustive
@pytest.mark.parametrize('spawn', [None, PoseSpawn(4.0, BESIDE, 0.0, 20.0),
                                   PoseSpawn(-2.0, BESIDE, 0.0, 24.0)],
                         ids=['0.9 m behind', '7 m behind', 'faster'])
def test_stops_where_there_is_no_room_beside(spawn: PoseSpawn | None,
                                             shared_scenarios: Path) -> None:
    """
    The AV cuts off no vehicle, and does not touch the parked car.

    0.6 s of headway are 12 and 14.4 m, and 4 m/s more take 0.7 s and 2.5 m/s^2: 6 m. None of the
    three has that much room behind the AV, which once reached the lane's edge at y = 4 - 0.8 m.
    """
    result = drive(shared_scenarios, spawn, 4.0)
    av = result.states_of('av0')
    beside = result.states_of('hv0')[:, 0] < av[:, 0] + 4.5
    assert av[beside, 1].max() < 3.2
    assert result.planners['av0'].accepted_ratio >= 0.8


def test_passes_where_there_is_room(shared_scenarios: Path) -> None:
    """With the human 19 m behind at its speed the AV passes the parked car ahead of the human."""
    result = drive(shared_scenarios, PoseSpawn(-8.0, BESIDE, 0.0, 20.0), 4.0)
    av, human = result.states_of('av0'), result.states_of('hv0')
    assert av[:, 1].max() > 5.0
    changing = np.flatnonzero(av[:, 1] > 3.2)[0]
    # The whole headway when it enters the lane: between rear axles it is a car's length more.
    assert av[changing, 0] - human[changing, 0] - 4.508 > 0.6 * human[changing, 3]
