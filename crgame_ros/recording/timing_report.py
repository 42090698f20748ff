# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Computes `timing.json`: timing, planners, violations and contacts of a recorded run."""

from collections import Counter, defaultdict
from collections.abc import Callable, Sequence
import json
from pathlib import Path
from typing import Any, cast

from crgame_ros.drivability.monitor import VehicleDrivability
from crgame_ros.errors import InputError
from crgame_ros.game.documents import EVENTS
from crgame_ros.game.events import FiredEvent
from crgame_ros.messages.cdr import header_stamp_ns
from crgame_ros.messages.joints import OBJECT_STATES_TOPIC, vehicles_from_joints, VEHICLES_TOPIC
from crgame_ros.messages.status_values import BRAKING, read_status, status_amount
from crgame_ros.planner.adapter import first_of_kind
from crgame_ros.recording.epochs import Epoch, read_epoch
from crgame_ros.recording.reader import BagReader
from crgame_ros.recording.recorded_plans import (
    PlanOutcome,
    plans_of_result,
    RunReport,
    spread_of,
    ViolationEntry,
)
from crgame_ros.recording.run_cycles import read_cycles
from crgame_ros.recording.run_points import read_points
from crgame_ros.recording.run_trajectories import RunTrajectories
from crgame_ros.recording.storage import BagMessage
from crgame_ros.recording.views import SeatSound, ViewPeriods
from crgame_ros.simulation.autonomous_vehicle import PLAN_COUNTS
from crgame_ros.simulation.contacts import (
    Contact,
    ContactEntry,
    contacts_of,
    find_contacts,
    Motions,
)
from crgame_ros.simulation.offline import OfflineResult
from crgame_ros.timing.late_steps import LateSteps
from crgame_ros.timing.metrics import slowness, TimingMetrics
from crgame_ros.vehicle.state import StateColumn
from crgame_ros.whole_file import write_text
import numpy as np
from numpy.typing import NDArray
from shapely.errors import GEOSException


def recorded_contacts(reader: BagReader, run: Epoch, verdicts: Sequence[VehicleDrivability],
                      fired: Sequence[FiredEvent]) -> tuple[Contact, ...]:
    """
    Find the contacts of a recorded run.

    :param verdicts: the recorded verdicts of the run's vehicles, in order.
    :param fired: the run's events.
    :raises InputError: if the motion that led to one of them was not recorded.
    """
    known = {item.id for item in run.descriptions}
    told: set[tuple[str, str]] = set()
    touching = []
    for verdict in verdicts:
        # Repeated statuses repeat a contact, also after the last state.
        new = tuple(name for name in verdict.hit
                    if name in known and (verdict.vehicle_id, name) not in told)
        if new:
            told.update((verdict.vehicle_id, name) for name in new)
            touching.append(verdict._replace(hit=new))
    stops = [event for event in fired if event.touching and known.issuperset(event.touching)]
    steps = [(verdict.n, verdict.vehicle_id, verdict.hit[0]) for verdict in touching]
    steps += [(event.n, *event.touching) for event in stops if event.touching]
    if not steps:
        return ()
    motions = _read_motions(reader, run)
    recorded = np.flatnonzero(np.isfinite(motions.vehicle_states).all(axis=(1, 2)))
    for n, vehicle, other in steps:
        if not recorded[0] <= n <= recorded[-1]:
            raise InputError(f'no states of step {n}, at which {vehicle} touches {other}',
                             str(reader.path), 'record from before the start of the run')
    return find_contacts(motions, touching, stops)


def _read_motions(reader: BagReader, run: Epoch) -> Motions:
    vehicles, objects = run.vehicle_ids, run.object_ids
    points = read_points(reader, run, {VEHICLES_TOPIC: vehicles, OBJECT_STATES_TOPIC: objects})
    for topic, ids in ((VEHICLES_TOPIC, vehicles), (OBJECT_STATES_TOPIC, objects)):
        if ids and not points[topic]:
            raise InputError(f'no {topic} in it', str(reader.path), 'record this topic too')
    ns = np.array(sorted(points[VEHICLES_TOPIC]))
    joints = np.array([points[VEHICLES_TOPIC][n] for n in ns.tolist()])
    joints = joints.reshape(len(ns), 3, len(vehicles), 4)
    object_ns = np.array(sorted(points[OBJECT_STATES_TOPIC]), dtype=np.int64)
    others = np.array([points[OBJECT_STATES_TOPIC][n] for n in object_ns.tolist()])
    others = others.reshape(len(object_ns), 3, len(objects), 3)
    return Motions(
        run.descriptions,
        {av.id: av.vehicle.max_acceleration for av in run.game.avs},
        run.game.scheduler,
        _every_step(vehicles_from_joints(joints[:, 0], joints[:, 1], joints[:, 2]), ns),
        object_ns, others[:, 0], others[:, 1])


