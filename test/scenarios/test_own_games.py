# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The package's own games: the scripted human makes the AV react, and there are no contacts.

Those with objects, traffic or perception of their own are in test_engine_games.py.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
import functools
from pathlib import Path

from crgame_ros.drivability.monitor import VehicleDrivability
from crgame_ros.game.game import load_game
from crgame_ros.paths import scenarios_directory
from crgame_ros.simulation.offline import OfflineResult, run_offline
from crgame_ros.simulation.setup import build_setup
from crgame_ros.vehicle.parameters import load_vehicle_parameters
from crgame_ros.vehicle.state import StateColumn
import numpy as np
from numpy.typing import NDArray
import pytest
import shapely


def _is_plain(path: Path) -> bool:
    """Return whether a game has only a scenario, humans, AVs without perception, and events."""
    game = load_game(path)
    return (game.traffic is None and not game.objects
            and all(av.perception is None for av in game.avs or ()))


GAMES = sorted(path for path in scenarios_directory().glob('*.yaml')
               if path.suffixes == ['.yaml'] and _is_plain(path))


@dataclass(frozen=True)
class Reaction:
    """
    Expected effects of the human.

    :param slower: by which the AV falls below its speed without the human, at least [m/s].
    :param from_s: time before which the AV drives as without the human [s].
    :param gap: least and greatest of the smallest distances between the two bodies [m].
    """

    slower: float
    from_s: float
    gap: tuple[float, float]


# Nothing happens before the human is predicted (3 s ahead) to be in the AV's way; the least gap
# is the model's standstill gap of 2 m where both stop, and the gap side by side where one
# overtakes; upper bounds ensure a close encounter.
REACTIONS = {
    ('cut_in', 'av0'): Reaction(20.0, 4.0, (1.9, 3.0)),
    ('lane_change', 'av0'): Reaction(8.0, 0.0, (10.0, 20.0)),
    ('merge', 'av0'): Reaction(5.0, 5.0, (20.0, 45.0)),
    ('t_junction', 'av0'): Reaction(3.5, 1.5, (8.0, 22.0)),
    ('intersection', 'av0'): Reaction(5.0, 1.5, (4.0, 15.0)),
    ('roundabout', 'av0'): Reaction(2.0, 2.0, (4.0, 12.0)),
    ('parked_cars', 'av0'): Reaction(5.0, 0.0, (1.9, 5.0)),
    ('two_avs', 'av0'): Reaction(8.0, 1.0, (6.0, 18.0)),
    ('two_avs', 'av1'): Reaction(6.0, 3.0, (30.0, 60.0)),
    ('traffic', 'av0'): Reaction(6.0, 2.0, (1.9, 5.0)),
    ('crossing', 'av0'): Reaction(3.0, 0.0, (12.0, 25.0)),
}


@functools.cache
def _play(name: str, with_human: bool = True) -> OfflineResult:
    game = load_game(scenarios_directory() / f'{name}.yaml')
    return run_offline(build_setup(game if with_human else replace(game, humans=())))


def _speeds(result: OfflineResult, vehicle_id: str) -> NDArray[np.float64]:
    return result.states_of(vehicle_id)[:, StateColumn.SPEED]


def _gaps(result: OfflineResult, av_id: str) -> NDArray[np.float64]:
    """Return the distance between the bodies of the AV and the human every 0.05 s [m]."""
    vehicle = load_vehicle_parameters('bmw_320i')
    bodies = []
    for id_ in (av_id, 'hv0'):
        x, y, yaw = result.states_of(id_)[::5, :3].T
        corners = [(vehicle.rear_to_center + along * vehicle.length, across * vehicle.width)
                   for along, across in ((.5, .5), (.5, -.5), (-.5, -.5), (-.5, .5))]
        rings = np.stack([np.stack((x + a * np.cos(yaw) - b * np.sin(yaw),
                                    y + a * np.sin(yaw) + b * np.cos(yaw)), axis=-1)
                          for a, b in corners], axis=1)
        bodies.append(shapely.polygons(rings))
    return np.asarray(shapely.distance(*bodies), dtype=np.float64)


