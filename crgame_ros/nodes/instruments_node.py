# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""instruments_node: streams of LSL out and in, and triggers to an amplifier."""

from collections import deque
from collections.abc import Callable, Sequence
from functools import partial
import math
import os
import time

from crgame_ros.errors import CrgameError, InputError
from crgame_ros.game.documents import EVENTS, GAME, GameDocument, OBJECTS, RUN_STATE
from crgame_ros.game.instruments_spec import InstrumentsSpec
from crgame_ros.game.seat_documents import DRIVERS
from crgame_ros.game.task_documents import TASK_LOG
from crgame_ros.instruments.extra import require_instruments
from crgame_ros.instruments.inlets import Inlets
from crgame_ros.instruments.markers import Marker, RunMarkers
from crgame_ros.instruments.outlets import (
    configure,
    driver_stream,
    MARKERS,
    MAX_VEHICLES,
    Outlet,
    vehicle_stream,
)
from crgame_ros.instruments.run_clock import CycleStarts
from crgame_ros.instruments.triggers import TriggerSender
from crgame_ros.messages.cdr import stamp_of
from crgame_ros.messages.instrument_samples import (
    InstrumentStream,
    InstrumentStreams,
    SampleBatch,
    SAMPLES_TOPIC,
    STREAMS,
    TEXTS,
    TextSamples,
    TextTimes,
    TRIGGERS,
)
from crgame_ros.messages.joints import VEHICLES_TOPIC, WorldMessages
from crgame_ros.messages.status_values import read_status
from crgame_ros.ros.diagnostics import complain
from crgame_ros.ros.endpoints import Endpoints, PolledSubscription
from crgame_ros.ros.messages import from_time
from crgame_ros.ros.node_main import run_node, StopFlag
from crgame_ros.ros.spinning import poll
from crgame_ros.timing.cycle_rows import CycleTable
from crgame_ros.timing.publishing import steps_between_messages
from diagnostic_msgs.msg import DiagnosticStatus
import numpy as np
from numpy.typing import NDArray
from rclpy.node import Node
from std_msgs.msg import Float64MultiArray, MultiArrayDimension, String

# Triggers go out this long after their message at the latest; samples of inlets are sent in
# batches; streams are sought; statuses [s].
PERIOD_S, BATCH_S, LOOK_S, REPORT_S = 0.002, 0.05, 0.5, 1.0
# States that wait for the start of their cycle, which comes a cycle later.
WAITING = 1000


class RunStreams:
    """
    The streams of one run, sent with the times of its steps.

    :param outlets: by stream's name; empty if nothing is sent.
    """

    def __init__(self, game: GameDocument, outlets: dict[str, Outlet]) -> None:
        self._every = steps_between_messages(game.timing.rate)
        self._drivers = {vehicle.id: outlets.get(driver_stream(vehicle.id, 0.0).name)
                         for vehicle in game.vehicles}
        self._vehicles = [outlets.get(vehicle_stream(vehicle.id, 0.0).name)
                          for vehicle in game.vehicles]
        self._marked = outlets.get(MARKERS.name)
        self.starts = CycleStarts(game.scheduler.dt_s)
        self._states: deque[tuple[int, NDArray[np.float64]]] = deque(maxlen=WAITING)
        self._markers: deque[Marker] = deque(maxlen=WAITING)

    def add_states(self, n: int, states: NDArray[np.float64]) -> None:
        """Add the vehicles' states of a step (V, 8)."""
        self._states.append((n, states))

    def add_cycles(self, table: CycleTable) -> None:
        """Add cycles, and send what their drivers did."""
        starts = {int(n): start for n, start in table.steady_rows().tolist()}
        for n, start_s in starts.items():
            self.starts.add(n, start_s)
        for vehicle_id, outlet in self._drivers.items():
            if outlet is None:
                continue
            for n, row in zip(table.column('n').astype(int).tolist(),
                              table.commands(vehicle_id).tolist(), strict=True):
                if n in starts and n % self._every == 0:
                    outlet.push(row, starts[n])

    def add_markers(self, markers: Sequence[Marker]) -> None:
        """Add markers, which are sent once the start of their step is known."""
        self._markers.extend(markers)

    def send(self) -> None:
        """Send the states and markers of steps whose start is known by now."""
        newest = self.starts.newest
        while newest is not None and self._states and self._states[0][0] <= newest:
            n, states = self._states.popleft()
            start_s = self.starts.steady_s(n)
            for outlet, state in zip(self._vehicles, states, strict=True):
                if outlet is not None and start_s is not None:
                    outlet.push(state.tolist(), start_s)
        while newest is not None and self._markers and (self._markers[0].n or 0) <= newest:
            marker = self._markers.popleft()
            start_s = self.starts.steady_s(newest if marker.n is None else marker.n)
            if self._marked is not None and start_s is not None:
                self._marked.push([marker.text], start_s + marker.after_s
                                  if marker.steady_s is None else marker.steady_s)