def _every_step(states: NDArray[np.float64], ns: NDArray[np.int64]) -> NDArray[np.float64]:
    """Return the states (n + 1, V, 8) at every step, interpolated between messages."""
    if len(ns) == ns[-1] + 1:
        return states
    turned = states.copy()
    turned[:, :, StateColumn.YAW] = np.unwrap(states[:, :, StateColumn.YAW], axis=0)
    steps = np.arange(ns[-1] + 1)
    columns = [np.interp(steps, ns, column, left=np.nan)
               for column in turned.reshape(len(ns), -1).T]
    return np.column_stack(columns).reshape(len(steps), *states.shape[1:])


_DIAGNOSTICS = '/diagnostics'
# The keys of every report besides table I.
REPORT_KEYS = frozenset((
    'gaps', 'scenario_steps', 'planners', 'drivability', 'contacts', 'benchmark_id', 'epoch',
    'notices', 'final_error_ms', 'mean_step_error_ms', 'max_cumulative_error_ms', 'timeout_ratio',
    'real_time_ratio', 'time_efficiency', 'precision_ratio'))
_VIRTUAL = 'the run was offline, on a virtual clock that is never late: no timing was measured'
# Prefix in the status of a tracked AV.
_WORST = 'worst_'


def timing_report(bag: Path, epoch: int | None = None, log: RunTrajectories | None = None,
                  progress: Callable[[float], object] | None = None) -> RunReport:
    """
    Compute a recorded run's report; `docs/recordings.md` and `docs/timing.md` define the keys.

    :param bag: a recording, finished or cut off.
    :param epoch: which run, where the recording holds several; None for the last.
    :param log: the run, if it has been read already.
    :param progress: called with the share of the recording that has been read, 0 to 1.
    :raises InputError: if the recording lacks its documents or cycles.
    :raises CrgameError: if it holds fewer than two cycles.
    """
    if log is not None:
        epoch = log.game.epoch
    with BagReader(bag, parts=True, progress=progress) as reader:
        run = read_epoch(reader, epoch)
        cycles = log.cycles if log is not None and log.cycles is not None \
            else read_cycles(reader, run.game.epoch)
        metrics = TimingMetrics(run.game.scheduler.dt_s)
        metrics.add_rows(cycles.timing_rows())
        late = LateSteps()
        late.add_table(cycles)
        numbers = cycles.column('n')
        collected = _Collector(run)
        for message in reader.messages(collected.topics):
            collected.add(message, reader)
        contacts, unknown = _contacts(reader, run, collected.verdicts, collected.fired)
        planners = {av: collected.planner(av) for av in collected.avs}
        summary = metrics.summary()
        # With table I.
        return cast(RunReport, {
            **summary.as_dict(),
            'late_steps': late.as_dict(),
            # The first row belongs to the step to n = 1.
            'gaps': int(numbers[-1]) - len(numbers),
            'scenario_steps': None if log is None else
            {'first': int(log.ks[0]), 'last': int(log.ks[-1])},
            'planners': {av: each.as_dict() for av, each in planners.items()},
            'drivability': {'violations': len(collected.violations),
                            'list': collected.violations},
            'contacts': contacts,
            'sound': collected.sound.as_dict(),
            'view': collected.view.as_dict(),
            'benchmark_id': run.game.benchmark_id,
            'epoch': run.game.epoch,
            'notices': [*dict.fromkeys((
                *(() if log is None else log.notices), *reader.notices, *reader.foreign_notices,
                *(f'/{av}/plan: {each.of_others} plans of other programs than its planner, '
                  'which were not taken' for av, each in planners.items() if each.of_others),
                *unknown, *([_VIRTUAL] if reader.has_virtual_clock else []),
                *filter(None, [slowness(summary.real_time_ratio.final)])))]})


