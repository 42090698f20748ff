# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
A recorded run as a game that varies: its humans a little earlier or later, faster or slower.

Each human's vehicle becomes an object that follows the driven path. Their inputs would not do:
pressed elsewhere or at another speed, they lead off the road.
"""

from dataclasses import replace
import math
from pathlib import Path

from crgame_ros.errors import InputError
from crgame_ros.game.object_spec import BICYCLE_TYPES, MAX_ROWS, ObjectSpec, TrajectoryRow
from crgame_ros.game.objects import ObjectDescription
from crgame_ros.game.variation_spec import Dimension
from crgame_ros.recording.metadata import METADATA_FILE
from crgame_ros.recording.recorded_game import read_recorded_game
from crgame_ros.recording.run_folder import BAG, folder_name, recording_in
from crgame_ros.recording.run_trajectories import read_trajectories
from crgame_ros.vehicle.state import StateColumn
from crgame_ros.whole_file import write_text
import numpy as np
from numpy.typing import NDArray

# What people do: their speeds on one road differ by about a tenth, and the moment of a manoeuvre
# by about half a second; nobody brakes or steers harder than this [m/s^2].
SPEED_DEVIATION, SHIFT_DEVIATION_S = 0.1, 0.5
SLOWEST, FASTEST, LATEST_S = 0.8, 1.25, 1.5
HARDEST = 8.0


def game_of_run(run: Path, folder: Path, other_planners: bool) -> Path:
    """
    Write the game of a recorded run, its humans on their paths, and what varies in it.

    :param run: folder of the run, or its recording.
    :param folder: of the files: `NAME.yaml` and `NAME.xml`.
    :param other_planners: whether the user names the planner.
    :return: the game file.
    :raises InputError: if the recording cannot be used, or has no human or no AV; or if the game
        file has been edited.
    """
    bag = recording_in(run)
    recorded = read_recorded_game(bag, other_planners=other_planners)
    log = read_trajectories(bag)
    humans = [human.id for human in recorded.game.humans]
    if not humans:
        raise InputError('no human drove in it', str(run), 'name a game with `vary:` instead')
    objects, vary = [], []
    step_s = recorded.loaded.scenario.dt
    for column, vehicle in enumerate(log.vehicles):
        if vehicle.id not in humans:
            continue
        states = log.finite_vehicle_states[:, column]
        name = f'recorded_{vehicle.id}'
        objects.append(ObjectSpec(
            # What has no type of its kind, such as a priority vehicle, moves as a car.
            name, 'bicycle', type=vehicle.type if vehicle.type in BICYCLE_TYPES else 'car',
            end='stay',
            size=(vehicle.shape.length, vehicle.shape.width),
            trajectory=_rows(states, vehicle, step_s)))
        vary += [
            Dimension(f'{vehicle.id}_shift', f'objects.{name}.shift', -LATEST_S, LATEST_S,
                      distribution='normal', mean=0.0, deviation=SHIFT_DEVIATION_S, nominal=0.0),
            Dimension(f'{vehicle.id}_speed', f'objects.{name}.speed_factor', SLOWEST,
                      _fastest(states, step_s), distribution='normal', mean=1.0,
                      deviation=SPEED_DEVIATION, nominal=1.0)]
    name = folder_name(run)
    game = recorded.game
    game = replace(
        game, scenario=folder / f'{name}.xml', humans=(), objects=(*game.objects, *objects),
        vary=tuple(vary), duration=min(game.duration, (len(log.ks) - 1) * step_s),
        drivability=replace(game.drivability, stop=False))
    path, text = folder / f'{name}.yaml', game.dump()
    if path.exists() and path.read_text(encoding='utf-8') != text:
        raise InputError('is another game than that of the run', str(path),
                         'search this file, or remove it')
    write_text(log.xml_text, folder / f'{name}.xml')
    write_text(text, path)
    return path


def _rows(states: NDArray[np.float64], vehicle: ObjectDescription,
          step_s: float) -> tuple[TrajectoryRow, ...]:
    yaw = states[:, StateColumn.YAW]
    x = states[:, StateColumn.X] + vehicle.rear_to_center * np.cos(yaw)
    y = states[:, StateColumn.Y] + vehicle.rear_to_center * np.sin(yaw)
    table = np.column_stack((np.arange(len(yaw)) * step_s, x, y, yaw)).round(4)
    stride = math.ceil(len(table) / MAX_ROWS)
    return tuple((t, a, b, c) for t, a, b, c in table[::stride].tolist())


def _fastest(states: NDArray[np.float64], step_s: float) -> float:
    """Return the greatest factor at which accelerations, which grow with its square, are human."""
    speed, yaw = states[:, StateColumn.SPEED], np.unwrap(states[:, StateColumn.YAW])
    along = np.abs(np.diff(speed)) / step_s
    across = np.abs(np.diff(yaw)) / step_s * np.abs(speed[:-1])
    most = max(float(np.max(np.hypot(along, across), initial=0.0)), 1e-6)
    return max(1.02, min(FASTEST, math.sqrt(HARDEST / most)))


def is_recording(path: Path) -> bool:
    """Return whether a path is a recorded run."""
    return (path / BAG).is_dir() or (path / METADATA_FILE).exists()
