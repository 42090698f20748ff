# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A run that becomes rows of the tables, and what is known of it only once it was measured."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

from crgame_ros.analysis.behaviour.driver_behaviour import measure_behaviour
from crgame_ros.analysis.behaviour.vehicle_behaviour import DriverBehaviour
from crgame_ros.analysis.criticality.criticality import VehicleCriticality
from crgame_ros.analysis.scores.vehicle_scores import VehicleScores
from crgame_ros.game.driven_vehicle import DrivenVehicle
from crgame_ros.recording.recorded_plans import RecordedPlan
from crgame_ros.recording.run_record import RunRecord
import numpy as np
from numpy.typing import NDArray


@dataclass
class PlanTally:
    """What was counted of an AV's plans: answers, and those that pass the engine's check."""

    answers: int = 0
    passing: int = 0
    checked: int = 0
    latencies_s: list[float] = field(default_factory=list)


@dataclass
class TabulatedRun:
    """
    A run to tabulate.

    :param id: that is in every row.
    :param record: how everybody moved, what drivers did, and events.
    :param timing: as `recording.timing_report` gives it; None where nobody measured it.
    :param plans: gives the recorded plans, one by one; None where they were not recorded.
    :param offline: of an offline run what `offline_outcome` gives; None otherwise.
    :param scored: whether its vehicles are scored, which takes most of the time.
    :ivar criticality: by vehicle, once `pairs` has been written.
    :ivar tallies: by AV, once `plans` has been written.
    :ivar scores: by vehicle, once it has been scored.
    :ivar remarks: what could not be had of it, one line each.
    """

    id: str  # noqa: A003
    record: RunRecord
    timing: Mapping[str, Any] | None = None
    plans: Callable[[], Iterable[RecordedPlan]] | None = None
    offline: Mapping[str, Any] | None = None
    scored: bool = True
    criticality: dict[str, VehicleCriticality] = field(default_factory=dict)
    tallies: dict[str, PlanTally] = field(default_factory=dict)
    scores: dict[str, VehicleScores] = field(default_factory=dict)
    remarks: list[str] = field(default_factory=list)

    @property
    def outcome(self) -> Mapping[str, Any] | None:
        """Return plans, violations and contacts as `timing.json` has them; None: nobody knows."""
        return self.timing if self.offline is None else self.offline

    @cached_property
    def behaviour(self) -> tuple[DriverBehaviour, ...]:
        """Measure how each vehicle was driven, in the order of the log's."""
        return measure_behaviour(self.record)

    @property
    def driven(self) -> tuple[DrivenVehicle, ...]:
        """Return the driven vehicles, as the game has them, in the order of the log's."""
        game = {item.id: item for item in self.record.log.game.vehicles}
        return tuple(game[item.id] for item in self.record.log.vehicles)

    def steps_of(self, ks: NDArray[np.int64]) -> NDArray[np.int64]:
        """Return the simulation steps n of scenario steps k."""
        scheduler = self.record.log.game.scheduler
        return np.asarray((ks - scheduler.k0) * scheduler.steps_per_tick)

    def times_s(self, ks: NDArray[np.int64]) -> NDArray[np.float64]:
        """Return the times of scenario steps k since the run's start, alike in all tables [s]."""
        return np.asarray(self.steps_of(ks) * self.record.log.game.scheduler.dt_s)
