# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""One vehicle's seat in a live run: the latest command of whoever drives it."""

from typing import TYPE_CHECKING

from crgame_ros.driver.source import COCKPIT
from crgame_ros.driver.watchdog import SeatWatchdog
from crgame_ros.errors import InputError
from crgame_ros.game.seat_documents import SeatOccupant
from crgame_ros.ros.endpoints import PolledSubscription
from crgame_ros.ros.messages import from_joy
from crgame_ros.vehicle.driver_command import DriverCommand, RELEASED

if TYPE_CHECKING:  # The driver's process needs it not, and it takes long to load.
    from crgame_ros.driver.replay_driver import ReplayDriver

NS = 1e-9
# The driver that the game names, an AV's planner, and the recorded take-over of one; anything
# else names a driver of its own.
GAME = 'game'
PLANNER = 'planner'
REPLAY = 'replay'
# Commands of its driver that a seat takes in one cycle.
COMMAND_DEPTH = 10
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
        # Whom a cockpit has put into the seat.
        self.tenant: SeatOccupant | None = None
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
    def ready(self) -> bool:
        """Whether the person in the seat is ready to begin."""
        return self.tenant is not None and self.tenant.here and self.tenant.ready

    @property
    def published_source(self) -> str:
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

    def restart_timeout(self, now_ns: int) -> None:
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
                message = self.commands.pop()
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
        """Return whether cycle n is driven as in the recording."""
        return self.recording is not None and self.repeats_recording and self.recording.drives(n)

    def awaits_driver(self, now_ns: int) -> bool:
        """Return whether the game gives the seat to the cockpit and its controls are untouched."""
        if self.home != COCKPIT or self.source != COCKPIT:
            return False
        self.listen(now_ns)
        return self._heard_ns is None or now_ns - self._heard_ns > PRESENT_NS

    def command(self, now_ns: int, dt_s: float, speed: float, n: int = 0) -> DriverCommand | None:
        """
        Return the command for this cycle; released, then gentle braking, after a loss.

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
