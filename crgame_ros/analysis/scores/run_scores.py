# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The scores of a run's vehicles, or why there are none: with or without CommonRoad's tools."""

from collections.abc import Callable, Mapping
from typing import NamedTuple

from crgame_ros.analysis.scores.scored_drives import score_drives
from crgame_ros.analysis.scores.vehicle import VehicleScores
from crgame_ros.errors import CrgameError, one_line
from crgame_ros.recording.recorded_plans import PlanOutcome
from crgame_ros.recording.run_record import RunRecord
from shapely.errors import GEOSException


class RunScores(NamedTuple):
    """
    The scores of a run.

    :param vehicles: scores of each driven vehicle, in the log's order; empty without scores.
    :param refusal: why there are no scores; empty otherwise.
    """

    vehicles: tuple[VehicleScores, ...] = ()
    refusal: str = ''


def scores_of(record: RunRecord, plans: Mapping[str, PlanOutcome], *, drives_only: bool = False,
              progress: Callable[[float], object] = lambda _: None) -> RunScores:
    """
    Score a run as `crgame score` does.

    :param plans: plan records by AV, as far as known.
    :param drives_only: whether to leave out CommonRoad's tools, which take most of the time.
    :param progress: called with the share done so far, 0 to 1.
    """
    try:
        if drives_only:
            return RunScores(score_drives(record.log, plans=plans, put_back=record.put_back))
        # The checker takes a second to import.
        from crgame_ros.analysis.scores.scored_run import score_run
        return RunScores(score_run(record, plans=plans, progress=progress).vehicles)
    except (CrgameError, ValueError, GEOSException) as error:
        # States from another publisher may have no outlines, and cannot be exported.
        return RunScores((), one_line(str(error)))
