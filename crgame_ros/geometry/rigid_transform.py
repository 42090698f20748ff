# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The rigid transform between simulation and scenario coordinates (CRG 6-10)."""

from collections.abc import Sequence
from dataclasses import dataclass
import math

from crgame_ros.geometry.angles import wrap_pi, wrap_pi_array
import numpy as np
from numpy.typing import NDArray

Pose = tuple[float, float, float]


@dataclass(frozen=True)
class RigidTransform:
    """
    A map of poses from simulation to scenario coordinates, p_sc = R p_sim + d (CRG 9).

    :param yaw_offset: Delta psi [rad] (CRG 6), which defines R (CRG 7).
    :param offset_x: first component of d [m] (CRG 8).
    :param offset_y: second component of d [m] (CRG 8).
    """

    yaw_offset: float = 0.0
    offset_x: float = 0.0
    offset_y: float = 0.0

    @classmethod
    def between(cls, simulation_pose: Pose, scenario_pose: Pose) -> 'RigidTransform':
        """
        Find the transform that maps one initial AV pose onto the other (CRG 6-8).

        Poses that agree give the identity exactly.

        :param simulation_pose: (x, y, yaw) at which the simulator places the AV [m, m, rad]
        :param scenario_pose: (x, y, yaw) that the planning problem declares [m, m, rad]
        """
        if simulation_pose == scenario_pose:
            return cls()
        x, y, yaw = simulation_pose
        yaw_offset = wrap_pi(scenario_pose[2] - yaw)
        cos, sin = math.cos(yaw_offset), math.sin(yaw_offset)
        return cls(yaw_offset, scenario_pose[0] - (cos * x - sin * y),
                   scenario_pose[1] - (sin * x + cos * y))

    @property
    def is_identity(self) -> bool:
        """Return whether the transform leaves every pose unchanged."""
        return self.yaw_offset == 0.0 and self.offset_x == 0.0 and self.offset_y == 0.0

    def to_scenario(self, poses: NDArray[np.float64]) -> NDArray[np.float64]:
        """Map poses (..., 3) from simulation to scenario coordinates (CRG 9)."""
        cos, sin = math.cos(self.yaw_offset), math.sin(self.yaw_offset)
        x, y = poses[..., 0], poses[..., 1]
        return np.stack((cos * x - sin * y + self.offset_x, sin * x + cos * y + self.offset_y,
                         wrap_pi_array(poses[..., 2] + self.yaw_offset)), axis=-1)

    def turn_to_scenario(self, vectors: NDArray[np.float64]) -> NDArray[np.float64]:
        """Rotate vectors (..., 2), such as velocities, from simulation to scenario coordinates."""
        cos, sin = math.cos(self.yaw_offset), math.sin(self.yaw_offset)
        x, y = vectors[..., 0], vectors[..., 1]
        return np.stack((cos * x - sin * y, sin * x + cos * y), axis=-1)

    def to_simulation(self, poses: NDArray[np.float64]) -> NDArray[np.float64]:
        """Map poses (..., 3) from scenario to simulation coordinates (CRG 10)."""
        cos, sin = math.cos(self.yaw_offset), math.sin(self.yaw_offset)
        x, y = poses[..., 0] - self.offset_x, poses[..., 1] - self.offset_y
        return np.stack((cos * x + sin * y, -sin * x + cos * y,
                         wrap_pi_array(poses[..., 2] - self.yaw_offset)), axis=-1)


def road_transforms(humans: int, avs: Sequence[RigidTransform]) -> tuple[RigidTransform, ...]:
    """
    Return the transform with which each driven vehicle is checked against the road (CRG 28).

    An AV has its own; humans use that of the first AV, because the paper has only one AV.

    :return: transforms of the humans, then of the AVs.
    """
    return (*[avs[0] if avs else RigidTransform()] * humans, *avs)
