# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""timesync_node: the time-sync supervisor; computes CRG table I live and orders frame skipping."""

from functools import partial
import time

from crgame_ros.errors import CrgameError, InputError
from crgame_ros.game.documents import GAME, GameDocument
from crgame_ros.game.game import TimingSpec
from crgame_ros.ros.diagnostics import complain
from crgame_ros.ros.endpoints import Endpoints
from crgame_ros.ros.node_main import run_node, StopFlag
from crgame_ros.ros.run_time import GameAwaited, RunTime, TimeCourse
from crgame_ros.ros.spinning import poll
from crgame_ros.timing.cycle_rows import CycleTable
from crgame_ros.timing.late_steps import LateSteps
from crgame_ros.timing.metrics import slowness, TimingMetrics
from crgame_ros.timing.publishing import FrameSkipping
from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.node import Node
from std_msgs.msg import Bool

PERIOD_S = 0.02
REPORT_S = 1.0
# Before this simulated time a run's ratio says little [s].
SETTLED_S = 3.0


class TimesyncNode(Node):
    """The supervisor of the cycles that sim_node has measured."""

    def __init__(self) -> None:
        super().__init__('timesync_node')
        endpoints = Endpoints(self)
        self._cycles = endpoints.polled('/timing/cycle')
        self._refusals = endpoints.refusals
        self._games = endpoints.polled('/scenario/game')
        self._diagnostics = endpoints.diagnostics
        self._orders = endpoints.publisher('/timing/frame_skip')
        self._game: GameDocument | None = None
        self._metrics: TimingMetrics | None = None
        self._late = LateSteps()
        self._skipping = FrameSkipping(TimingSpec())
        self._time = RunTime()
        self._awaited = GameAwaited(self, 'nothing is measured')
        self._report_s = 0.0

    def run(self, stop: StopFlag) -> None:
        """Supervise until asked to stop."""
        poll(self, stop, PERIOD_S, self._work)

    def _work(self) -> None:
        message = self._games.latest()
        if message is not None:
            self._begin(message.data)
        for message in self._cycles.waiting():
            try:
                self._add(CycleTable.from_message(message.layout.dim[1].label, message.data))
            except InputError as error:
                self._refusals.note('/timing/cycle', str(error))
        metrics = self._metrics
        if (metrics is not None and metrics.cycles >= 2
                and time.monotonic() - self._report_s > REPORT_S):
            self._report_s = time.monotonic()
            self._report(metrics)

    def _add(self, table: CycleTable) -> None:
        self._awaited.check(self._game is not None, True)
        if self._game is None or self._metrics is None or not table.is_of(self._game.epoch):
            return
        stamp_ns = self._game.scheduler.stamp_ns(int(table.column('n')[-1]))
        course = self._time.follow(stamp_ns)
        if course is TimeCourse.BACK:
            # A recording is played again.
            self._begin_anew(self._game)
        if course in (TimeCourse.ON, TimeCourse.BACK):
            self._metrics.add_rows(table.timing_rows())
            self._late.add_table(table)
            # An order to skip frames, or its end (CRG III-A2a, mechanism 2).
            lag_s = float(table.column('cumulative_error_s')[-1])
            if self._skipping.update(lag_s, time.monotonic()):
                self._orders.publish(Bool(data=self._skipping.active))
            self._diagnostics.now_ns = stamp_ns

    def _begin(self, text: str) -> None:
        try:
            self._game = GAME.read(text)
            self._time = RunTime()
            self._begin_anew(self._game)
        except (CrgameError, TypeError) as error:
            self.get_logger().error(str(error))

    def _begin_anew(self, game: GameDocument) -> None:
        """Measure a run from its start."""
        self._metrics = TimingMetrics(game.scheduler.dt_s)
        self._late = LateSteps()
        self._skipping = FrameSkipping(game.timing)
        # Cancel an order of the previous run or of a supervisor that was killed.
        self._orders.publish(Bool(data=False))

    def _report(self, metrics: TimingMetrics) -> None:
        summary = metrics.summary()
        late = summary.worst_lag_ms > 10.0 * metrics.dt_s * 1e3
        values = summary.as_dict()
        del values['real_time_ratio']
        values.update({f'real_time_ratio_{key}': value
                       for key, value in vars(summary.real_time_ratio).items()})
        slow = slowness(summary.real_time_ratio.final)
        if slow is not None and metrics.cycles * metrics.dt_s > SETTLED_S:
            complain(self, 'slow', slow)
        values['frame_skipping'] = self._skipping.active
        values['frame_skip_orders'] = self._skipping.orders
        values['late_steps'] = self._late.count
        worst = self._late.worst[:1]
        values['worst_late_step'] = str(worst[0]) if worst else ''
        self._diagnostics.publish(
            'timesync_node: table I',
            DiagnosticStatus.WARN if late or self._skipping.active else DiagnosticStatus.OK,
            f'mean step error {summary.mean_step_error_ms:.3f} ms, '
            f'worst lag {summary.worst_lag_ms:.1f} ms, timeouts {summary.timeout_ratio:.2%}',
            {key: f'{value:.6g}' if isinstance(value, float) else value
             for key, value in values.items()})


main = partial(run_node, TimesyncNode)

if __name__ == '__main__':
    main()
