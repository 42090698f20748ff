# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The status of `/<v>/drivability`: the verdict on a driven vehicle, as it is sent."""

from crgame_ros.drivability.monitor import VehicleDrivability
from crgame_ros.game.game import DrivabilitySpec
from crgame_ros.messages.status_values import ERROR, OK, Status


def drivability_status(verdict: VehicleDrivability, spec: DrivabilitySpec) -> Status:
    """
    Return the status of a verdict.

    :param spec: of the game: which checks run.
    """
    faults = verdict.faults
    return Status.of(
        f'{verdict.vehicle_id}/drivability', ERROR if faults else OK,
        '; '.join(faults) or 'valid',
        {'collision': verdict.collision if spec.collision else 'off',
         'road_compliance': not verdict.off_road if spec.road else 'off',
         'hit': ','.join(verdict.hit), 'n': verdict.n, 'stop': verdict.stop_requested})
