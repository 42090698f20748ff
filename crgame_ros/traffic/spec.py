# Copyright 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What a game file says about traffic."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields
import math
from pathlib import Path
from typing import Any, Literal

from crgame_ros.errors import InputError
from crgame_ros.scenario.checked_values import build, named_file

MAX_AGENTS = 20_000
# Lower and upper bounds of the numbers below.
BOUNDS: dict[str, tuple[float, float]] = {
    'agents': (0, MAX_AGENTS), 'flow': (0.0, 3600.0), 'capacity': (0, MAX_AGENTS),
    'speed_factor': (0.1, 3.0), 'speed_spread': (0.0, 0.5), 'truck_share': (0.0, 1.0),
    'lateral_acceleration': (0.5, 6.0), 'politeness': (0.0, 1.0), 'seed': (0, 2**63 - 1),
    'reaction_time': (0.0, 2.0), 'imperfection': (0.0, 1.0), 'red_runners': (0.0, 1.0),
    'late_yielders': (0.0, 1.0)}


@dataclass(frozen=True)
class TrafficSpec:
    """
    Traffic of intelligent agents (FS section III); the defaults put nobody on the road.

    :param recorded: `reactive` turns recorded vehicles that drive on lanes into agents.
    :param agents: how many are placed on the road at the start.
    :param flow: arrivals at each lane that begins at the edge of the map [vehicles/h]
    :param capacity: most agents at a time besides the recorded ones; None takes what `agents` and
        `flow` want, at most 300.
    :param model: car following: acc (FS 3), idm, or a class of your own.
    :param options: of the car-following model.
    :param lane_changes: whether agents change lanes (FS 4).
    :param cooperative: whether agents make room for one that has to change (Hidas 2005).
    :param swerve: whether agents swerve around standing obstacles (M1).
    :param seed: of everything random here; None takes the game's.
    :param speed_factor: mean of desired speed over speed limit.
    :param speed_spread: its standard deviation between drivers.
    :param truck_share: share of trucks among agents that were not recorded.
    :param lateral_acceleration: comfortable in curves [m/s^2]
    :param politeness: weight of others' loss when changing lanes for speed (MOBIL).
    :param reaction_time: after which a driver does what it has decided [s]
    :param imperfection: random share of its greatest acceleration by which a driver fails to do so
        (sigma of Krauss 1998).
    :param red_runners: share of drivers who ignore traffic lights, for tests of AVs.
    :param late_yielders: share of drivers who see late that they have to yield, for tests of AVs.
    """

    recorded: Literal['replayed', 'reactive'] = 'replayed'
    agents: int = 0
    flow: float = 0.0
    capacity: int | None = None
    model: str = 'acc'
    options: Mapping[str, Any] = field(default_factory=dict)
    lane_changes: bool = True
    cooperative: bool = True
    swerve: bool = True
    seed: int | None = None
    speed_factor: float = 1.0
    speed_spread: float = 0.1
    truck_share: float = 0.1
    lateral_acceleration: float = 2.0
    politeness: float = 0.2
    reaction_time: float = 0.0
    imperfection: float = 0.0
    red_runners: float = 0.0
    late_yielders: float = 0.0

    def __post_init__(self) -> None:
        """Refuse numbers out of bounds."""
        for name, (low, high) in BOUNDS.items():
            value = getattr(self, name)
            if value is not None and not (math.isfinite(value) and low <= value <= high):
                raise InputError(f'"{name}" is {value}', 'traffic',
                                 f'give a number from {low:g} to {high:g}')

    @property
    def is_reactive(self) -> bool:
        """Tell whether there can be any agent."""
        return self.recorded == 'reactive' or self.agents > 0 or self.flow > 0.0


def parse_traffic(values: Any, where: str, base: Path) -> TrafficSpec:
    """
    Build the set-up from what YAML gave; `reactive` is short for `{recorded: reactive}`.

    :param where: what to name in messages.
    :param base: directory that a model of the user's own is relative to.
    :raises InputError: for an unknown key, a wrong type, a number out of bounds.
    """
    if values is None:
        values = {}
    if isinstance(values, str):
        values = {'recorded': values}
    if isinstance(values, Mapping) and isinstance(values.get('model'), str):
        values = {**values, 'model': named_file(values['model'], base)}
    try:
        return build(TrafficSpec, values, where)
    except InputError as error:
        raise InputError(error.what, where, error.remedy) from error


def traffic_entry(spec: TrafficSpec) -> dict[str, Any]:
    """Write the set-up as `parse_traffic` reads it, without what is at its default."""
    values = asdict(spec)
    default = TrafficSpec()
    return {item.name: values[item.name] for item in fields(spec)
            if values[item.name] != getattr(default, item.name)}
