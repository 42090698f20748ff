# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Runs of games and scenarios whose maps are mirrored, turned or moved, compared with others."""

import math
from pathlib import Path
from typing import Any

from crgame_ros.game.game import parse_game
from crgame_ros.simulation.offline import OfflineResult, run_offline
from crgame_ros.simulation.setup import build_setup
from crgame_ros.vehicle.state import StateColumn
from crgame_ros.verdict.copies import mirrored_driver, placed, Placement, write_scenario_copy
import numpy as np
from numpy.typing import NDArray
import yaml

# A scenario without a game: one AV, and agents that take the place of its recorded vehicles.
PLAYED = {'humans': [], 'avs': [{'id': 'av0', 'planner': 'idm'}], 'seed': 1,
          'traffic': {'recorded': 'reactive', 'agents': 10}}


def undone(states: NDArray[np.float64], place: Placement) -> NDArray[np.float64]:
    """Return x, y, yaw and speed (..., 4) of states (..., 8) in the map as it was."""
    positions = (states[..., :2] - place.offset) @ place.turned
    side = -1.0 if place.mirrored else 1.0
    yaws = side * (states[..., StateColumn.YAW] - math.radians(place.degrees))
    return np.concatenate((positions, yaws[..., None],
                           states[..., StateColumn.SPEED, None]), axis=-1)


def played_values(path: Path) -> dict[str, Any]:
    """Return the values of a game's file, or of `PLAYED` in a CommonRoad scenario."""
    return {**PLAYED, 'scenario': path.name} if path.suffix == '.xml' \
        else dict(yaml.safe_load(path.read_text()))


def run_placed(path: Path, folder: Path, place: Placement, duration_s: float) -> OfflineResult:
    """
    Run a game whose map is placed anew.

    :param path: of a game, or of a CommonRoad scenario, which is then `PLAYED`.
    :param folder: for the files of this placement alone.
    """
    played = played_values(path)
    values = placed(played, place)
    values['scenario'] = write_scenario_copy(path.parent / played['scenario'], place, folder)
    if place.mirrored:
        for human in values['humans']:
            human['driver'] = mirrored_driver(human['driver'], path.parent, folder)
    return run_offline(build_setup(parse_game(values, str(path), path.parent)),
                       duration_s=duration_s)


def difference(one: OfflineResult, other: OfflineResult,
               place: Placement) -> tuple[float, float, float]:
    """
    Return the largest differences of positions [m], yaws [rad] and speeds [m/s].

    :param one: a run in the map as it is.
    :param other: the run in the map placed anew.
    """
    first, second = undone(one.vehicle_states, Placement()), undone(
        other.vehicle_states, place)
    steps = min(len(first), len(second))
    apart = second[:steps] - first[:steps]
    apart[..., 2] = (apart[..., 2] + np.pi) % (2.0 * np.pi) - np.pi
    largest = np.abs(apart).max(axis=tuple(range(apart.ndim - 1)))
    return float(largest[:2].max()), float(largest[2]), float(largest[3])
