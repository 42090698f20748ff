# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The observation of a policy: the same in training, offline and live.

Coordinates are those of the vehicle's rear axle: x ahead, y to the left. Many vehicles are
observed at once; the observation of one does not depend on the others.
"""

from collections import deque
from collections.abc import Sequence

from commonroad.scenario.scenario import Scenario
from crgame_ros.game.perception_spec import SensorSpec
from crgame_ros.geometry.angles import wrap_pi_array
from crgame_ros.geometry.reference_point import ahead, seen_from
from crgame_ros.perception.sensors import create_sensor
from crgame_ros.policy.observation_spec import (
    Numbers,
    OBJECT_COLUMNS,
    ObservationSpec,
    ROUTE_COLUMNS,
    stacked,
    STATE_COLUMNS,
)
from crgame_ros.policy.route_guide import RouteGuide, RoutePlace
from crgame_ros.policy.seat_view import Surrounded
from crgame_ros.vehicle.parameters import VehicleParameters
from crgame_ros.vehicle.state import VehicleState
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Observed = dict[str, Numbers]


class Observation:
    """
    The observation of one kind of vehicle on the same roads.

    :param scenario: with the roads, for the image.
    """

    def __init__(self, spec: ObservationSpec, vehicle: VehicleParameters,
                 scenario: Scenario) -> None:
        self.spec = spec
        self._bounds = {part: spec.bounds_now(part) for part in spec.parts}
        self._ones = {part: spec.ones(part) for part in spec.parts if part != 'image'}
        self._ahead: Array = spec.route_spacing * np.arange(
            1, spec.route_points + 1, dtype=np.float64)
        self._to_center = vehicle.rear_to_center
        if 'lidar' in spec.parts:
            self._lidar = create_sensor(SensorSpec(
                'lidar', field_of_view=2.0 * np.pi, horizon=spec.horizon, rays=spec.rays))
        if 'image' in spec.parts:
            # Pillow is imported by those who draw alone, not at each start of a run.
            from crgame_ros.policy.bird_view import BirdView
            self._bird = BirdView(spec.image_size, spec.pixel, scenario.lanelet_network)

    def observe(self, around: Sequence[Surrounded], places: Sequence[RoutePlace],
                guides: Sequence[RouteGuide]) -> Observed:
        """
        Return the observations of B vehicles.

        :param around: (B) vehicles and their surroundings, each of N objects.
        :param places: (B) on their routes.
        :param guides: (B) of their routes.
        :return: by part, (B, …) as in `ObservationSpec.bounds_now`, within them.
        """
        states = [each.state for each in around]
        own = np.array(states, dtype=np.float64)[:, :3]
        made: Observed = {}
        for part in self.spec.parts:
            if part == 'image':
                made[part] = np.stack([
                    self._bird.paint(each, guide.driving.path, place.s)
                    for each, place, guide in zip(around, places, guides, strict=True)])
                continue
            if part == 'state':
                values = _state(states, places)
            elif part == 'route':
                values = self._route(own, places, guides)
            elif part == 'objects':
                values = self._objects(own, around)
            else:
                values = self._ranges(around)
            low, high = self._bounds[part]
            if self.spec.scaled:
                values = values / self._ones[part]
            # Rounded before clipping: a clipped value must equal the bound to the last bit.
            made[part] = np.minimum(np.maximum(values.astype(np.float32), low), high)
        return made

    def observe_one(self, around: Surrounded, place: RoutePlace, guide: RouteGuide) -> Observed:
        """Return the observation of one vehicle, by part."""
        seen = self.observe([around], [place], [guide])
        return {part: values[0] for part, values in seen.items()}

    def _route(self, own: Array, places: Sequence[RoutePlace],
               guides: Sequence[RouteGuide]) -> Array:
        points = np.stack([guide.driving.path.pose_at(place.s + self._ahead)
                           for guide, place in zip(guides, places, strict=True)])
        result = np.empty((*points.shape[:2], len(ROUTE_COLUMNS)))
        result[..., 0], result[..., 1] = seen_from(own[:, None], points)
        result[..., 2] = wrap_pi_array(points[..., 2] - own[:, 2, None])
        result[..., 3] = points[..., 3]
        return result

    def _objects(self, own: Array, around: Sequence[Surrounded]) -> Array:
        poses: Array = np.stack([each.poses for each in around])
        velocities, sizes = (np.stack([each.velocities for each in around]),
                             np.stack([each.things.sizes for each in around]))
        rows, wanted = np.arange(len(own))[:, None], self.spec.objects
        result = np.zeros((len(own), wanted, len(OBJECT_COLUMNS)))
        if not poses.shape[1]:
            return result
        apart = poses[:, :, :2] - own[:, None, :2]
        distance = np.einsum('bni,bni->bn', apart, apart)
        # NaN, an absent object, counts as infinitely far.
        distance = np.where(distance <= self.spec.reach ** 2, distance, np.inf)
        nearest = np.argsort(distance, axis=1, kind='stable')[:, :wanted]
        there = np.isfinite(distance[rows, nearest])
        apart, speeds = apart[rows, nearest], velocities[rows, nearest]
        cos, sin = np.cos(own[:, 2, None]), np.sin(own[:, 2, None])
        seen = result[:, :nearest.shape[1]]
        seen[..., 0] = 1.0
        for column, vectors in ((1, apart), (4, speeds)):
            seen[..., column] = vectors[..., 0] * cos + vectors[..., 1] * sin
            seen[..., column + 1] = vectors[..., 1] * cos - vectors[..., 0] * sin
        seen[..., 3] = wrap_pi_array(poses[rows, nearest, 2] - own[:, 2, None])
        seen[..., 6:] = sizes[rows, nearest]
        seen[~there] = 0.0
        return result

    def _ranges(self, around: Sequence[Surrounded]) -> Array:
        result = np.empty((len(around), self.spec.rays))
        for row, each in zip(result, around, strict=True):
            state, bodies = each.state, each.things.bodies
            bodies.poses = each.poses
            x, y = ahead(state.x, state.y, state.yaw, self._to_center)
            scan = self._lidar.scan((x, y, state.yaw), bodies)
            row[:] = np.minimum(scan.ranges, self.spec.horizon)
        return result


class ObservationHistory:
    """
    The observations of the last decisions of one vehicle.

    :param spec: which parts contain how many decisions.
    """

    def __init__(self, spec: ObservationSpec) -> None:
        self._depths = {part: spec.history.of(part) for part in spec.parts
                        if spec.history.of(part) > 1}
        self.begin()

    def begin(self) -> None:
        """Begin an episode or a run."""
        self._kept: dict[str, deque[Numbers]] = {}

    def add(self, seen: Observed) -> Observed:
        """
        Return an observation with those before it, the oldest first.

        The first one of an episode stands in for those that are missing.

        :param seen: parts at this decision.
        """
        whole = dict(seen)
        for part, depth in self._depths.items():
            kept = self._kept.setdefault(part, deque([seen[part]] * depth, depth))
            if kept[-1] is not seen[part]:
                kept.append(seen[part])
            whole[part] = stacked(part, list(kept))
        return whole


def _state(states: Sequence[VehicleState], places: Sequence[RoutePlace]) -> Array:
    return np.array([
        (state.speed, state.acceleration, state.steering_angle, state.yaw_rate, place.d,
         place.heading_error, place.curvature, place.speed_limit, place.goal_distance)
        for state, place in zip(states, places, strict=True)]).reshape(-1, len(STATE_COLUMNS))
