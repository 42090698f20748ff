# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A run does not depend on where its map lies: planners, perception and traffic included."""

from pathlib import Path

from crgame_ros.paths import scenarios_directory
from crgame_ros.verdict.copies import Placement, UTM
from placed_runs import difference, run_placed
import pytest

DURATION_S = 4.0
GAMES = ('t_junction', 'fog', 'traffic', 'cut_in', 'blocked_lane', 'crossing', 'dense_merge',
         'intersection', 'lane_change', 'merge', 'occluded_pedestrian', 'parked_cars',
         'roundabout', 'two_avs')
# Noise is along and across a vehicle, and is not mirrored.
NOISY = ('fog', 'occluded_pedestrian')


@pytest.mark.slow
@pytest.mark.matrix
@pytest.mark.parametrize('game', GAMES)
@pytest.mark.parametrize(('place', 'most'), [
    (Placement(30.0), 1e-6), (Placement(45.0), 1e-6), (Placement(137.0), 1e-6),
    # Coordinates of millions of metres have nine digits less behind the point.
    (Placement(offset=UTM), 1e-5)], ids=lambda each: getattr(each, 'name', None))
def test_a_game_is_the_same_wherever_its_map_lies(tmp_path: Path, game: str, place: Placement,
                                                  most: float) -> None:
    assert _moved(tmp_path, scenarios_directory() / f'{game}.yaml', place) < most


@pytest.mark.matrix('dense_merge')
@pytest.mark.slow
@pytest.mark.parametrize('game', ['dense_merge', 'fog', 'occluded_pedestrian', 't_junction'])
def test_a_turned_game_is_the_same(tmp_path: Path, game: str) -> None:
    """
    Those that were once different: by noise, and by the end of a road of a round length.

    On roads that lead west, where headings jump from pi to -pi, agents did not change lanes.
    """
    assert _moved(tmp_path, scenarios_directory() / f'{game}.yaml', Placement(137.0)) < 1e-6


@pytest.mark.matrix('lane_change')
@pytest.mark.parametrize('game', [game for game in GAMES if game not in NOISY])
def test_a_mirrored_game_is_the_same(tmp_path: Path, game: str) -> None:
    """All vehicles keep to the other side of the road."""
    mirrored = Placement(mirrored=True)
    assert _moved(tmp_path, scenarios_directory() / f'{game}.yaml', mirrored) < 1e-6


@pytest.mark.exhaustive
@pytest.mark.parametrize(('scenario', 'degrees'), [
    # A bend in which places depended on a grid along the map's axes.
    ('DEU_Guetersloh-36_1_T-1', 45.0),
    # A fork whose lanes lie upon each other: rounding chose the lane that was predicted.
    ('more/ESP_Toledo-7_5_T-1', 137.0)])
def test_a_turned_published_scenario_is_the_same(
        tmp_path: Path, shared_scenarios: Path, scenario: str, degrees: float) -> None:
    assert _moved(tmp_path, shared_scenarios / f'{scenario}.xml', Placement(degrees)) < 1e-6


def _moved(folder: Path, path: Path, place: Placement) -> float:
    """Return the largest difference that another place of the map makes."""
    one, other = (run_placed(path, folder / name, each, DURATION_S)
                  for name, each in (('one', Placement()), ('other', place)))
    assert len(one.vehicle_states) == len(other.vehicle_states)
    return max(difference(one, other, place))
