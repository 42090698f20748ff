# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""One vehicle's seat in a live run: the latest command of its driver."""

from dataclasses import replace
from typing import TYPE_CHECKING

from crgame_ros.driver.seat_state import GAME_DRIVER, PLANNER, REPLAY
from crgame_ros.driver.source import COCKPIT
from crgame_ros.driver.watchdog import SeatWatchdog
from crgame_ros.errors import InputError
from crgame_ros.game.seat_documents import SeatEntry, SeatOccupant
from crgame_ros.ros.endpoints import PolledSubscription
from crgame_ros.ros.messages import from_joy
from crgame_ros.vehicle.driver_command import DriverCommand, RELEASED

if TYPE_CHECKING:  # The driver's process does not need it, and it takes long to load.
    from crgame_ros.driver.replay_driver import ReplayDriver

NS = 1e-9
# Commands of its driver that a seat reads in one cycle.
COMMAND_DEPTH = 10
# A page with a driver's hands on the controls publishes that every 50 ms [ns].
PRESENT_NS = 500_000_000


class Seat:
    """
    One vehicle's seat: the latest command of its source, and its age on the steady clock.

    :param vehicle_id: of the seat.
    :param driver: the driver by the game: a driver source or the AV's planner.
    :param home: source name of the game's driver.
    :param commands: subscription to the commands.
    :param clock_offset_ns: simulation time of step 0; older commands belong to a previous run [ns]
    :param recording: drives cycle by cycle while no other driver has the seat.
    """

    def __init__(self, vehicle_id: str, driver: str, home: str, commands: PolledSubscription,
                 clock_offset_ns: int, recording: 'ReplayDriver | None' = None) -> None:
        self.id = vehicle_id
        self.driver = driver
        self.home = home
        self.source = home
        self.commands = commands
        # Decided before a command counts among those of a cycle.
        commands.wanted = self._is_for_us
        self.recording = recording
        # Whether an AV repeats a recorded take-over.
        self.taken_over_again = False
        # The person that a cockpit has put into the seat.
        self.tenant: SeatOccupant | None = None
        self._where = f'/{vehicle_id}/driver_command'
        self._watchdog = SeatWatchdog()
        self._last = RELEASED
        self._heard_ns: int | None = None
        self._clock_offset_ns = clock_offset_ns
        self.malformed = 0
        self.outdated = 0
        # Number of commands from sources that do not have the seat.
        self.passed_over = 0

    @property
    def losses(self) -> int:
        """Return the number of times that the driver has fallen silent."""
        return self._watchdog.losses

    @property
    def lost(self) -> bool:
        """Return whether the driver is silent now."""
        return self._watchdog.lost and self.source != PLANNER

    @property
    def ready(self) -> bool:
        """Return whether the person in the seat is ready to begin."""
        return self.tenant is not None and self.tenant.here and self.tenant.ready

    @property
    def published_source(self) -> str:
        """Return the source that drives the vehicle, as in /seats."""
        return REPLAY if self.taken_over_again and self.source == PLANNER else self.source

    @property
    def state(self) -> SeatEntry:
        """Return who has the seat, by orders."""
        if self.tenant is None:
            return SeatEntry(self.source, self.driver)
        return SeatEntry(self.source, self.driver, self.tenant.person, self.tenant.here,
                         self.tenant.ready)

    @property
    def entry(self) -> SeatEntry:
        """Return its entry of `/seats`."""
        return replace(self.state, source=self.published_source)

    def obey(self, source: str, now_ns: int) -> None:
        """
        Accept commands from another source; the last command holds until its first one.

        After a loss it does not hold: the pedals that the lost driver held must not come back.
        """
        if self.source == PLANNER:
            self._watchdog.reset()
            self._last = RELEASED
        elif self._watchdog.lost:
            self._last = RELEASED
        self.source = source
        self._heard_ns = now_ns

    def restart_timeout(self, now_ns: int) -> None:
        """Restart the timeout: a pause is no loss; a driver lost before it remains lost."""
        if self._heard_ns is not None and not self._watchdog.lost:
            self._heard_ns = now_ns

    def _is_for_us(self, stamp_ns: int, source: str) -> bool:
        if (source or GAME_DRIVER) != self.source:
            self.passed_over += 1
            return False
        # Without a stamp, as from `ros2 topic pub`, a command is meant for now.
        if 0 < stamp_ns < self._clock_offset_ns:
            self.outdated += 1
            return False
        return True

    def listen(self, now_ns: int) -> bool:
        """Read the latest command; return whether any has come so far."""
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
        """Return whether a recording drives now or later; such a seat ignores messages."""
        return self.recording is not None and self.source == self.home

    def repeats(self, n: int) -> bool:
        """Return whether cycle n repeats the recording."""
        return self.recording is not None and self.repeats_recording and self.recording.drives(n)

    def awaits_driver(self, now_ns: int) -> bool:
        """Return whether the game gives the seat to the cockpit and its controls are untouched."""
        if self.home != COCKPIT or self.source != COCKPIT:
            return False
        self.listen(now_ns)
        return self._heard_ns is None or now_ns - self._heard_ns > PRESENT_NS

    def command(self, now_ns: int, dt_s: float, speed: float, n: int = 0) -> DriverCommand | None:
        """
        Return the command for this cycle; after a loss, released pedals, then gentle braking.

        :param n: the cycle, which only a recording needs.
        :return: None for an AV that no driver has taken over.
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
