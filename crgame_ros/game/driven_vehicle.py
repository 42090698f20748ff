# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The driven vehicles of a run, as in `/scenario/game`."""

from collections.abc import Mapping
from dataclasses import dataclass, field
import math
import re
from typing import Annotated, Any

from annotated_types import Predicate
from crgame_ros.game.perception_spec import PerceptionSpec
from crgame_ros.geometry.rigid_transform import RigidTransform
from crgame_ros.schema.reading import read
from crgame_ros.vehicle.parameters import VehicleParameters
from crgame_ros.vehicle.state import STATE_WIDTH, VehicleState

# Parameters of a vehicle that are not numbers.
TEXTS = ('name', 'steering_ratio', 'type', 'powertrain')
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

    id: str  # noqa: A003
    vehicle: VehicleParameters
    state: VehicleState


@dataclass(frozen=True)
class DrivenHuman(DrivenVehicle):
    """
    A human's vehicle.

    :param driver: source of its commands, as in a game file.
    :param timeline: text of the timeline that it plays, empty without one.
    :param dynamics: name and options of the model that moves it; None is that of CRG 2-4.
    """

    driver: str = ''
    timeline: str = ''
    dynamics: Mapping[str, Any] | None = None


@dataclass(frozen=True)
class DrivenAv(DrivenVehicle):
    """
    An AV.

    :param planner: name of its planner.
    :param options: of the planner.
    :param planning_problem: id of its planning problem.
    :param transform: from simulation to the scenario coordinates in which it plans (CRG 9).
    :param perception: how it perceives the world; None is perfectly.
    """

    planner: str = ''
    options: Mapping[str, Any] = field(default_factory=dict)
    planning_problem: int = 0
    transform: RigidTransform = RigidTransform()
    perception: PerceptionSpec | None = None


def read_human(entry: Mapping[str, Any]) -> DrivenHuman:
    """
    Read an entry of `humans`.

    :raises InputError: or one of `MALFORMED`, if it is malformed.
    """
    return DrivenHuman(**_common(entry), driver=str(entry['driver']),
                       timeline=str(entry.get('timeline') or ''), dynamics=entry.get('dynamics'))


def read_av(entry: Mapping[str, Any]) -> DrivenAv:
    """
    Read an entry of `avs`.

    :raises InputError: or one of `MALFORMED`, if it is malformed.
    """
    perception = entry.get('perception')
    return DrivenAv(
        **_common(entry), planner=str(entry['planner']), options=dict(entry['options']),
        planning_problem=int(entry['planning_problem']),
        transform=RigidTransform(*_finite(entry['transform'])),
        perception=None if perception is None else read(
            PerceptionSpec, perception, '/scenario/game: perception'))


def _common(entry: Mapping[str, Any]) -> dict[str, Any]:
    name = entry['id']
    if not VEHICLE_ID.fullmatch(name):
        raise ValueError(f'{str(name)[:40]!r} is no id of a vehicle')
    state = _finite(entry['state'])
    if len(state) != STATE_WIDTH:
        raise ValueError(f'{name} has no state of {STATE_WIDTH} numbers')
    # JSON has no infinity: null means no limit.
    parameters: dict[str, Any] = {
        str(key): str(value) if key in TEXTS else math.inf if value is None else float(value)
        for key, value in entry['vehicle'].items()}
    return {'id': name, 'vehicle': VehicleParameters(**parameters), 'state': VehicleState(*state)}


def _finite(values: Any) -> list[float]:
    numbers = [float(value) for value in values]
    if not all(map(math.isfinite, numbers)):
        raise ValueError('a number is not finite')
    return numbers
