# Copyright 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Reading a plan request from joints, the same in process and over DDS."""

from collections.abc import Mapping

import numpy as np

from crgame_ros.errors import InputError
from crgame_ros.planner.interface import PlanRequest
from crgame_ros.planner.joints import (
    JointSeries,
    object_joint_names,
    vehicle_joint_names,
    vehicles_from_joints,
)
from crgame_ros.scenario.objects import ObjectDescription
from crgame_ros.timing.scenario_scheduler import ScenarioScheduler
from crgame_ros.vehicle.state import VehicleState


class RequestReader:
    """
    Turns requests of one AV into the planner's view: centre poses, by object.

    :param vehicle_id: the AV.
    :param objects: description of everything that can appear, by id.
    :param scheduler: the run's time grids, with its clock offset.
    """

    def __init__(self, vehicle_id: str, objects: Mapping[str, ObjectDescription],
                 scheduler: ScenarioScheduler) -> None:
        self._vehicle_id = vehicle_id
        self._objects = objects
        self._scheduler = scheduler
        self._names: tuple[str, ...] | None = None
        self._ids: tuple[str, ...] = ()
        self._columns = np.empty((0, 3), dtype=np.intp)
        self._to_center = np.empty(0)

    def read(self, series: JointSeries) -> PlanRequest:
        """
        Read one request.

        :raises InputError: if it is no tick's, or names objects that nobody described.
        """
        if series.names != self._names:
            self._learn(series.names)
        where = f'/{self._vehicle_id}/plan_request'
        tick = self._scheduler.tick_of_stamp(series.stamp_ns)
        if tick is None:
            raise InputError(f'stamp {series.stamp_ns} ns is no scenario tick', where)
        if not len(series.positions):
            raise InputError('has no points', where)
        ego = vehicles_from_joints(series.positions[0, :4], series.velocities[0, :4],
                                   series.accelerations[0, :4])
        poses = series.positions[:, self._columns]
        velocities = series.velocities[:, self._columns]
        shifted = self._to_center != 0.0
        if shifted.any():
            yaw, reach = poses[:, shifted, 2], self._to_center[shifted]
            yaw_rate = velocities[:, shifted, 2]
            poses[:, shifted, 0] += reach * np.cos(yaw)
            poses[:, shifted, 1] += reach * np.sin(yaw)
            velocities[:, shifted, 0] -= reach * np.sin(yaw) * yaw_rate
            velocities[:, shifted, 1] += reach * np.cos(yaw) * yaw_rate
        return PlanRequest(
            series.stamp_ns, self._scheduler.k(tick), self._scheduler.time_step_s,
            VehicleState(*ego.tolist()), self._ids, poses, velocities)

    def _learn(self, names: tuple[str, ...]) -> None:
        """Find out which columns hold which object; the joints stay the same over a run."""
        where = f'/{self._vehicle_id}/plan_request'
        own = vehicle_joint_names(self._vehicle_id)
        if names[:4] != own:
            raise InputError('does not begin with ' + ', '.join(own), where)
        place = {name: index for index, name in enumerate(names)}
        ids = list(dict.fromkeys(name.rpartition('/')[0] for name in names[4:]))
        for object_id in ids:
            if object_id not in self._objects:
                raise InputError(f'object "{object_id}" is not described', where,
                                 'publish it on /scenario/objects first')
            if not place.keys() >= set(object_joint_names(object_id)):
                raise InputError(f'object "{object_id}" lacks a joint', where,
                                 'name ' + ', '.join(object_joint_names(object_id)))
        self._ids = tuple(ids)
        self._columns = np.array([[place[f'{object_id}/{joint}'] for joint in ('x', 'y', 'yaw')]
                                  for object_id in ids], dtype=np.intp).reshape(-1, 3)
        self._to_center = np.array([self._objects[object_id].rear_to_center
                                    for object_id in ids])
        self._names = names
