# Copyright 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.
"""Who drives what in a live run: one source a seat, changed by orders on /seats/order."""

from collections.abc import MutableMapping
import json
from typing import TYPE_CHECKING

from crgame_ros.driver.source import COCKPIT, parse_source
from crgame_ros.driver.watchdog import SeatWatchdog
from crgame_ros.errors import InputError
from crgame_ros.ros.endpoints import Endpoints, PolledSubscription, SHARED_DEPTH
from crgame_ros.ros.ros_messages import from_joy
from crgame_ros.vehicle.driver_command import DriverCommand, RELEASED

if TYPE_CHECKING:  # The driver's process needs neither, and they take half a second to load.
    from crgame_ros.driver.replay_driver import ReplayDriver
    from crgame_ros.recording.recorded_inputs import RecordedInputs
    from crgame_ros.simulation.engine import Simulation
    from crgame_ros.simulation.setup import Setup

NS = 1e-9
# The driver that the game names, an AV's planner, and the recorded take-over of one; anything
# else names a driver of its own.
GAME = 'game'
PLANNER = 'planner'
REPLAY = 'replay'
MAX_SOURCE_LENGTH = 40
# Commands of its driver that a seat takes in one cycle.
COMMAND_DEPTH = 10
# Orders read in one cycle: a flood must not cost it.
MAX_ORDERS = 10
# A page with somebody's hands on the controls says so every 50 ms [ns].
PRESENT_NS = 500_000_000


class Seat:
    """
    One vehicle's seat: the latest command of its source, and how old it is on the steady clock.

    :param vehicle_id: whose seat.
    :param driver: who drives it by the game, a driver source or the AV's planner.
    :param home: source by which the game's driver speaks.
    :param commands: where the commands come from.
    :param clock_offset_ns: simulation time of step 0; older commands are of a run before [ns]
    :param recording: drives while nobody else has the seat, cycle by cycle, whenever that comes.
    """

    def __init__(self, vehicle_id: str, driver: str, home: str, commands: PolledSubscription,
                 clock_offset_ns: int, recording: 'ReplayDriver | None' = None) -> None:
        self.id = vehicle_id
        self.driver = driver
        self.home = home
        self.source = home
        self.commands = commands
        # Decided before a command takes a place among those of a cycle.
        commands.wanted = self._is_for_us
        self.recording = recording
        # Whether an AV is driven as it was while somebody had taken it over.
        self.taken_over_again = False
        self._where = f'/{vehicle_id}/driver_command'
        self._watchdog = SeatWatchdog()
        self._last = RELEASED
        self._heard_ns: int | None = None
        self._clock_offset_ns = clock_offset_ns
        self.malformed = 0
        self.outdated = 0
        # Commands of others, who have not got the seat.
        self.passed_over = 0

    @property
    def losses(self) -> int:
        """How often the driver has fallen silent."""
        return self._watchdog.losses

    @property
    def lost(self) -> bool:
        """Whether the driver is silent now."""
        return self._watchdog.lost and self.source != PLANNER

    @property
    def told_source(self) -> str:
        """Whose commands the vehicle obeys, as /seats says it."""
        return REPLAY if self.taken_over_again and self.source == PLANNER else self.source

    def obey(self, source: str, now_ns: int) -> None:
        """
        Take commands from another source; what was commanded last holds until it speaks.

        Not so after a loss: the pedals that the lost driver held must not come back.
        """
        if self.source == PLANNER:
            self._watchdog.reset()
            self._last = RELEASED
        elif self._watchdog.lost:
            self._last = RELEASED
        self.source = source
        self._heard_ns = now_ns

    def forgive(self, now_ns: int) -> None:
        """Count silence from now on: a pause is no loss; who was lost before it still is."""
        if self._heard_ns is not None and not self._watchdog.lost:
            self._heard_ns = now_ns

    def _is_for_us(self, stamp_ns: int, source: str) -> bool:
        if (source or GAME) != self.source:
            self.passed_over += 1
            return False
        if stamp_ns < self._clock_offset_ns:
            self.outdated += 1
            return False
        return True

    def listen(self, now_ns: int) -> bool:
        """Take the latest command that has come; tell whether there was any so far."""
        for _ in range(COMMAND_DEPTH):
            try:
                message = self.commands.take()
            except InputError:
                self.malformed += 1
                continue
            if message is None:
                break
            try:
                self._last = from_joy(message, self._where)
                self._heard_ns = now_ns
            except InputError:
                self.malformed += 1
        return self._heard_ns is not None

    @property
    def repeats_recording(self) -> bool:
        """Whether a recording drives, or will: messages are not for such a seat."""
        return self.recording is not None and self.source == self.home

    def repeats(self, n: int) -> bool:
        """Tell whether cycle n is driven as in the recording."""
        return self.recording is not None and self.repeats_recording and self.recording.drives(n)

    def awaits_driver(self, now_ns: int) -> bool:
        """Tell whether the seat is the cockpit's by the game, and no hands are on its controls."""
        if self.home != COCKPIT or self.source != COCKPIT:
            return False
        self.listen(now_ns)
        return self._heard_ns is None or now_ns - self._heard_ns > PRESENT_NS

    def command(self, now_ns: int, dt_s: float, speed: float, n: int = 0) -> DriverCommand | None:
        """
        Give the command for this cycle; released, then gentle braking, after a loss.

        :param n: the cycle, which only a recording needs to know.
        :return: None for an AV that nobody has taken over.
        """
        recording = self.recording if self.repeats_recording else None
        self.taken_over_again = self.source == PLANNER and self.repeats(n)
        if self.source == PLANNER and not self.taken_over_again:
            return None
        if recording is not None:
            self._last, self._heard_ns = recording.command(n, dt_s), now_ns
        else:
            self.listen(now_ns)
        if self._heard_ns is None:
            self._heard_ns = now_ns
        age_s = (now_ns - self._heard_ns) * NS
        return self._watchdog.filter(self._last, age_s, dt_s, speed)


