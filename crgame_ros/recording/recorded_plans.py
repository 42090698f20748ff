# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The plans of a run: read one by one with their requests, and what became of them."""

from collections import OrderedDict
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, fields
import math
from pathlib import Path
from typing import Any, NamedTuple, TypedDict

from crgame_ros.errors import InputError
from crgame_ros.messages.cdr import header_stamp_ns
from crgame_ros.messages.joints import (
    from_joint_trajectory,
    plan_from_joints,
    vehicle_joint_names,
    vehicles_from_joints,
)
from crgame_ros.messages.plan import Plan
from crgame_ros.messages.request_layout import request_head
from crgame_ros.recording.epochs import Epoch, read_epoch
from crgame_ros.recording.reader import BagReader
from crgame_ros.recording.storage import BagMessage
from crgame_ros.simulation.autonomous_vehicle import PLAN_COUNTS
from crgame_ros.simulation.contacts import ContactEntry
from crgame_ros.simulation.offline import OfflineResult, PlannerRecord
from crgame_ros.vehicle.state import VehicleState
import numpy as np
from numpy.typing import NDArray

# Number of whole requests kept until they are answered; they are large, and the engine does not
# look further back either.
_KEPT = 64
Spread = Mapping[str, float]
# Of `timing.json`: a violation, all of them, and the whole content but some numbers.
ViolationEntry = TypedDict('ViolationEntry', {  # noqa: UP013
    'n': int | None, 'vehicle': str, 'what': str})
Violations = TypedDict('Violations', {  # noqa: UP013
    'violations': int, 'list': list[ViolationEntry]})
RunReport = TypedDict('RunReport', {  # noqa: UP013
    'planners': dict[str, dict[str, object]], 'drivability': Violations,
    'contacts': list[ContactEntry] | None, 'notices': list[str], 'max_cumulative_error_ms': float,
    'real_time_ratio': dict[str, float], 'late_steps': Mapping[str, object] | None,
    'sound': Mapping[str, Mapping[str, Any]], 'view': Mapping[str, Sequence[Mapping[str, Any]]],
}, total=False)


class RecordedPlan(NamedTuple):
    """
    A recorded answer of a planner.

    :param av: id of the AV.
    :param stamp_ns: of the request that it answers [ns]
    :param k: scenario step of that request; None if the stamp belongs to no step.
    :param latency_s: log time between the last sending of the request and this first answer to
        it; NaN for every further answer, and if the request was not recorded [s]
    :param plan: in the AV's scenario coordinates; None if the answer was malformed.
    :param fault: why it was malformed, else empty.
    :param told: the AV's state in the request, in the same coordinates; None if the request was
        not recorded.
    """

    av: str
    stamp_ns: int
    k: int | None
    latency_s: float
    plan: Plan | None
    fault: str
    told: VehicleState | None


def read_plans(path: Path, epoch: int | None = None,
               progress: Callable[[float], object] | None = None) -> Iterator[RecordedPlan]:
    """
    Read the plans of a run in the order in which they were recorded, without keeping them.

    :param path: a recording, finished or cut off.
    :param epoch: which run, where a recording holds several; None for the last.
    :param progress: called with the share of the recording that has been read, 0 to 1.
    :raises InputError: if the recording lacks its documents, or is damaged inside.
    """
    with BagReader(path, parts=True, progress=progress) as reader:
        run = read_epoch(reader, epoch)
        requests = {f'/{av.id}/plan_request': av.id for av in run.game.avs}
        plans = {f'/{av.id}/plan': av.id for av in run.game.avs}
        # By AV and stamp: the log times of open requests [ns], and the last requests themselves.
        sent_ns: dict[tuple[str, int], int] = {}
        kept = OrderedDict[tuple[str, int], BagMessage]()
        for message in reader.messages((*requests, *plans)):
            stamp_ns = header_stamp_ns(message.data)
            if not run.holds(stamp_ns, message.log_time_ns):
                continue
            if message.topic in requests:
                av = requests[message.topic]
                # A repeated request counts from its last sending.
                sent_ns[av, stamp_ns] = message.log_time_ns
                kept[av, stamp_ns] = message
                if len(kept) > _KEPT * len(requests):
                    kept.popitem(last=False)
                continue
            av = plans[message.topic]
            asked_ns = sent_ns.pop((av, stamp_ns), None)
            plan, fault = _plan(reader, message, av, run)
            asked, n = kept.get((av, stamp_ns)), run.game.scheduler.tick_of_stamp(stamp_ns)
            yield RecordedPlan(
                av, stamp_ns, None if n is None else run.game.scheduler.k(n),
                math.nan if asked_ns is None else (message.log_time_ns - asked_ns) * 1e-9, plan,
                fault, None if asked is None else _requested_state(asked, av))


def _plan(reader: BagReader, message: BagMessage, av: str, run: Epoch) -> tuple[Plan | None, str]:
    try:
        series = from_joint_trajectory(reader.decode(message).message, message.topic)
        return plan_from_joints(series, av, run.game.scheduler.time_step_ns), ''
    except InputError as error:
        return None, error.what


def _requested_state(message: BagMessage, av: str) -> VehicleState | None:
    """Return the state of the AV itself in a request; None if the request lacks it."""
    try:
        head = request_head(message.data, message.topic)
    except InputError:
        return None
    if head.names != vehicle_joint_names(av):
        return None
    state, = vehicles_from_joints(head.positions, head.velocities, head.accelerations).tolist()
    return VehicleState(*state)


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


def plans_of_report(report: RunReport | None) -> dict[str, PlanOutcome]:
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