def write_timing_report(bag: Path, path: Path, epoch: int | None = None,
                        log: RunTrajectories | None = None,
                        progress: Callable[[float], object] | None = None) -> RunReport:
    """
    Write `timing.json`, completely or not at all.

    Parameters are those of `timing_report`.

    :return: what was written.
    :raises InputError: as `timing_report`, and if the file cannot be written.
    """
    report = timing_report(bag, epoch, log, progress)
    write_text(json.dumps(report, indent=2, allow_nan=False) + '\n', path)
    return report


def _contacts(reader: BagReader, run: Epoch, verdicts: Sequence[VehicleDrivability],
              fired: Sequence[FiredEvent]
              ) -> tuple[list[ContactEntry] | None, tuple[str, ...]]:
    """Return the entries of the contacts, or None and the reason if they are not known."""
    try:
        return [item.as_dict() for item in recorded_contacts(reader, run, verdicts, fired)], ()
    except (InputError, ValueError, GEOSException) as error:
        # States from another sender may have no outlines.
        return None, (f'contacts are not named: {error}',)


class _Collector:
    """Collects one run's requests, plans, diagnostics and verdicts in order of log time."""

    def __init__(self, run: Epoch) -> None:
        self._run = run
        self.avs = [av.id for av in run.game.avs]
        vehicles = [item.id for item in run.game.vehicles]
        self._requests = {f'/{av}/plan_request': av for av in self.avs}
        self._plans = {f'/{av}/plan': av for av in self.avs}
        self._verdicts = {f'/{vehicle}/drivability': vehicle for vehicle in vehicles}
        self.topics = (_DIAGNOSTICS, EVENTS.topic, *self._requests, *self._plans, *self._verdicts)
        self.violations: list[ViolationEntry] = []
        self.verdicts: list[VehicleDrivability] = []
        self.fired: tuple[FiredEvent, ...] = ()
        self._lasting: dict[str, set[str]] = defaultdict(set)
        # By AV and stamp [ns]; a repeated request counts from its last sending.
        self._sent_ns: dict[tuple[str, int], int] = {}
        self._latencies_ms: dict[str, list[float]] = defaultdict(list)
        self._first_latency_ms: dict[str, float] = {}
        self._answers: dict[str, int] = defaultdict(int)
        self._plan_times_ms: dict[str, list[float]] = defaultdict(list)
        self._ages_ms: dict[str, list[float]] = defaultdict(list)
        self._reasons: dict[str, Counter[str]] = defaultdict(Counter)
        self._first_reasons: dict[str, dict[str, str]] = defaultdict(dict)
        self._statuses: dict[str, dict[str, str]] = {}
        self.sound = SeatSound()
        self.view = ViewPeriods()

    def add(self, recorded: BagMessage, reader: BagReader) -> None:
        """Process one message; skip those of other runs and malformed ones."""
        topic, _, log_time_ns, data = recorded
        if topic == EVENTS.topic:
            self._add_events(recorded, reader)
            return
        stamp_ns = header_stamp_ns(data)
        if not self._run.holds(stamp_ns, log_time_ns):
            return
        # Requests and plans are large, and their stamp is enough.
        if topic in self._requests:
            self._sent_ns[self._requests[topic], stamp_ns] = log_time_ns
        elif topic in self._plans:
            self._add_plan(self._plans[topic], stamp_ns, log_time_ns)
        else:
            try:
                message = reader.decode(recorded).message
            except InputError:
                reader.foreign[topic] += 1
                return
            for status in message.status:
                if topic in self._verdicts:
                    self._add_verdict(self._verdicts[topic], status)
                else:
                    self._add_status(status, stamp_ns)

    def _add_events(self, recorded: BagMessage, reader: BagReader) -> None:
        """Store the events since the start of the run; each message holds all of them."""
        try:
            events = EVENTS.read(reader.decode(recorded).message.data)
        except InputError:
            reader.foreign[EVENTS.topic] += 1
            return
        if events.epoch == self._run.game.epoch:
            self.fired = events.fired

    def _add_plan(self, av: str, stamp_ns: int, log_time_ns: int) -> None:
        self._answers[av] += 1
        asked_ns = self._sent_ns.pop((av, stamp_ns), None)
        if asked_ns is None:
            return
        latency_ms = (log_time_ns - asked_ns) * 1e-6
        if stamp_ns == self._run.game.scheduler.clock_offset_ns:
            # The run waits for this first answer, and the planner for its imports.
            self._first_latency_ms[av] = latency_ms
        else:
            self._latencies_ms[av].append(latency_ms)

    def _add_status(self, status: Any, stamp_ns: int) -> None:
        told = read_status(status)
        values = told.values
        self._statuses[status.name] = values
        self.sound.add(told)
        self.view.add(told, (stamp_ns - self._run.game.scheduler.clock_offset_ns) * 1e-9)
        # Anybody may publish statuses: what is no number is skipped.
        plan_time_ms, age_ms = (status_amount(values, key) for key in ('plan_time_ms', 'age_ms'))
        if status.name.startswith('planner_node: ') and plan_time_ms is not None:
            self._plan_times_ms[status.name].append(plan_time_ms)
            if status.message.startswith(BRAKING):
                reason = first_of_kind(self._first_reasons[status.name],
                                       status.message.removeprefix(BRAKING))
                self._reasons[status.name][reason] += 1
        elif status.name.startswith('sim_node: ') and age_ms is not None:
            self._ages_ms[status.name].append(age_ms)

    def _add_verdict(self, vehicle: str, status: Any) -> None:
        """Store new violations; repeated statuses contain those that last."""
        violated = set(status.message.split('; ')) if status.level else set()
        values = read_status(status).values
        n = _count(values, 'n')
        for what in sorted(violated - self._lasting[vehicle]):
            self.violations.append({'n': n, 'vehicle': vehicle, 'what': what})
        self._lasting[vehicle] = violated
        hit = tuple(name for name in values.get('hit', '').split(',') if name)
        if n is not None and hit:
            self.verdicts.append(VehicleDrivability(
                vehicle, True, values.get('road_compliance') == 'false', hit, n))

    def planner(self, av: str) -> PlanOutcome:
        """Return what became of an AV's plans."""
        engine = self._statuses.get(f'sim_node: {av} plans', {})
        name = f'planner_node: {av}'
        node = self._statuses.get(name, {})
        return PlanOutcome(
            **{key: _count(engine, key) for key in PLAN_COUNTS},
            last_refusal=engine.get('last_refusal') or None,
            # The node reports its counts at intervals, but every fallback immediately.
            plans=max(self._answers[av], _count(node, 'plans') or 0),
            fallback=_count(node, 'fallbacks'),
            fallback_reasons=dict(self._reasons[name]) or None,
            plan_time_ms=spread_of(self._plan_times_ms[name]),
            latency_ms=spread_of(self._latencies_ms[av]),
            first_latency_ms=self._first_latency_ms.get(av),
            age_ms=spread_of(self._ages_ms[f'sim_node: {av} plans']),
            worst_tracking_errors={
                key.removeprefix(_WORST).removesuffix('_error'): value
                for key in engine if key.startswith(_WORST)
                and (value := status_amount(engine, key)) is not None} or None)


def _count(values: dict[str, str], key: str) -> int | None:
    amount = status_amount(values, key)
    return None if amount is None else int(amount)


def offline_outcome(result: OfflineResult) -> RunReport:
    """Return the entries `planners`, `drivability` and `contacts`, as `timing_report` does."""
    violations = _violations(result)
    return {'planners': {av: each.as_dict() for av, each in plans_of_result(result).items()},
            'drivability': {'violations': len(violations), 'list': violations},
            'contacts': [item.as_dict() for item in contacts_of(result)],
            'notices': list(result.setup.notices)}


def _violations(result: OfflineResult) -> list[ViolationEntry]:
    """Return the violations by their beginnings, in order."""
    found: list[ViolationEntry] = []
    lasting: dict[str, set[str]] = {}
    for verdict in result.violations:
        violated = set(verdict.faults)
        found += [{'n': verdict.n, 'vehicle': verdict.vehicle_id, 'what': what}
                  for what in sorted(violated - lasting.get(verdict.vehicle_id, set()))]
        lasting[verdict.vehicle_id] = violated
    return found
