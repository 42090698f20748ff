# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Measures an AV's encounter with the recorded human."""

from functools import cached_property

from crgame_ros.analysis.counterfactual import Alternative
from crgame_ros.geometry.curve import Curve
from crgame_ros.recording.run_trajectories import RunTrajectories
from crgame_ros.roads.network import RoadNetwork
from crgame_ros.scenario.loading import parse_scenario
from crgame_ros.vehicle.state import StateColumn
import numpy as np
from numpy.typing import NDArray

# Length to which the lane is followed [m]: longer than any game.
_ALONG = 2000.0
# A vehicle stands below this speed [m/s], and has passed another with this lead [m].
_STANDING, _PASSED = 0.1, 8.0


class DrivenLane:
    """
    The lane of a vehicle's start and its straightest continuation.

    :param log: a run.
    :param vehicle: index of the vehicle among the driven ones.
    :ivar width: width of the lane at the start [m]
    :ivar along: (K, V) arc lengths of the rear axles [m]
    :ivar across: (K, V) their lateral offsets from the centre line, left positive [m]
    :raises InputError: if the scenario in the log cannot be used.
    """

    def __init__(self, log: RunTrajectories, vehicle: int) -> None:
        loaded = parse_scenario(log.xml_text, '/scenario/xml')
        roads = RoadNetwork(loaded.scenario.lanelet_network)
        x, y, yaw = log.vehicle_states[0, vehicle, :StateColumn.YAW + 1].tolist()
        lanelet = roads.nearest_lanelet(x, y, yaw)
        self.width = roads.width_at(lanelet, roads.locate(lanelet, x, y)[0])
        line = Curve.from_polyline(roads.lane_path(lanelet, _ALONG))
        places = log.vehicle_states[:, :, :StateColumn.YAW]
        along, across = line.project(places.reshape(-1, 2))
        self.along: NDArray[np.float64] = along.reshape(places.shape[:2])
        self.across: NDArray[np.float64] = across.reshape(places.shape[:2])


FloatArray = NDArray[np.float64]


class Encounter:
    """
    The behaviour of one AV in a run with one human.

    :param alternative: the run.
    :param av: id of the AV.
    """

    def __init__(self, alternative: Alternative, av: str) -> None:
        self.alternative = alternative
        self.av = av
        ids = [item.id for item in alternative.log.vehicles]
        self._place = ids.index(av)
        self.human = ids[0]

    @cached_property
    def lane(self) -> DrivenLane:
        """Return the lane in which the AV started."""
        return DrivenLane(self.alternative.log, self._place)

    @property
    def speeds(self) -> FloatArray:
        """Return the speeds of the AV (K) [m/s]."""
        return self.alternative.log.vehicle_states[:, self._place, StateColumn.SPEED]

    @property
    def deviation(self) -> float:
        """Return the greatest distance of the AV's rear axle from its lane's centre line [m]."""
        return float(np.abs(self.lane.across[:, self._place]).max())

    @property
    def lead(self) -> float:
        """Return the AV's lead over the human at the end, by rear axles along the lane [m]."""
        last = self.lane.along[-1]
        return float(last[self._place] - last[0])

    @cached_property
    def steps(self) -> tuple[int, int]:
        """
        Return the rows of the encounter: from the human's cut-in to the AV's answer.

        It begins when the human's rear axle enters the AV's lane, and ends when the AV stands or
        is ahead again; without either it is the whole run.
        """
        inside = np.abs(self.lane.across[:, 0]) < 0.5 * self.lane.width
        begin = int(np.argmax(inside))
        lead = self.lane.along[:, self._place] - self.lane.along[:, 0]
        answered = (self.speeds < _STANDING) | (lead > _PASSED)
        answered[:begin] = False
        return begin, int(np.argmax(answered)) if answered.any() else len(answered) - 1

    @property
    def least_gap(self) -> float | None:
        """Return the smallest bumper-to-bumper gap to the human ahead; None: never behind [m]."""
        return self._worst('gap')

    @property
    def least_distance(self) -> float | None:
        """Return the smallest distance of the outlines of AV and human; None: never near [m]."""
        return self._worst('min_distance')

    @property
    def contacts(self) -> int | None:
        """Return the number of contacts of the AV; None if it is unknown."""
        found = self.alternative.contacts
        return None if found is None else sum(
            self.av in (item['vehicle'], item['with']) for item in found)

    def as_dict(self) -> dict[str, float | int | str | None]:
        """Return the numbers as a JSON-compatible dictionary."""
        return {
            'av': self.av, 'final_speed': float(self.speeds[-1]),
            'least_speed': float(self.speeds.min()), 'lane_deviation': self.deviation,
            'lane_width': self.lane.width, 'final_lead': self.lead,
            'least_gap': self.least_gap, 'least_distance': self.least_distance,
            'contacts': self.contacts}

    def _worst(self, measure: str) -> float | None:
        report = self.alternative.criticality.report()
        worst = next(item for item in report if item.vehicle_id == self.av).worst.get(measure)
        return worst.value if worst is not None and worst.other == self.human else None


def human_states(log: RunTrajectories) -> FloatArray:
    """Return the published states (K, H, 8) of the humans."""
    return log.published_states[:, :len(log.game.humans)]
