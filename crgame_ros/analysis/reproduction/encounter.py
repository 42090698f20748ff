# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""An AV's encounter with the recorded human, in numbers."""

from functools import cached_property

from crgame_ros.analysis.counterfactual import Alternative
from crgame_ros.analysis.reproduction.driven_lane import DrivenLane
from crgame_ros.recording.run_log import RunLog
from crgame_ros.vehicle.state import StateColumn
import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


class Encounter:
    """
    What one AV did in a run with one human.

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
        """Find the lane in which the AV began."""
        return DrivenLane(self.alternative.log, self._place)

    @property
    def speeds(self) -> FloatArray:
        """Speeds of the AV (K) [m/s]."""
        return self.alternative.log.vehicle_states[:, self._place, StateColumn.SPEED]

    @property
    def deviation(self) -> float:
        """How far the AV's rear axle came from the middle of its lane [m]."""
        return float(np.abs(self.lane.across[:, self._place]).max())

    @property
    def lead(self) -> float:
        """How far the AV's rear axle is ahead of the human's at the end, along the lane [m]."""
        last = self.lane.along[-1]
        return float(last[self._place] - last[0])

    @property
    def least_gap(self) -> float | None:
        """Return the smallest gap to the human ahead, by bumpers; None: never behind it [m]."""
        return self._worst('gap')

    @property
    def least_distance(self) -> float | None:
        """Return the smallest distance of the outlines of AV and human; None: never near [m]."""
        return self._worst('min_distance')

    @property
    def contacts(self) -> int | None:
        """Contacts in which the AV had a part; None where they are not known."""
        found = self.alternative.contacts
        return None if found is None else sum(
            self.av in (item['vehicle'], item['with']) for item in found)

    def as_dict(self) -> dict[str, float | int | str | None]:
        """Return the numbers as JSON has them."""
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


def human_states(log: RunLog) -> FloatArray:
    """Return the states of the humans as they were published (K, H, 8)."""
    return log.published_states[:, :len(log.game.humans)]
