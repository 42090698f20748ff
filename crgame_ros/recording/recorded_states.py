# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Reads the recorded states of driven vehicles at every simulation step."""

from pathlib import Path

from crgame_ros.errors import InputError
from crgame_ros.messages.joints import VEHICLE_JOINTS, vehicles_from_joints
from crgame_ros.messages.world_messages import VEHICLES_TOPIC
from crgame_ros.recording.epochs import read_epoch
from crgame_ros.recording.gap_filling import farthest, piece_around
from crgame_ros.recording.reader import BagReader
from crgame_ros.recording.resampling import resample
from crgame_ros.recording.run_points import read_points
from crgame_ros.vehicle.state import STATE_WIDTH
import numpy as np
from numpy.typing import NDArray


def recorded_states(path: Path, epoch: int | None = None) -> dict[str, NDArray[np.float64]]:
    """
    Read the published states of each driven vehicle at the steps n = 0, 1, … of a run.

    Gaps of up to a second are filled by cubics between the states around them.

    :param path: of a recording.
    :param epoch: which run, where it holds several; None for the last.
    :return: by vehicle (N, 8) rear-axle states, columns as in `StateColumn`.
    :raises InputError: if the beginning is missing, or no state was recorded.
    """
    with BagReader(path, parts=True) as reader:
        run = read_epoch(reader, epoch)
        vehicles = [item.id for item in run.descriptions if item.role.is_ego]
        points = read_points(reader, run, {VEHICLES_TOPIC: vehicles})[VEHICLES_TOPIC]
    scheduler = run.game.scheduler
    if not points or min(points) > farthest(scheduler):
        raise InputError(f'the beginning of {VEHICLES_TOPIC} was not recorded', str(path),
                         'record from before the start of the run')
    known = {n: vehicles_from_joints(*point.reshape(3, -1, len(VEHICLE_JOINTS)))
             for n, point in points.items()}
    known.setdefault(0, np.array([item.state for item in run.game.vehicles]).reshape(
        -1, STATE_WIDTH))
    ns = piece_around(np.array(sorted(known), dtype=np.int64), 0, scheduler)
    nominal_s = np.full((int(ns[-1]) + 1, len(vehicles)), scheduler.dt_s)
    states = resample(np.array([known[n] for n in ns.tolist()]), ns, nominal_s, scheduler.dt_s,
                      np.arange(ns[-1] + 1))
    return {vehicle: states[:, column] for column, vehicle in enumerate(vehicles)}
