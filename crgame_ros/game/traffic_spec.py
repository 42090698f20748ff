# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The traffic in a game file."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated, ClassVar, Literal

from crgame_ros.schema.declaration import Form
from crgame_ros.schema.marks import Named, Within

MAX_AGENTS = 20_000
MAX_REACTION_TIME = 2.0
Agents = Annotated[int, Within(0, MAX_AGENTS)]
Share = Annotated[float, Within(0.0, 1.0)]
SpeedFactor = Annotated[float, Within(0.1, 3.0)]
ReactionTime = Annotated[float, Within(0.0, MAX_REACTION_TIME)]


@dataclass(frozen=True)
class TrafficSpec:
    """
    Traffic of intelligent agents (FS section III); the defaults place no agent on the road.

    :param recorded: `reactive` turns recorded vehicles that drive on lanes into agents.
    :param agents: number placed on the road at the start.
    :param flow: arrivals at each lane of more than 10 m that begins at the edge of the map
        [vehicles/h]
    :param capacity: maximum number of agents at a time besides the recorded ones; None derives it
        from `agents` and `flow`: at most 300, or `agents` if that is more.
    :param model: car following: acc (FS 3), idm, or a class of your own.
    :param options: of the car-following model.
    :param lane_changes: whether agents change lanes (FS 4).
    :param cooperative: whether agents open a gap for an agent that has to change (Hidas 2005).
    :param swerve: whether agents swerve around standing obstacles (M1).
    :param seed: of everything random here; None takes the game's.
    :param speed_factor: mean of desired speed over speed limit.
    :param speed_spread: its standard deviation between drivers.
    :param truck_share: share of trucks among agents that were not recorded.
    :param lateral_acceleration: comfortable in curves [m/s^2]
    :param politeness: weight of others' loss when changing lanes for speed (MOBIL).
    :param reaction_time: delay between a driver's decision and its execution [s]
    :param imperfection: random deviation of a driver, as a share of its greatest acceleration
        (sigma of Krauss 1998).
    :param red_runners: share of drivers that ignore traffic lights, for tests of AVs.
    :param late_yielders: share of drivers that notice late that they have to yield, for tests of
        AVs.
    """

    FORM: ClassVar[Form] = Form('see docs/traffic.md for the keys', short='recorded',
                                written='changed')

    recorded: Literal['replayed', 'reactive'] = 'replayed'
    agents: Agents = 0
    flow: Annotated[float, Within(0.0, 3600.0)] = 0.0
    capacity: Agents | None = None
    model: Annotated[str, Named()] = 'acc'
    options: Mapping[str, object] = field(default_factory=dict)
    lane_changes: bool = True
    cooperative: bool = True
    swerve: bool = True
    seed: Annotated[int, Within(0, 2**63 - 1)] | None = None
    speed_factor: SpeedFactor = 1.0
    speed_spread: Annotated[float, Within(0.0, 0.5)] = 0.1
    truck_share: Share = 0.1
    lateral_acceleration: Annotated[float, Within(0.5, 6.0)] = 2.0
    politeness: Share = 0.2
    reaction_time: ReactionTime = 0.0
    imperfection: Share = 0.0
    red_runners: Share = 0.0
    late_yielders: Share = 0.0
