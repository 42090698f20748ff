# Copyright 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""`timing.json`: what a recorded run says of its timing, planners, violations and contacts."""

from collections import defaultdict
from collections.abc import Sequence
import json
from pathlib import Path
from typing import Any

import numpy as np

from crgame_ros.drivability.monitor import VehicleDrivability
from crgame_ros.errors import InputError
from crgame_ros.recording.epochs import Epoch, read_epoch
from crgame_ros.recording.reader import BagReader, DecodedMessage
from crgame_ros.recording.run_contacts import recorded_contacts
from crgame_ros.recording.run_log import read_cycles, stamp_of
from crgame_ros.scenario.export import write_text
from crgame_ros.timing.timing_metrics import TimingMetrics

_DIAGNOSTICS = '/diagnostics'
# Counts of a status `sim_node: <av> plans`, as the engine keeps them.
_PLAN_COUNTS = ('requests', 'accepted', 'refused', 'skipped', 'timed_out', 'realigned',
                'steps_without_plan')


def timing_report(bag: Path, epoch: int | None = None) -> dict[str, Any]:
    """
    Report on a recorded run; `docs/recordings.md` and `docs/timing.md` define the keys.

    :param bag: a recording, finished or cut off.
    :param epoch: which run, where the recording holds several; None for the last.
    :raises InputError: if the recording lacks its documents or cycles.
    :raises CrgameError: if it holds fewer than two cycles.
    """
    with BagReader(bag) as reader:
        run = read_epoch(reader, epoch)
        cycles = read_cycles(bag, run.game.epoch)
        metrics = TimingMetrics(run.game.scheduler.dt_s)
        metrics.add_rows(cycles.timing_rows())
        numbers = cycles.column('n')
        collected = _Collector(run)
        for message in reader.decoded(collected.topics):
            collected.take(message)
        contacts, unknown = _contacts(reader, run, collected.verdicts)
        return {
            **metrics.summary().as_dict(),
            # The first row is that of the step to n = 1.
            'gaps': int(numbers[-1]) - len(numbers),
            'planners': {av: collected.planner(av) for av in collected.avs},
            'drivability': {'violations': len(collected.violations),
                            'list': collected.violations},
            'contacts': contacts,
            'benchmark_id': str(run.game.content.get('benchmark_id', '')),
            'epoch': run.game.epoch,
            'notices': [*reader.notices, *unknown]}


def write_timing_report(bag: Path, path: Path, epoch: int | None = None) -> dict[str, Any]:
    """
    Write `timing.json`; the file is there whole or not at all.

    :return: what was written.
    :raises InputError: as `timing_report`, and if the file cannot be written.
    """
    report = timing_report(bag, epoch)
    write_text(json.dumps(report, indent=2, allow_nan=False) + '\n', path)
    return report


def _contacts(reader: BagReader, run: Epoch, verdicts: Sequence[VehicleDrivability]
              ) -> tuple[list[dict[str, Any]] | None, tuple[str, ...]]:
    """Give the entries of the contacts, or None and why they are not known."""
    try:
        return [item.as_dict() for item in recorded_contacts(reader, run, verdicts)], ()
    except InputError as error:
        return None, (f'contacts are not named: {error}',)


