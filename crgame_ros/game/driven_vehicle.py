# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The driven vehicles of a run, as in `/scenario/game`."""

from dataclasses import dataclass, field
import re
from typing import Annotated, Literal

from annotated_types import Predicate
from crgame_ros.game.game import AvSpec, ModelSpec, TrackerSpec
from crgame_ros.game.perception_spec import PerceptionSpec
from crgame_ros.geometry.rigid_transform import RigidTransform
from crgame_ros.schema.document_marks import Declared, Row
from crgame_ros.vehicle.parameters import VehicleParameters
from crgame_ros.vehicle.state import VehicleState

VEHICLE_ID = re.compile(r'(hv|av)[0-9]{1,3}')
VehicleId = Annotated[str, Predicate(VEHICLE_ID.fullmatch)]


@dataclass(frozen=True)
class DrivenVehicle:
    """
    The common fields of humans' vehicles and AVs.

    :param id: hv0, av0, …
    :param vehicle: its parameters.
    :param state: initial state of the rear axle, in frame map.
    """

    id: VehicleId  # noqa: A003
    vehicle: VehicleParameters
    state: Annotated[VehicleState, Row()]


@dataclass(frozen=True)
class DrivenHuman(DrivenVehicle):
    """
    A human's vehicle.

    :param driver: source of its commands, as in a game file.
    :param timeline: text of the timeline that it plays, empty without one.
    :param dynamics: the model that moves it; None is the KS model of CRG 2-4.
    """

    driver: str
    timeline: str = ''
    dynamics: Annotated[ModelSpec, Declared()] | None = None


@dataclass(frozen=True)
class DrivenAv(DrivenVehicle):
    """
    An AV; what is not described here is as in a game file.

    :param options: of the planner.
    :param planning_problem: id of its planning problem.
    :param transform: from simulation to the scenario coordinates in which it plans (CRG 9).
    :param perception: how it perceives the world; None is perfectly.
    """

    planner: str
    options: dict[str, object] = field(default_factory=dict)
    planning_problem: int = 0
    transform: Annotated[RigidTransform, Row()] = RigidTransform()
    execution: Literal['perfect', 'tracked'] = AvSpec.execution
    tracker: Annotated[TrackerSpec, Declared()] = AvSpec.tracker
    dynamics: Annotated[ModelSpec, Declared()] = AvSpec.dynamics
    perception: Annotated[PerceptionSpec, Declared()] | None = None
