# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The scene on `/markers`: the map, sent once, and moving things in messages refilled in place."""

from collections.abc import Mapping

from crgame_ros.game.documents import Signals
from crgame_ros.game.objects import ObjectStates
from crgame_ros.geometry.outline import outline, placed
from crgame_ros.geometry.rigid_transform import RigidTransform
from crgame_ros.messages.joints import JointSeries, vehicle_joint_names
from crgame_ros.messages.request_layout import RequestLayout
from crgame_ros.nodes.markers import bodies
from crgame_ros.nodes.markers.bodies import (
    Body,
    Item,
    LIFETIME_S,
    LightMarker,
    Line,
)
from crgame_ros.nodes.markers.roads import map_markers
from crgame_ros.roads.signs import light_places
from crgame_ros.ros.messages import set_time
from crgame_ros.ros.scenario_documents import ScenarioSet
from crgame_ros.vehicle.lights import BRAKING, Light
from crgame_ros.vehicle.state import StateColumn
import numpy as np
from numpy.typing import NDArray
from std_msgs.msg import Header
from visualization_msgs.msg import Marker, MarkerArray

FloatArray = NDArray[np.float64]

PREDICTION_Z, PLAN_Z = 0.06, 0.08
# Above the roofs of cars, so that both the perceived and the true place stay visible [m].
PERCEIVED_Z = 1.6
# Predictions are drawn with a point about every half second [s],
PREDICTION_STEP_S = 0.5
# if they move at least this far [m], and until they are this old [ns].
PREDICTION_MOVES = 0.05
PREDICTION_AGE_NS = 1_500_000_000
# Corners of the line around a circle.
CIRCLE_CORNERS = 8


class SceneMarkers:
    """
    The markers of one set of documents.

    Driven vehicles stand where the game starts them until their first states come.

    :ivar paths: plan and prediction of each AV, by its id.
    """

    def __init__(self, documents: ScenarioSet) -> None:
        self._loaded = documents.loaded
        game = documents.game
        self._problems = [av.planning_problem for av in game.avs]
        self._header: Header = bodies.map_header()
        self._bodies = [Body(self._header, number, item)
                        for number, item in enumerate(documents.objects)]
        self._vehicles = len(documents.driven)
        self._lights = {number: LightMarker(self._header, number, place.x, place.y)
                        for number, place in light_places(
                            self._loaded.scenario.lanelet_network).items()}
        outlines = {
            item.id: outline(item.shape, CIRCLE_CORNERS, False) + (item.rear_to_center, 0.0)
            for item in documents.objects}
        self.paths = {av.id: AvPaths(
            self._header, number, av.id, av.transform,
            outlines if av.perception is not None else {})
            for number, av in enumerate(game.avs)}
        self._stamp_ns = game.scheduler.clock_offset_ns
        self._time_step_ns = game.scheduler.time_step_ns
        self._objects: ObjectStates | None = None
        self._objects_ns = 0
        self._objects_brake = np.zeros(len(documents.others), dtype=bool)
        self._recorded_brake = np.zeros(len(documents.others), dtype=bool)
        self._object_ids = [item.id for item in documents.others]
        self._message = MarkerArray()
        self.set_vehicles(np.array([item.state for item in game.vehicles]), self._stamp_ns)

    def map_message(self, clear: bool) -> MarkerArray:
        """
        Build the message of the map, which is sent again only on request.

        :param clear: whether to delete everything shown before.
        """
        first = [Marker(header=bodies.map_header(), action=Marker.DELETEALL)] if clear else []
        return MarkerArray(markers=[*first, *map_markers(self._loaded, self._problems)])

    def set_vehicles(self, states: FloatArray, stamp_ns: int) -> None:
        """
        Place the driven vehicles.

        :param states: (V, 8) rear-axle states, columns as in `StateColumn`
        :param stamp_ns: simulation time at which everything is drawn [ns]
        """
        self._stamp_ns = stamp_ns
        speed, acceleration = states[:, StateColumn.SPEED], states[:, StateColumn.ACCELERATION]
        braking = acceleration * np.sign(speed) < -BRAKING
        for body, (x, y, yaw), brakes in zip(self._bodies, states[:, :3].tolist(),
                                             braking.tolist(), strict=False):
            body.place(x, y, yaw, brakes)

    def set_objects(self, objects: ObjectStates, stamp_ns: int) -> None:
        """Set the other objects at a scenario step; brake lights show where they got slower."""
        before, passed_s = self._objects, (stamp_ns - self._objects_ns) * 1e-9
        if before is not None and passed_s > 0.0:
            slower = (_speeds(objects) - _speeds(before)) / passed_s
            self._objects_brake = slower < -BRAKING
        self._objects, self._objects_ns = objects, stamp_ns

    def set_signals(self, signals: Signals) -> None:
        """Set traffic lights, inactive if not named, and brake lights of recorded vehicles."""
        for number, light in self._lights.items():
            light.show(signals.states.get(str(number), 'inactive'))
        self._recorded_brake[:] = [
            signals.objects.get(name, 0) & Light.BRAKE > 0 for name in self._object_ids]

    def message(self) -> MarkerArray:
        """Return the markers that move or change, at the time of the vehicles' states."""
        set_time(self._header.stamp, self._stamp_ns)
        self._place_objects()
        items: list[Item] = [*self._lights.values(), *self._bodies]
        for paths in self.paths.values():
            paths.expire(self._stamp_ns)
            items += (paths.plan, paths.prediction, paths.perceived)
        markers: list[Marker] = []
        for item in items:
            item.collect(markers)
        self._message.markers = markers
        return self._message

    def _place_objects(self) -> None:
        """Move the objects on from their scenario step with their velocities."""
        if self._objects is None:
            return
        since_ns = min(max(self._stamp_ns - self._objects_ns, 0), self._time_step_ns)
        poses = self._objects.poses + np.nan_to_num(self._objects.velocities) * (since_ns * 1e-9)
        for body, (x, y, yaw), brakes in zip(self._bodies[self._vehicles:], poses.tolist(),
                                             (self._objects_brake | self._recorded_brake).tolist(),
                                             strict=True):
            body.place(x, y, yaw, brakes)