class _Collector:
    """Follows one run's requests, plans, diagnostics and verdicts in the order of log time."""

    def __init__(self, run: Epoch) -> None:
        self._run = run
        self.avs = [str(entry['id']) for entry in run.game.avs]
        vehicles = [str(entry['id']) for entry in (*run.game.humans, *run.game.avs)]
        self._requests = {f'/{av}/plan_request': av for av in self.avs}
        self._plans = {f'/{av}/plan': av for av in self.avs}
        self._verdicts = {f'/{vehicle}/drivability': vehicle for vehicle in vehicles}
        self.topics = (_DIAGNOSTICS, *self._requests, *self._plans, *self._verdicts)
        self.violations: list[dict[str, Any]] = []
        self.verdicts: list[VehicleDrivability] = []
        self._lasting: dict[str, set[str]] = defaultdict(set)
        self._asked_ns: dict[tuple[str, int], int] = {}
        self._latencies_ms: dict[str, list[float]] = defaultdict(list)
        self._first_latency_ms: dict[str, float] = {}
        self._answers: dict[str, int] = defaultdict(int)
        self._plan_times_ms: dict[str, list[float]] = defaultdict(list)
        self._statuses: dict[str, dict[str, str]] = {}

    def take(self, recorded: DecodedMessage) -> None:
        """Take one message; those of other runs are passed over."""
        topic, _, log_time_ns, message = recorded
        stamp_ns = stamp_of(message)
        if not self._run.holds(stamp_ns, log_time_ns):
            return
        if topic in self._requests:
            # A request that was sent again counts from the last time before its answer.
            self._asked_ns[self._requests[topic], stamp_ns] = log_time_ns
        elif topic in self._plans:
            self._take_plan(self._plans[topic], stamp_ns, log_time_ns)
        elif topic in self._verdicts:
            for status in message.status:
                self._take_verdict(self._verdicts[topic], status)
        else:
            for status in message.status:
                self._take_status(status)

    def _take_plan(self, av: str, stamp_ns: int, log_time_ns: int) -> None:
        self._answers[av] += 1
        asked_ns = self._asked_ns.pop((av, stamp_ns), None)
        if asked_ns is None:
            return
        latency_ms = (log_time_ns - asked_ns) * 1e-6
        if stamp_ns == self._run.game.scheduler.clock_offset_ns:
            # The run waits for this answer, and the planner for its imports.
            self._first_latency_ms[av] = latency_ms
        else:
            self._latencies_ms[av].append(latency_ms)

    def _take_status(self, status: Any) -> None:
        values = _values(status)
        self._statuses[status.name] = values
        if status.name.startswith('planner_node: ') and values.get('plan_time_ms'):
            self._plan_times_ms[status.name].append(float(values['plan_time_ms']))

    def _take_verdict(self, vehicle: str, status: Any) -> None:
        """Note what has begun to be violated; heartbeats repeat what lasts."""
        violated = set(status.message.split('; ')) if status.level else set()
        values = _values(status)
        n = _count(values, 'n')
        for what in sorted(violated - self._lasting[vehicle]):
            self.violations.append({'n': n, 'vehicle': vehicle, 'what': what})
        self._lasting[vehicle] = violated
        hit = tuple(name for name in values.get('hit', '').split(',') if name)
        if n is not None and hit:
            self.verdicts.append(VehicleDrivability(
                vehicle, True, values.get('road_compliance') == 'false', hit, n))

    def planner(self, av: str) -> dict[str, Any]:
        """Sum up one AV; None stands for what was not recorded."""
        engine = self._statuses.get(f'sim_node: {av} plans', {})
        name = f'planner_node: {av}'
        node = self._statuses.get(name, {})
        report: dict[str, Any] = {key: _count(engine, key) for key in _PLAN_COUNTS}
        # The node reports its counts now and then, but every fallback at once.
        report['last_refusal'] = engine.get('last_refusal') or None
        report['plans'] = max(self._answers[av], _count(node, 'plans') or 0)
        report['fallback'] = _count(node, 'fallbacks')
        report['plan_time_ms'] = _spread(self._plan_times_ms[name])
        report['latency_ms'] = _spread(self._latencies_ms[av])
        report['first_latency_ms'] = self._first_latency_ms.get(av)
        return report


def _values(status: Any) -> dict[str, str]:
    return {str(entry.key): str(entry.value) for entry in status.values}


def _count(values: dict[str, str], key: str) -> int | None:
    text = values.get(key, '')
    return int(text) if text.isdecimal() else None


def _spread(samples: Sequence[float]) -> dict[str, float] | None:
    """Give median, 99th percentile and maximum; None of nothing."""
    values = np.array(samples)
    if not len(values):
        return None
    return {'p50': float(np.percentile(values, 50)), 'p99': float(np.percentile(values, 99)),
            'max': float(values.max())}