def _invalid(violations: Sequence[VehicleDrivability]) -> list[VehicleDrivability]:
    return [verdict for verdict in violations if not verdict.is_valid]


def test_every_av_has_an_expected_reaction() -> None:
    """The tests below leave out no game."""
    avs = {(path.stem, av.id) for path in GAMES for av in load_game(path).avs or ()}
    assert avs == REACTIONS.keys()


@pytest.mark.slow
@pytest.mark.matrix
@pytest.mark.parametrize(('name', 'av_id'), REACTIONS, ids=lambda value: str(value))
def test_human_makes_the_av_react(name: str, av_id: str) -> None:
    """The AV drives as if alone until the human interferes, then slows down and keeps clear."""
    expected = REACTIONS[name, av_id]
    played, alone = _play(name), _play(name, with_human=False)
    deficit = _speeds(alone, av_id) - _speeds(played, av_id)
    start = round(expected.from_s / played.setup.scheduler.dt_s)
    assert np.abs(deficit[:start]).max(initial=0.0) < 0.1
    assert deficit.max() > expected.slower
    assert expected.gap[0] < _gaps(played, av_id).min() < expected.gap[1]


@pytest.mark.matrix('cut_in')
@pytest.mark.slow
@pytest.mark.parametrize('name', sorted({name for name, _ in REACTIONS}))
def test_no_vehicle_collides_or_leaves_the_road(name: str) -> None:
    """Neither the scripted human nor an AV with idm does, and every plan is accepted."""
    for with_human in (True, False):
        result = _play(name, with_human)
        assert not _invalid(result.violations)
        for record in result.planners.values():
            assert record.counters.refused == 0
            assert record.accepted_ratio >= 0.95


def test_cut_in_is_the_manoeuvre_of_the_paper() -> None:
    """The HV gets from the left lane into the AV's, ahead of it, and both stop (CRG fig. 8, 9)."""
    result = _play('cut_in')
    human, av = result.states_of('hv0'), result.states_of('av0')
    assert human[0, StateColumn.X] < av[0, StateColumn.X]
    assert human[0, StateColumn.Y] == pytest.approx(3.75)
    assert human[-1, StateColumn.Y] == pytest.approx(0.0, abs=0.3)
    assert human[1400:, StateColumn.SPEED].max() == 0.0
    assert av[-1, StateColumn.SPEED] == 0.0
    assert av[-1, StateColumn.X] < human[-1, StateColumn.X]
    # The standstill gap s0 of the model, CRG reference 10.
    assert _gaps(result, 'av0')[-1] == pytest.approx(2.0, abs=0.3)


@pytest.mark.matrix('roundabout')
@pytest.mark.slow
@pytest.mark.parametrize('path', GAMES, ids=lambda path: str(path.stem))
def test_scripts_survive_an_uneven_clock(path: Path) -> None:
    """
    Intervals disturbed by stalls of up to 50 ms keep the human in the lane.

    The intervals still add up to n dt, by the time controller's carry. In the middle of
    the narrowest lane the vehicle has (3.5 m - 1.61 m) / 2 = 0.94 m to either side.
    """
    setup = build_setup(replace(load_game(path), avs=(), events=()))
    steps = setup.scheduler.steps_for(20.0)
    random = np.random.default_rng(0)
    late = np.abs(random.normal(0.0, 1e-3, steps))
    late += np.where(random.random(steps) < 0.01, random.uniform(0.0, 0.05, steps), 0.0)
    times = np.maximum.accumulate(np.arange(1, steps + 1) * setup.scheduler.dt_s + late)
    intervals = np.clip(np.diff(times, prepend=0.0), 1e-3, 0.05)
    even, uneven = (run_offline(setup, intervals_s=series)
                    for series in (None, intervals))
    assert not _invalid(uneven.violations)
    (x, y, yaw), (x_even, y_even, _) = (run.states_of('hv0')[-1, :3] for run in (uneven, even))
    assert abs((y - y_even) * np.cos(yaw) - (x - x_even) * np.sin(yaw)) < 0.9
