# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""criticality_node: the time, distance and braking left to every driven vehicle."""

from array import array
from functools import partial
import time

from crgame_ros.analysis.criticality.criticality import Criticality, MEASURES, TickMeasures
from crgame_ros.analysis.criticality.rows import (
    COLUMNS,
    criticality_rows,
    CRITICALITY_TOPIC,
    MEASURED,
)
from crgame_ros.analysis.criticality.thresholds import OPTIONS, Thresholds, USUAL
from crgame_ros.ros.node_main import run_node
from crgame_ros.ros.number_parameters import declare_number
from crgame_ros.ros.world_follower import ObserverNode
from crgame_ros.simulation.observer import ObservedRun
from diagnostic_msgs.msg import DiagnosticStatus
from std_msgs.msg import Float64MultiArray, MultiArrayDimension

HEARTBEAT_S = 1.0
GREATEST = 1000.0


class CriticalityNode(ObserverNode[Criticality]):
    """
    The node that measures criticality at each scenario tick and publishes the rows.

    On /diagnostics it reports on each vehicle every second, and when the vehicle becomes critical
    or ceases to be.
    """

    def __init__(self) -> None:
        super().__init__('criticality_node')
        bounds = 0.0, GREATEST
        self._thresholds = Thresholds(*(
            declare_number(self, name, getattr(USUAL, field), sentence, bounds)
            for field, (name, sentence) in OPTIONS.items()))
        self._rows = self.endpoints.publisher(CRITICALITY_TOPIC)
        self._message = Float64MultiArray()
        self._message.layout.dim = [
            MultiArrayDimension(label='pairs'),
            MultiArrayDimension(label=','.join(COLUMNS), size=len(COLUMNS), stride=len(COLUMNS))]
        self._told: dict[int, bool] = {}
        self._heartbeat_s = 0.0
        self._n = -1

    def make(self, run: ObservedRun) -> Criticality:
        """Build the observer of a run."""
        self._told, self._n, self._heartbeat_s = {}, -1, 0.0
        return Criticality(run, self._thresholds)

    def publish(self, observer: Criticality, stamp_ns: int) -> None:
        """Publish the rows of a tick."""
        if observer.n == self._n:
            return
        self._n = observer.n
        rows = criticality_rows(observer, self.epoch, observer.n)
        # A table without rows does not even hold its step.
        if len(rows):
            self._message.layout.dim[0].size = len(rows)
            self._message.layout.dim[0].stride = rows.size
            self._message.data = array('d', rows.tobytes())
            self._rows.publish(self._message)
        beats = time.monotonic() - self._heartbeat_s > HEARTBEAT_S
        if beats:
            self._heartbeat_s = time.monotonic()
        for tick in observer.latest:
            self._publish_vehicle(observer, tick, stamp_ns, beats)

    def _publish_vehicle(self, observer: Criticality, tick: TickMeasures, stamp_ns: int,
                         beats: bool) -> None:
        """Publish the status of one vehicle if it is due."""
        values, others = (each.tolist() for each in tick.worst())
        now = {name: (value, other) for name, value, other in zip(
            MEASURES, values, others, strict=True) if other >= 0}
        critical = [f'{name} {value:.2f} {MEASURES[name].unit} to {observer.ids[other]}'
                    for name, (value, other) in now.items()
                    if self._thresholds.exceeded(name, value)]
        if not beats and self._told.get(tick.subject, False) == bool(critical):
            return
        self._told[tick.subject] = bool(critical)
        found = observer.report()[tick.subject]
        told = {'n': observer.n} | {
            f'exposure_{name}': f'{value:.2f}' for name, value in found.exposures.items()}
        for name, (value, other) in now.items():
            told[name], told[f'{name}_of'] = f'{value:.3f}', observer.ids[other]
        for name, worst in found.worst.items():
            told[f'worst_{name}'] = f'{worst.value:.3f}'
            told[f'worst_{name}_of'] = worst.other
            told[f'worst_{name}_at'] = f'{worst.time_s:.2f}'
        told |= {f'threshold_{name}': f'{limit:g}' for name in MEASURED
                 if (limit := self._thresholds.of(name))}
        self.endpoints.diagnostics.publish(
            f'criticality_node: {found.vehicle_id}',
            DiagnosticStatus.WARN if critical else DiagnosticStatus.OK,
            '; '.join(critical) or 'not critical', told, stamp_ns)


main = partial(run_node, CriticalityNode)

if __name__ == '__main__':
    main()
