# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What became of an AV's plan requests and plans, recorded or offline."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, fields
from typing import Any

from crgame_ros.simulation.offline import OfflineResult, PlannerRecord
import numpy as np
from numpy.typing import NDArray

Spread = Mapping[str, float]
# The engine's counts in a status `sim_node: <av> plans`.
PLAN_COUNTS = ('requests', 'accepted', 'refused', 'of_others', 'skipped', 'timed_out', 'realigned',
               'steps_without_plan')


@dataclass(frozen=True)
class PlanOutcome:
    """
    What became of an AV's plans: its entry in `timing.json`; None for what was not recorded.

    :param requests: plan requests.
    :param accepted: plans that were accepted, with braking plans.
    :param refused: plans that were refused.
    :param of_others: answers of other programs than its planner.
    :param skipped: requests left out while one was open.
    :param timed_out: requests that were not answered in time.
    :param realigned: plans that were aligned to where the AV was.
    :param steps_without_plan: simulation steps without a plan to follow.
    :param last_refusal: reason of the last refusal of a plan.
    :param plans: answers.
    :param fallback: braking plans sent because the planner failed.
    :param fallback_reasons: their number by reason.
    :param plan_time_ms: p50, p99 and max of the planner's own time.
    :param latency_ms: the same from request to plan.
    :param first_latency_ms: of the first plan, for which the run waits.
    :param age_ms: the same of the plan in use.
    :param worst_tracking_errors: of a tracked AV by name [m], [rad], [m/s]; None for an AV that
        follows its plans exactly.
    """

    requests: int | None = None
    accepted: int | None = None
    refused: int | None = None
    of_others: int | None = None
    skipped: int | None = None
    timed_out: int | None = None
    realigned: int | None = None
    steps_without_plan: int | None = None
    last_refusal: str | None = None
    plans: int = 0
    fallback: int | None = None
    fallback_reasons: Mapping[str, int] | None = None
    plan_time_ms: Spread | None = None
    latency_ms: Spread | None = None
    first_latency_ms: float | None = None
    age_ms: Spread | None = None
    worst_tracking_errors: Mapping[str, float] | None = None

    @classmethod
    def of_entry(cls, entry: Mapping[str, Any]) -> 'PlanOutcome':
        """Read an entry of `timing.json`."""
        return cls(**{field.name: entry[field.name] for field in fields(cls)
                      if field.name in entry})

    @classmethod
    def of_record(cls, record: PlannerRecord) -> 'PlanOutcome':
        """
        Describe an AV of an offline run.

        A planner answers after a stated number of steps, so there is no latency to measure.
        """
        counters, statistics = record.counters, record.statistics
        tracking = None
        if record.tracking is not None:
            tracking = dict(record.tracking._asdict())
            if record.lane_error is not None:
                tracking['lane'] = record.lane_error
        return cls(
            **{name: getattr(counters, name) for name in PLAN_COUNTS},
            last_refusal=counters.last_refusal or None, plans=statistics.plans,
            fallback=statistics.fallbacks, fallback_reasons=dict(statistics.reasons) or None,
            plan_time_ms=spread_of([1e3 * each for each in statistics.durations_s]),
            worst_tracking_errors=tracking)

    def as_dict(self) -> dict[str, object]:
        """Return its entry in `timing.json`."""
        return asdict(self)

    @property
    def driven(self) -> int:
        """Return how many plans were accepted, without those that braked for failures."""
        return max(0, (self.accepted or 0) - (self.fallback or 0))

    @property
    def due(self) -> int:
        """Return how many requests were decided; the last one of a run may have no answer yet."""
        return sum(count or 0 for count in (self.accepted, self.refused, self.timed_out))

    @property
    def accepted_share(self) -> float | None:
        """Return the share of answers that were accepted and no fallback; None if unknown."""
        known = self.accepted is not None and self.plans
        return self.driven / self.plans if known else None

    @property
    def trouble(self) -> str:
        """Return why no plan was driven: the most frequent failure, or the last refusal."""
        reasons = self.fallback_reasons or {}
        if reasons:
            return max(reasons, key=lambda each: reasons[each])
        if self.refused:
            return f'answered, but refused {self.refused} times: {self.last_refusal}'
        return 'it never answered'


def plans_of_report(report: Mapping[str, Any] | None) -> dict[str, PlanOutcome]:
    """
    Return the entries by AV.

    :param report: content of `timing.json`, or from `offline_outcome`; None if there is none.
    """
    return {} if report is None else {
        av: PlanOutcome.of_entry(entry) for av, entry in report['planners'].items()}


def plans_of_result(result: OfflineResult) -> dict[str, PlanOutcome]:
    """Return the entries of an offline run by AV."""
    return {av: PlanOutcome.of_record(record) for av, record in result.planners.items()}


def spread_of(samples: Sequence[float] | NDArray[np.float64]) -> dict[str, float] | None:
    """Return median, 99th percentile and maximum; None without samples."""
    values = np.array(samples)
    if not len(values):
        return None
    return {'p50': float(np.percentile(values, 50)), 'p99': float(np.percentile(values, 99)),
            'max': float(values.max())}
