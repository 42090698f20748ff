# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Poses of a recording at every step, and between the steps as the page shows them."""

from pathlib import Path
from typing import NamedTuple

from crgame_ros.messages.cdr import stamp_of
from crgame_ros.messages.joints import OBJECT_STATES_TOPIC, VEHICLES_TOPIC, WorldMessages
from crgame_ros.recording.epochs import read_epoch
from crgame_ros.recording.reader import BagReader
import numpy as np
from numpy.typing import NDArray

# Durations of a simulation step and a scenario step of the games used here [s].
DT_S, DT_C_S = 0.01, 0.1


class Recorded(NamedTuple):
    """Poses of a bag: (V, 3) of vehicles by n, (2, M, 3) poses and velocities by k."""

    k0: int
    vehicles: dict[int, NDArray[np.float64]]
    objects: dict[int, NDArray[np.float64]]

    def vehicles_at(self, t: float, before: int, after: int) -> NDArray[np.float64]:
        """Interpolate between two recorded steps, angles by the shortest way."""
        share = (t - before * DT_S) / ((after - before) * DT_S)
        change = self.vehicles[after] - self.vehicles[before]
        change[:, 2] = (change[:, 2] + np.pi) % (2.0 * np.pi) - np.pi
        return self.vehicles[before] + share * change

    def objects_at(self, t: float, k: int) -> NDArray[np.float64]:
        """Extrapolate the objects from their scenario step."""
        poses, velocities = self.objects[k]
        return poses + (t - (k - self.k0) * DT_C_S) * velocities


def read_recorded(bag: Path, epoch: int) -> Recorded:
    """Read all steps of an epoch."""
    with BagReader(bag) as reader:
        run = read_epoch(reader, epoch)
        scheduler = run.game.scheduler
        world = WorldMessages(run.descriptions)
        recorded = Recorded(scheduler.k0, {}, {})
        for topic, _, log_time_ns, message in reader.decoded(
                [VEHICLES_TOPIC, OBJECT_STATES_TOPIC]):
            stamp_ns = stamp_of(message)
            if not run.holds(stamp_ns, log_time_ns):
                continue
            n = scheduler.step_of_stamp(stamp_ns)
            if topic == VEHICLES_TOPIC:
                recorded.vehicles[n] = world.vehicle_states(message)[:, :3]
            else:
                objects = world.object_states(message)
                recorded.objects[scheduler.k(n)] = np.stack((objects.poses, objects.velocities))
    return recorded