class InstrumentsNode(Node):
    """The node between a run and other instruments; each game says which."""

    def __init__(self) -> None:
        super().__init__('instruments_node')
        self._endpoints = endpoints = Endpoints(self)
        self._games = endpoints.polled(GAME.topic)
        self._objects = endpoints.polled(OBJECTS.topic)
        self._clocks = endpoints.polled('/clock')
        self._cycles = endpoints.polled('/timing/cycle')
        self._states = endpoints.polled(VEHICLES_TOPIC)
        # What becomes markers, in the order in which it is looked at.
        self._sources: list[tuple[PolledSubscription, Callable[
            [RunMarkers, str], list[Marker]]]] = [
            (endpoints.polled(EVENTS.topic), lambda run, text: run.of_events(EVENTS.read(text))),
            (endpoints.polled(TASK_LOG.topic), lambda run, text: run.of_tasks(
                TASK_LOG.read(text))),
            (endpoints.polled(DRIVERS.topic), lambda run, text: run.of_drivers(
                DRIVERS.read(text))),
            (endpoints.polled(RUN_STATE.topic), lambda run, text: run.of_state(
                RUN_STATE.read(text)))]
        self._diagnostics = endpoints.polled('/diagnostics', depth=100)
        self._drivability: dict[str, PolledSubscription] = {}
        self._documents = endpoints.publisher(STREAMS.topic)
        self._samples = endpoints.publisher(SAMPLES_TOPIC)
        self._texts = endpoints.publisher(TEXTS.topic)
        self._message = Float64MultiArray()
        self._spec: InstrumentsSpec | None = None
        self._outlets: dict[str, Outlet] = {}
        self._inlets: Inlets | None = None
        self._triggers: TriggerSender | None = None
        self._game: GameDocument | None = None
        self._streams: RunStreams | None = None
        self._markers: RunMarkers | None = None
        self._world: WorldMessages | None = None
        self._configured = ''
        self._batch_s = self._look_s = self._report_s = -math.inf

    def run(self, stop: StopFlag) -> None:
        """Work until asked to stop."""
        try:
            poll(self, stop, PERIOD_S, self._work)
        finally:
            if self._triggers is not None:
                self._triggers.close()

    def _work(self) -> None:
        message = self._games.latest()
        if message is not None:
            self._begin(message.data)
        for message in self._objects.waiting():
            self._world = WorldMessages(OBJECTS.read(message.data))
        for message in self._clocks.waiting():
            self._endpoints.diagnostics.now_ns = from_time(message.clock)
        self._read_cycles()
        self._read_states()
        self._read_markers()
        if self._streams is not None:
            self._streams.send()
        now_s = time.monotonic()
        if now_s - self._batch_s > BATCH_S:
            self._batch_s = now_s
            self._publish_samples(now_s)
        if now_s - self._report_s > REPORT_S:
            self._report_s = now_s
            self._report()

    def _begin(self, text: str) -> None:
        """Begin a run; streams and lines of the game before stay open if they are the same."""
        try:
            game = GAME.read(text)
            spec = game.instruments or InstrumentsSpec()
            require_instruments(spec)
            if spec.streams:
                self._configure(spec)
            self._open(game, spec)
        except CrgameError as error:
            self._game = self._streams = self._markers = None
            self.get_logger().error(str(error))
            return
        self._game, self._spec = game, spec
        self._streams = RunStreams(game, self._outlets)
        self._markers = RunMarkers(game.epoch)
        for slot in self._drivability.values():
            self._endpoints.release(slot)
        self._drivability = {vehicle.id: self._endpoints.polled('/<v>/drivability', vehicle.id)
                             for vehicle in game.vehicles}

    def _configure(self, spec: InstrumentsSpec) -> None:
        """Set liblsl's scope, which it reads only once."""
        if not self._configured:
            configure(spec)
            self._configured = spec.scope
        elif self._configured != spec.scope:
            raise InputError(f'liblsl has begun with the scope {self._configured}',
                             'instruments: scope', 'start the run anew')

    def _open(self, game: GameDocument, spec: InstrumentsSpec) -> None:
        """Open what this game names and the one before did not."""
        wanted = [MARKERS] if spec.outlets else []
        rate_hz = game.timing.rate / steps_between_messages(game.timing.rate)
        if spec.outlets:
            for vehicle in game.vehicles[:MAX_VEHICLES]:
                wanted += [vehicle_stream(vehicle.id, rate_hz), driver_stream(vehicle.id, rate_hz)]
            if len(game.vehicles) > MAX_VEHICLES:
                self.get_logger().warning(
                    f'streams are sent of the first {MAX_VEHICLES} vehicles alone')
        names = {stream.name for stream in wanted}
        for name in self._outlets.keys() - names:
            del self._outlets[name]
        domain = os.environ.get('ROS_DOMAIN_ID', '0')
        for stream in wanted:
            if stream.name not in self._outlets:
                self._outlets[stream.name] = Outlet(stream, domain, spec.scope == 'machine')
        before = self._spec or InstrumentsSpec()
        if spec.recorded != before.recorded:
            own = {outlet.source_id for outlet in self._outlets.values()}
            self._inlets = None if not spec.recorded else Inlets(
                spec.recorded, own, TRIGGERS + 1, self.get_logger().info)
        if spec.triggers != before.triggers:
            if self._triggers is not None:
                self._triggers.close()
            self._triggers = None if spec.triggers is None else TriggerSender(
                spec.triggers, self.get_logger().error)
        self._publish_streams(always=True)

    def _read_cycles(self) -> None:
        for message in self._cycles.waiting():
            try:
                table = CycleTable.from_message(message.layout.dim[1].label, message.data)
            except (InputError, IndexError) as error:
                self._endpoints.refusals.note('/timing/cycle', str(error))
                continue
            if self._game is None or self._streams is None or self._markers is None \
                    or not table.is_of(self._game.epoch):
                continue
            self._streams.add_cycles(table)
            if self._streams.starts.newest is None:
                complain(self, 'clock', 'the run tells no steady clock: nothing is sent to LSL')
            else:
                self._tell(self._markers.begun(self._streams.starts.newest))

    def _read_states(self) -> None:
        for message in self._states.waiting():
            if self._game is None or self._streams is None or self._world is None \
                    or not self._outlets:
                continue
            n = self._game.scheduler.step_of_stamp(stamp_of(message))
            try:
                states = self._world.vehicle_states(message)
            except InputError:
                # Of the game before or after this one.
                continue
            # Step 0 is repeated until the run starts, and belongs to no cycle.
            if n > 0 and len(states) == len(self._game.vehicles):
                self._streams.add_states(n, states)

    def _read_markers(self) -> None:
        for slot, read in self._sources:
            for message in slot.waiting():
                try:
                    if self._markers is not None:
                        self._tell(read(self._markers, message.data))
                except InputError as error:
                    self._endpoints.refusals.note(error.where, str(error))
        for slot, of in ((self._diagnostics, RunMarkers.of_study), *(
                (each, RunMarkers.of_drivability) for each in self._drivability.values())):
            for message in slot.waiting():
                for status in map(read_status, message.status):
                    if self._markers is not None:
                        self._tell(of(self._markers, status))

    def _tell(self, markers: Sequence[Marker]) -> None:
        """Send triggers at once, and markers with the time of their step."""
        for marker in markers:
            if self._triggers is not None:
                self._triggers.send(marker.text)
        if self._streams is not None:
            self._streams.add_markers(markers)

    def _publish_samples(self, now_s: float) -> None:
        if self._triggers is not None and (sent := self._triggers.sent()):
            # This machine's own clock needs no correction.
            self._texts.publish(String(data=TEXTS.write(TextSamples(
                TRIGGERS, tuple(TextTimes(0, item.at_s, 0.0, 0.0, item.at_s) for item in sent),
                tuple((item.marker, str(item.code)) for item in sent)))))
        if self._inlets is None:
            return
        if now_s - self._look_s > LOOK_S:
            self._look_s = now_s
            self._inlets.look()
        for batch in self._inlets.poll():
            # A stream is described before its first sample.
            self._publish_streams()
            if isinstance(batch, TextSamples):
                self._texts.publish(String(data=TEXTS.write(batch)))
            else:
                self._publish_numbers(batch)
        self._publish_streams()

    def _check_gaze(self) -> None:
        """Say which channels of gaze a stream does not have: its samples would have no place."""
        for gaze in self._spec.gaze if self._spec is not None else ():
            for inlet in self._inlets.open if self._inlets is not None else ():
                missing = sorted(gaze.channels - set(inlet.stream.channels))
                if inlet.stream.name == gaze.stream and inlet.described and missing:
                    complain(self, 'gaze', f'the stream {gaze.stream} has no channel '
                             f'{", ".join(missing)}, but {", ".join(inlet.stream.channels)[:200]}:'
                             ' name them in instruments: gaze')

    def _publish_numbers(self, batch: SampleBatch) -> None:
        label = batch.label([f'ch{place + 1}' for place in range(batch.values.shape[1])])
        width = label.count(',') + 1
        self._message.layout.dim = [
            MultiArrayDimension(label='samples', size=len(batch.times),
                                stride=len(batch.times) * width),
            MultiArrayDimension(label=label, size=width, stride=width)]
        self._message.data = batch.flat()
        self._samples.publish(self._message)

    def _publish_streams(self, always: bool = False) -> None:
        """Publish the list of streams, if it has changed."""
        if not always and (self._inlets is None or not self._inlets.changed):
            return
        found: tuple[InstrumentStream, ...] = ()
        if self._inlets is not None:
            found, self._inlets.changed = self._inlets.streams, False
        own = () if self._triggers is None else (InstrumentStream(
            TRIGGERS, 'triggers', 'Triggers', ('marker', 'code'), ('', ''), format='string',
            source_id='crgame_ros/triggers'),)
        self._documents.publish(String(data=STREAMS.write(InstrumentStreams((*own, *found)))))

    def _report(self) -> None:
        self._check_gaze()
        if self._inlets is not None:
            values: dict[str, object] = {}
            for inlet in self._inlets.open:
                name = inlet.stream.name
                values |= {f'{name}: samples': inlet.samples,
                           f'{name}: offset_ms': f'{1e3 * inlet.offset_s:.3f}',
                           f'{name}: uncertainty_ms': f'{1e3 * inlet.uncertainty_s:.3f}'}
            gone = [stream.name for stream in self._inlets.streams if not stream.here]
            self._endpoints.diagnostics.publish(
                'instruments_node: streams',
                DiagnosticStatus.WARN if gone else DiagnosticStatus.OK,
                f'gone: {", ".join(gone)}' if gone else 'recording', values)
        if self._triggers is not None:
            up = self._triggers.up
            self._endpoints.diagnostics.publish(
                'instruments_node: triggers', DiagnosticStatus.OK if up else DiagnosticStatus.WARN,
                'line open' if up else 'line not open',
                {'sent': self._triggers.count, 'lost': self._triggers.lost})


main = partial(run_node, InstrumentsNode)

if __name__ == '__main__':
    main()