class Seats:
    """
    The seats of a run, humans first, in the order of `Setup.vehicles`.

    :param endpoints: of sim_node.
    :param setup: the run.
    :param clock_offset_ns: simulation time of step 0 [ns]
    :param sources: what people ordered so far, by seat; outlives a reset.
    :param recorded: what drives seats as in a recording; None for nothing.
    """

    def __init__(self, endpoints: Endpoints, setup: 'Setup', clock_offset_ns: int,
                 sources: MutableMapping[str, str],
                 recorded: 'RecordedInputs | None' = None) -> None:
        drivers = {} if recorded is None else recorded.drivers
        self._intervals_s: list[float] = [] if recorded is None or recorded.intervals_s is None \
            else recorded.intervals_s.tolist()
        self._orders = endpoints.polled('/seats/order')
        self._sources = sources
        self.humans = [
            Seat(human.id, human.driver, _home(human.driver),
                 endpoints.polled('/<v>/driver_command', human.id, depth=SHARED_DEPTH,
                                  strict=True),
                 clock_offset_ns, drivers.get(human.id)) for human in setup.humans]
        self.avs = [
            Seat(av.id, av.spec.planner, PLANNER,
                 endpoints.polled('/<v>/driver_command', av.id, depth=SHARED_DEPTH,
                                  strict=True),
                 clock_offset_ns, drivers.get(av.id)) for av in setup.avs]
        self.all = [*self.humans, *self.avs]
        self._taken_over_again: list[bool] = []
        for seat in self.all:
            seat.source = sources.get(seat.id, seat.home)

    @property
    def slots(self) -> list[PolledSubscription]:
        """Every subscription, to release it."""
        return [self._orders, *(seat.commands for seat in self.all)]

    def listen(self, now_ns: int) -> None:
        """Take the commands that have come by now, so that the cycle has less to read."""
        for seat in self.all:
            if seat.source != PLANNER and not seat.repeats_recording:
                seat.listen(now_ns)

    def interval_s(self, n: int) -> float | None:
        """Give the interval of cycle n as recorded [s]; None where no human repeats it."""
        return self._intervals_s[n] if any(seat.repeats(n) for seat in self.humans) else None

    def commands(self, now_ns: int, dt_s: float,
                 simulation: 'Simulation') -> list[DriverCommand | None]:
        """Give the command of every seat for this cycle; None for AVs that follow their plan."""
        n = simulation.n
        return [
            *(seat.command(now_ns, dt_s, human.state.speed, n)
              for seat, human in zip(self.humans, simulation.humans, strict=True)),
            *(seat.command(now_ns, dt_s, av.state.speed, n)
              for seat, av in zip(self.avs, simulation.avs, strict=True))]

    def awaited(self, now_ns: int) -> tuple[str, ...]:
        """Name the seats whose driver must come before the run can begin."""
        return tuple(seat.id for seat in self.humans if seat.awaits_driver(now_ns))

    def document(self) -> str:
        """Write /seats."""
        return json.dumps({seat.id: {'source': seat.told_source, 'driver': seat.driver}
                           for seat in self.all})

    def repetition_changed(self) -> bool:
        """Tell whether a recorded take-over of an AV has begun or ended since the last call."""
        before = self._taken_over_again
        self._taken_over_again = [seat.taken_over_again for seat in self.avs]
        return self._taken_over_again != before and any((*before, *self._taken_over_again))

    def take_orders(self, now_ns: int) -> tuple[bool, list[str]]:
        """
        Obey the orders that have come; a flood waits its turn.

        :param now_ns: steady clock [ns]
        :return: whether anything changed, and why orders were refused
        """
        changed, refusals = False, []
        for _ in range(MAX_ORDERS):
            message = self._orders.take()
            if message is None:
                break
            try:
                changed |= self._obey(message.data, now_ns)
            except InputError as error:
                refusals.append(str(error))
        return changed, refusals

    def _obey(self, text: str, now_ns: int) -> bool:
        try:
            order = json.loads(text)
            name, source = order['seat'], order['source']
        except (ValueError, KeyError, TypeError, RecursionError) as error:
            raise InputError('is no order', '/seats/order', 'give seat and source') from error
        seat = next((item for item in self.all if item.id == name), None)
        if seat is None:
            raise InputError(f'there is no seat {str(name)[:MAX_SOURCE_LENGTH]!r}', '/seats/order',
                             'it has ' + ', '.join(item.id for item in self.all))
        if not isinstance(source, str) or not 0 < len(source) <= MAX_SOURCE_LENGTH \
                or not source.isprintable():
            raise InputError('the source is no name', '/seats/order', 'give game or a driver')
        if source == PLANNER != seat.home:
            raise InputError(f'{seat.id} has no planner', '/seats/order', 'give game')
        if source in (GAME, PLANNER):
            # Given back for good: in a game to come its own driver has the seat.
            source = seat.home
            self._sources.pop(seat.id, None)
        else:
            self._sources[seat.id] = source
        if source == seat.source:
            return False
        seat.obey(source, now_ns)
        return True


def _home(driver: str) -> str:
    """Give the source by which the driver that the game names speaks."""
    return COCKPIT if parse_source(driver).kind == COCKPIT else GAME
