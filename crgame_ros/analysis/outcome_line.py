# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A run in one line, and the AVs whose planners never drove; alike live, offline and replayed."""

from collections.abc import Callable, Sequence
import math

from crgame_ros.analysis.criticality.criticality import Criticality, MEASURES
from crgame_ros.analysis.scores.vehicle import VehicleScores
from crgame_ros.recording.recorded_plans import plans_of_report, RunReport
from crgame_ros.timing.metrics import slowness

# Exit code of a run in which no plan of some planner was driven.
NO_PLANS = 3


def tell_outcome(say: Callable[[str], object], outcome: RunReport,
                 criticality: Criticality | None, name: str = '',
                 scores: Sequence[VehicleScores] = ()) -> int:
    """
    Tell of a run, as the last lines about it.

    :param name: of the run, before its line.
    :return: `NO_PLANS` if some planner drove none of its plans, else 0.
    """
    failed = undriven(outcome)
    for line in failed:
        say(f'error: {line}')
    say(name + outcome_line(outcome, criticality, scores))
    return NO_PLANS if failed else 0


def outcome_line(outcome: RunReport, criticality: Criticality | None = None,
                 scores: Sequence[VehicleScores] = ()) -> str:
    """
    Return contacts, least TTC, driven plans, scores and the real-time ratio of a run.

    :param outcome: content of `timing.json`, or result of `offline_outcome`.
    """
    contacts = outcome['contacts']
    parts = [] if contacts is None else [_counted(len(contacts), 'contact')]
    found = () if criticality is None else criticality.report()
    ttc = MEASURES['ttc']
    least = min((each.worst['ttc'].value for each in found if 'ttc' in each.worst),
                default=math.inf)
    if ttc.matters(least):
        parts.append(f'{ttc.extreme} {least:.2f} s')
    plans = plans_of_report(outcome).values()
    due = sum(found.due for found in plans)
    if due:
        driven = sum(found.driven for found in plans)
        parts.append(f'{driven} of {_counted(due, "plan")} accepted')
    scored = [f'{each.vehicle_id} {each.nuplan.score:.2f}' for each in scores
              if each.nuplan is not None]
    if scored:
        parts.append(f'nuPlan score {", ".join(scored)}')
    if (ratio := outcome.get('real_time_ratio')) is not None:
        parts.append(slowness(ratio['final']) or f'real-time ratio {ratio["final"]:.3f}')
    return ', '.join(parts)


def undriven(outcome: RunReport) -> list[str]:
    """Return one line for each AV that drove none of its planner's plans, with the reason."""
    return [f'{av}: no plan of its planner was driven: {found.trouble}'
            for av, found in plans_of_report(outcome).items()
            if found.requests and not found.driven]


def _counted(count: int, what: str) -> str:
    return f'{count} {what}' if count == 1 else f'{count} {what}s'
