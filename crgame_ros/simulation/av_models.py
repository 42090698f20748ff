# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Builds an AV's plan execution and perception from the game file."""

from collections.abc import Sequence

from crgame_ros.control.tracked_execution import TrackedExecution
from crgame_ros.control.tracker import TRACKERS
from crgame_ros.errors import InputError
from crgame_ros.game.game import AvSpec, ModelSpec
from crgame_ros.game.objects import ObjectDescription, Role
from crgame_ros.geometry.rigid_transform import RigidTransform
from crgame_ros.messages.joints import JointSeries, vehicle_to_joints, vehicles_from_joints
from crgame_ros.perception.localisation import Localisation
from crgame_ros.perception.perception import Perception
from crgame_ros.vehicle.models import VEHICLE_MODELS, VehicleModel
from crgame_ros.vehicle.parameters import VehicleParameters
from crgame_ros.vehicle.state import VehicleState
import numpy as np
from numpy.typing import NDArray

# Time step of models that are built only to check their options [s].
CHECKING_STEP_S = 0.01


def make_vehicle_model(spec: ModelSpec | None, vehicle: VehicleParameters,
                       where: str) -> VehicleModel | None:
    """
    Make a vehicle model.

    :param where: the vehicle, for messages.
    :raises InputError: if there is none of that name, or an option is wrong.
    """
    if spec is None:
        return None
    return VEHICLE_MODELS.create(spec.name, spec.options, where, vehicle=vehicle)


def make_execution(spec: AvSpec, vehicle: VehicleParameters,
                   dt_s: float) -> TrackedExecution | None:
    """
    Build the tracked execution of an AV's plans; None if the AV follows them exactly.

    :raises InputError: if a model cannot be built, or no pose source exists to steer by.
    """
    if spec.execution == 'perfect':
        return None
    if spec.localisation_steers and (
            spec.perception is None or spec.perception.localisation is None):
        raise InputError('"pose" is estimated, but nothing estimates it', f'{spec.id}: tracker',
                         'give the AV a perception with localisation')
    model = make_vehicle_model(spec.dynamics, vehicle, f'{spec.id}: dynamics')
    assert model is not None
    tracker = TRACKERS.create(spec.tracker.model.name, spec.tracker.model.options,
                              f'{spec.id}: tracker', vehicle=vehicle, dt_s=dt_s)
    return TrackedExecution(vehicle, tracker, model, dt_s)


def check_models(avs: Sequence[tuple[AvSpec, VehicleParameters]],
                 humans: Sequence[tuple[str, ModelSpec | None, VehicleParameters]]) -> None:
    """
    Build every model of a game once, so that a wrong one is refused before the run starts.

    :param humans: id, dynamics and vehicle of each.
    :raises InputError: naming the vehicle, the model and the available ones.
    """
    for spec, vehicle in avs:
        make_vehicle_model(spec.dynamics, vehicle, f'{spec.id}: dynamics')
        make_execution(spec, vehicle, CHECKING_STEP_S)
        if spec.perception is not None:
            me = ObjectDescription(spec.id, vehicle.type, Role.AUTONOMOUS, vehicle.shape,
                                   vehicle.rear_to_center)
            Perception(spec.id, spec.perception, [me], vehicle, RigidTransform(),
                       VehicleState(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0), 0, CHECKING_STEP_S)
    for human_id, dynamics, vehicle in humans:
        make_vehicle_model(dynamics, vehicle, f'{human_id}: dynamics')


def make_localisation(spec: AvSpec, initial: VehicleState, game_seed: int,
                      dt_s: float) -> Localisation | None:
    """Build the localisation that a tracker steers by; it equals the perception's own."""
    if not spec.localisation_steers or spec.perception is None \
            or spec.perception.localisation is None:
        return None
    seed = game_seed if spec.perception.seed is None else spec.perception.seed
    return Localisation(spec.perception.localisation, seed, spec.id, published(initial), dt_s)


def published_states(states: Sequence[VehicleState]) -> NDArray[np.float64]:
    """
    Return states (V, 8) of driven vehicles as `/vehicles/state` carries them.

    Both runners pass exactly these bits to perception.
    """
    joints = [np.array(rows) for rows in zip(
        *(vehicle_to_joints(state) for state in states), strict=True)]
    return vehicles_from_joints(*joints)


def published(state: VehicleState) -> VehicleState:
    """Return one vehicle's state as `/vehicles/state` carries it."""
    return VehicleState(*published_states([state])[0].tolist())


def ego_of(request: JointSeries) -> VehicleState:
    """
    Return the state of the AV that a plan request is for, in the AV's scenario coordinates.

    :param request: the request, or only its head: the AV's joints come first.
    """
    state = vehicles_from_joints(request.positions[0, :4], request.velocities[0, :4],
                                 request.accelerations[0, :4])
    return VehicleState(*state.tolist())
