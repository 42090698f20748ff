# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The reader of plan requests from joints, the same in process and over DDS."""

from collections.abc import Mapping

from crgame_ros.errors import InputError
from crgame_ros.game.objects import ObjectDescription
from crgame_ros.game.scenario_scheduler import ScenarioScheduler
from crgame_ros.geometry.reference_point import shifted, shifted_velocities
from crgame_ros.messages.joints import JointSeries, vehicles_from_joints
from crgame_ros.messages.plan import PlanRequest
from crgame_ros.messages.request_layout import light_columns, light_of, RequestLayout
from crgame_ros.vehicle.state import VehicleState
import numpy as np


class RequestReader:
    """
    A reader of the requests of one AV: it gives planners the centre poses by object.

    :param vehicle_id: the AV.
    :param objects: description of all objects that can appear, by id.
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
        # Of the driven vehicles among them: their places, and from the rear axle to the centre.
        self._driven = np.empty(0, dtype=np.intp)
        self._to_center = np.empty(0)
        self._lights: dict[str, int] = {}

    def read(self, series: JointSeries) -> PlanRequest:
        """
        Read one request.

        :raises InputError: if its stamp is no tick, or it names objects without a description.
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
        driven, reach = self._driven, self._to_center
        if len(driven):
            rear = poses[:, driven]
            poses[:, driven] = shifted(rear, reach)
            velocities[:, driven] = shifted_velocities(rear[..., 2], velocities[:, driven], reach)
        shown = ((name, light_of(float(series.positions[0, column])))
                 for name, column in self._lights.items())
        return PlanRequest(
            series.stamp_ns, self._scheduler.k(tick), self._scheduler.time_step_s,
            VehicleState(*ego.tolist()), self._ids, poses, velocities,
            {name: light for name, light in shown if light is not None})

    def _learn(self, names: tuple[str, ...]) -> None:
        """Find the columns of each object; the joints stay the same during a run."""
        layout = RequestLayout.from_names(names, self._vehicle_id)
        layout.indices({name: number for number, name in enumerate(self._objects)})
        self._ids, self._columns = layout.ids, layout.columns
        to_center = np.array([self._objects[object_id].rear_to_center
                              for object_id in layout.ids])
        self._driven = np.flatnonzero(to_center)
        self._to_center = to_center[self._driven]
        self._lights = light_columns(names)
        self._names = names