def _speeds(objects: ObjectStates) -> FloatArray:
    """Return signed speeds (M) [m/s]; NaN, which is never braking, where absent."""
    yaw = objects.poses[:, 2]
    return objects.velocities[:, 0] * np.cos(yaw) + objects.velocities[:, 1] * np.sin(yaw)


class AvPaths:
    """
    The plan of an AV and its prediction of the others, as lines.

    :param transform: from simulation to the scenario coordinates that the planner uses.
    :param outlines: corners (n, 2) of each object around its reference point, by id [m]; empty for
        an AV that knows the truth.
    """

    def __init__(self, header: Header, number: int, av_id: str, transform: RigidTransform,
                 outlines: Mapping[str, FloatArray]) -> None:
        self._transform = transform
        self._outlines = outlines
        self._own = av_id
        self._names = vehicle_joint_names(av_id)
        self.plan = Line(bodies.blank(
            header, 'plan', number, Marker.LINE_STRIP, bodies.colour(bodies.SKY_BLUE),
            (0.4, 0.0, 0.0), LIFETIME_S), PLAN_Z)
        self.prediction = Line(bodies.blank(
            header, 'prediction', number, Marker.LINE_LIST, bodies.colour(bodies.YELLOW, 0.7),
            (0.2, 0.0, 0.0), LIFETIME_S), PREDICTION_Z)
        self.perceived = Line(bodies.blank(
            header, 'perceived', number, Marker.LINE_LIST, bodies.colour(bodies.VERMILLION),
            (0.15, 0.0, 0.0), LIFETIME_S), PERCEIVED_Z)
        self._plan_end_ns = 0
        self._prediction_end_ns = 0

    def set_plan(self, series: JointSeries) -> None:
        """Draw the rear-axle positions of a plan; skip a plan for another AV."""
        if series.names != self._names or not len(series.times_ns):
            return
        places = self._transform.to_simulation(series.positions[:, :3])[:, :2]
        self.plan.fill(places[np.isfinite(places).all(axis=1)])
        self._plan_end_ns = series.stamp_ns + int(series.times_ns[-1])

    def set_prediction(self, series: JointSeries) -> None:
        """
        Draw the predicted paths of the others' reference points.

        :raises InputError: if it is another AV's request.
        """
        if len(series.times_ns) < 2:
            return
        step_s = float(series.times_ns[1] - series.times_ns[0]) * 1e-9
        stride = max(1, round(PREDICTION_STEP_S / max(step_s, 1e-3)))
        chosen = np.unique([*range(0, len(series.times_ns), stride), len(series.times_ns) - 1])
        layout = RequestLayout.from_names(series.names, self._own)
        poses = series.positions[chosen][:, layout.columns]
        poses = self._transform.to_simulation(poses)
        ends = np.stack((poses[:-1, :, :2], poses[1:, :, :2]), axis=2)
        moves = np.hypot(*np.moveaxis(ends[:, :, 1] - ends[:, :, 0], 2, 0))
        self.prediction.fill(ends[moves > PREDICTION_MOVES].reshape(-1, 2))
        edges = [_edges(self._outlines[owner], pose)
                 for owner, pose in zip(layout.ids, poses[0], strict=True)
                 if owner in self._outlines and np.isfinite(pose).all()]
        self.perceived.fill(np.concatenate(edges) if edges else np.empty((0, 2)))
        self._prediction_end_ns = series.stamp_ns + PREDICTION_AGE_NS

    def expire(self, stamp_ns: int) -> None:
        """Hide a plan that is used up and a prediction that is out of date."""
        self.plan.present &= stamp_ns <= self._plan_end_ns
        self.prediction.present &= stamp_ns <= self._prediction_end_ns
        self.perceived.present &= stamp_ns <= self._prediction_end_ns


def _edges(corners: FloatArray, pose: FloatArray) -> FloatArray:
    """Return the ends (2 n, 2) of an outline's edges at a pose: x, y [m] and yaw [rad]."""
    ends = placed(corners, pose)
    return np.stack((ends, np.roll(ends, -1, axis=0)), axis=1).reshape(-1, 2)
