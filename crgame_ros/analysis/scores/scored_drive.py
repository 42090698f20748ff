# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The motion of one vehicle among others, from which closed-loop scores are computed."""

from collections.abc import Sequence
from dataclasses import dataclass
import functools
from typing import Literal, TypeAlias

from crgame_ros.game.objects import ObjectDescription, Role
from crgame_ros.geometry.outline import outline, placed
from crgame_ros.geometry.reference_point import shifted
from crgame_ros.geometry.shape import Shape
from crgame_ros.recording.run_trajectories import RunTrajectories
from crgame_ros.scenario.loading import LoadedScenario
from crgame_ros.scenario.obstacles import ScenarioObstacles
from crgame_ros.vehicle.state import StateColumn
import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
TrackKind: TypeAlias = Literal['vehicle', 'vulnerable', 'object']

# CommonRoad's obstacle types that nuPlan counts as vulnerable road users, and as objects.
VULNERABLE = frozenset({'pedestrian', 'bicycle'})
OBJECTS = frozenset({'constructionZone', 'roadBoundary', 'building', 'pillar', 'median_strip'})


@dataclass(frozen=True)
class Track:
    """
    The motion of another vehicle, person or object.

    :param id: its name in the run, `o<id>` of a scenario's obstacle.
    :param kind: as nuPlan groups them.
    :param shape: footprint around the centre.
    :param poses: (K, 3) its centre's x [m], y [m], yaw [rad]; NaN where absent.
    :param speeds: (K) speeds of its centre, never negative [m/s]; NaN where absent.
    """

    id: str  # noqa: A003
    kind: TrackKind
    shape: Shape
    poses: FloatArray
    speeds: FloatArray


@dataclass(frozen=True)
class ScoredDrive:
    """
    A vehicle's motion at K equal time steps, in the coordinates of the road.

    :param dt_s: time between the steps [s]
    :param shape: footprint around the centre.
    :param rear_to_center: from the rear axle forward to the centre [m]
    :param poses: (K, 3) the centre's x [m], y [m], yaw [rad]
    :param speeds: (K) speeds of the rear axle, negative backwards [m/s]
    :param tracks: all others.
    """

    vehicle_id: str
    dt_s: float
    shape: Shape
    rear_to_center: float
    poses: FloatArray
    speeds: FloatArray
    tracks: tuple[Track, ...] = ()

    @property
    def duration_s(self) -> float:
        """Return the time from the first step to the last [s]."""
        return (len(self.poses) - 1) * self.dt_s

    @functools.cached_property
    def rear_axles(self) -> FloatArray:
        """Return poses (K, 3) of the rear axle."""
        return shifted(self.poses, -self.rear_to_center)

    @functools.cached_property
    def outlines(self) -> FloatArray:
        """Return corners (K, C, 2) of the footprint [m]; of a rectangle FL, RL, RR, FR."""
        return placed(outline(self.shape), self.poses)


def kind_of_type(type_name: str) -> TrackKind:
    """Return nuPlan's group of an obstacle type of CommonRoad (XML spelling); unknown: vehicle."""
    return 'vulnerable' if type_name in VULNERABLE else 'object' if type_name in OBJECTS \
        else 'vehicle'


def drive_of(log: RunTrajectories, vehicle: int) -> ScoredDrive:
    """Return a vehicle's drive from a run, by its number among the driven ones."""
    offsets = np.array([item.rear_to_center for item in log.vehicles])
    centers = shifted(log.vehicle_states[:, :, :3], offsets)
    poses = np.concatenate((centers, log.object_poses), axis=1)
    if not (transform := log.road_transforms[vehicle]).is_identity:
        # In the coordinates of its road.
        poses = transform.to_scenario(poses)
    speeds = log.vehicle_states[:, :, StateColumn.SPEED]
    others = np.hypot(log.object_velocities[..., 0], log.object_velocities[..., 1])
    everybody = np.concatenate((np.abs(speeds), others), axis=1)
    item = log.vehicles[vehicle]
    return ScoredDrive(
        item.id, log.game.scheduler.time_step_s, item.shape, item.rear_to_center,
        poses[:, vehicle], speeds[:, vehicle],
        _tracks((*log.vehicles, *log.objects), poses, everybody, vehicle))


def drive_among(vehicle_id: str, shape: Shape, rear_to_center: float, poses: FloatArray,
                speeds: FloatArray, first_k: int, loaded: LoadedScenario,
                without: Sequence[int] = ()) -> ScoredDrive:
    """
    Build a drive from a motion and the obstacles of a scenario.

    :param poses: (K, 3) poses of the centre at consecutive time steps.
    :param speeds: (K) speeds of the rear axle [m/s]
    :param first_k: time step of the first pose.
    :param without: ids of obstacles to leave out.
    :raises InputError: if the obstacles cannot be used.
    """
    obstacles = ScenarioObstacles(loaded, without)
    states = [obstacles.states_at(first_k + row) for row in range(len(poses))]
    shapes = (len(poses), len(obstacles.ids), 3)
    places = np.array([state.poses for state in states]).reshape(shapes)
    moves = np.array([state.velocities for state in states]).reshape(shapes)
    tracks = _tracks(obstacles.descriptions, places, np.hypot(moves[..., 0], moves[..., 1]))
    return ScoredDrive(vehicle_id, loaded.time_step_s, shape, rear_to_center, poses, speeds,
                       tracks)


def _tracks(descriptions: Sequence[ObjectDescription], poses: FloatArray, speeds: FloatArray,
            without: int = -1) -> tuple[Track, ...]:
    return tuple(
        Track(item.id, kind_of_type(item.type), item.shape, poses[:, column],
              np.zeros(len(poses)) if item.role is Role.STATIC else speeds[:, column])
        for column, item in enumerate(descriptions)
        if column != without and np.isfinite(poses[:, column, 0]).any())
