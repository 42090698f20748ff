# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The drivers of a live run: one source per seat, changed by orders on /seats/order."""

from collections.abc import Iterable, Iterator, MutableMapping
from dataclasses import replace
from typing import TYPE_CHECKING

from crgame_ros.driver.seat_state import after, GAME_DRIVER, home_of, PLANNER, REPLAY, RETURNING
from crgame_ros.driver.source import COCKPIT
from crgame_ros.driver.watchdog import SeatWatchdog
from crgame_ros.errors import InputError
from crgame_ros.game.seat_documents import (
    DRIVERS,
    DrivingSpell,
    DrivingSpells,
    MAX_SOURCE_LENGTH,
    ORDER,
    SeatEntry,
    SeatOccupant,
    SeatPerson,
    SEATS,
)
from crgame_ros.ros.endpoints import Endpoints, PolledSubscription, SHARED_DEPTH
from crgame_ros.ros.messages import from_joy
from crgame_ros.vehicle.driver_command import DriverCommand, RELEASED

if TYPE_CHECKING:
    from crgame_ros.driver.source import ReplayDriver
    from crgame_ros.recording.recorded_game import RecordedInputs
    from crgame_ros.simulation.engine import Simulation
    from crgame_ros.simulation.setup import Setup

# Further changes count as one: people change seats a few times, a flood without end.
MAX_SPELLS = 500
Driven = tuple[str, str, str, SeatPerson | None]
NS = 1e-9
# Commands of its driver that a seat reads in one cycle.
COMMAND_DEPTH = 10
# A page with a driver's hands on the controls publishes that every 50 ms [ns].
PRESENT_NS = 500_000_000


class Seat:
    """
    One vehicle's seat: the latest command of its source, and its age on the steady clock.

    :param driver: the driver by the game: a driver source or the AV's planner.
    :param home: source name of the game's driver.
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


class SeatSpells:
    """The periods of a run with one driver per seat, in the order in which they began."""

    def __init__(self, epoch: int) -> None:
        self._epoch = epoch
        self._spells: list[DrivingSpell] = []
        self._last: dict[str, DrivingSpell] = {}

    def note(self, n: int, now: Iterable[Driven]) -> None:
        """
        Note the drivers from step n on.

        :param now: seat, source, the game's driver and the person, of each seat that is driven.
        """
        driven = {item[0]: item for item in now}
        for seat, spell in list(self._last.items()):
            if driven.get(seat) != (spell.seat, spell.source, spell.driver, spell.person):
                spell.until_n = n
                del self._last[seat]
        for seat, item in driven.items():
            if seat not in self._last:
                spell = self._last[seat] = DrivingSpell(*item, n)
                if len(self._spells) < MAX_SPELLS:
                    self._spells.append(spell)
        # Nothing was driven in a period without steps.
        self._spells = [item for item in self._spells if item.until_n != item.from_n]

    def document(self) -> str:
        """Return the text of `/seats/drivers`."""
        return DRIVERS.write(DrivingSpells(self._epoch, tuple(self._spells)))


# Orders read in one cycle: a flood must not cost it.
MAX_ORDERS = 10


class Seats:
    """
    The seats of a run, humans first, in the order of `Setup.vehicles`.

    :param clock_offset_ns: simulation time of step 0 [ns]
    :param sources: ordered sources by seat; kept across resets.
    :param tenants: occupants by seat; kept across resets.
    """

    def __init__(self, endpoints: Endpoints, setup: 'Setup', clock_offset_ns: int,
                 sources: MutableMapping[str, str],
                 recorded: 'RecordedInputs | None' = None,
                 tenants: MutableMapping[str, SeatOccupant] | None = None) -> None:
        drivers = {} if recorded is None else recorded.drivers
        self._intervals_s: list[float] = [] if recorded is None or recorded.intervals_s is None \
            else recorded.intervals_s.tolist()
        self._orders = endpoints.polled('/seats/order')
        self._sources = sources
        self._tenants = {} if tenants is None else tenants

        def seat_of(vehicle: str, driver: str, home: str) -> Seat:
            commands = endpoints.polled('/<v>/driver_command', vehicle, depth=SHARED_DEPTH,
                                        strict=True)
            return Seat(vehicle, driver, home, commands, clock_offset_ns, drivers.get(vehicle))

        self.humans = [seat_of(human.id, human.driver, home_of(human.driver))
                       for human in setup.humans]
        self.avs = [seat_of(av.id, av.spec.planner, PLANNER) for av in setup.avs]
        self.all = [*self.humans, *self.avs]
        self._taken_over_again: list[bool] = []
        for seat in self.all:
            seat.source = sources.get(seat.id, seat.home)
            tenant = self._tenants.get(seat.id)
            if tenant is not None and seat.source == COCKPIT:
                # Readiness does not carry over to the next run.
                seat.tenant = replace(tenant, ready=False)

    def listen(self, now_ns: int) -> None:
        """Read the commands that have come by now, so that the cycle has less to read."""
        for seat in self.all:
            if seat.source != PLANNER and not seat.repeats_recording:
                seat.listen(now_ns)

    def interval_s(self, n: int) -> float | None:
        """Return the recorded interval of cycle n [s]; None where no human repeats it."""
        return self._intervals_s[n] if any(seat.repeats(n) for seat in self.humans) else None

    def commands(self, now_ns: int, dt_s: float,
                 simulation: 'Simulation') -> list[DriverCommand | None]:
        """Return the command of every seat for this cycle; None for AVs that follow their plan."""
        return [seat.command(now_ns, dt_s, state.speed, simulation.n)
                for seat, state in zip(self.all, simulation.states, strict=True)]

    def awaited(self, now_ns: int) -> tuple[str, ...]:
        """Return the ids of the seats whose driver must come before the run can begin."""
        return tuple(seat.id for seat in self.humans if seat.awaits_driver(now_ns))

    @property
    def cockpit_seats(self) -> list[Seat]:
        """Return the seats for people at pages that no other source drives."""
        return [seat for seat in self.humans if seat.home == seat.source == COCKPIT]

    def document(self) -> str:
        """Return the text of `/seats`."""
        return SEATS.write({seat.id: seat.entry for seat in self.all})

    def driven(self) -> Iterator[Driven]:
        """Yield the driver of each seat, except for AVs that follow their plans."""
        for seat in self.all:
            if seat.published_source != PLANNER:
                person = None if seat.tenant is None or not seat.tenant.here \
                    else seat.tenant.person
                yield seat.id, seat.published_source, seat.driver, person

    def repetition_changed(self) -> bool:
        """Return whether a recorded take-over of an AV has begun or ended since the last call."""
        before = self._taken_over_again
        self._taken_over_again = [seat.taken_over_again for seat in self.avs]
        return self._taken_over_again != before and any((*before, *self._taken_over_again))

    def apply_orders(self, now_ns: int) -> tuple[bool, list[str]]:
        """
        Apply the orders that have come; the rest of a flood waits.

        :param now_ns: steady clock [ns]
        :return: whether anything changed, and the reasons of refusals
        """
        changed, refusals = False, []
        for message in self._orders.waiting(MAX_ORDERS):
            try:
                changed |= self._obey(message.data, now_ns)
            except InputError as error:
                refusals.append(str(error))
        return changed, refusals

    def _obey(self, text: str, now_ns: int) -> bool:
        demand = ORDER.read(text)
        seat = next((item for item in self.all if item.id == demand.seat), None)
        if seat is None:
            raise InputError(f'there is no seat {demand.seat[:MAX_SOURCE_LENGTH]!r}', ORDER.topic,
                             'it has ' + ', '.join(item.id for item in self.all))
        before = seat.state
        now = after(before, demand, seat.home)
        if demand.source in RETURNING:
            # Returned for good: in the next game its own driver has the seat.
            self._sources.pop(seat.id, None)
        elif demand.source is not None and (before.source, now.source) != (COCKPIT, COCKPIT):
            self._sources[seat.id] = now.source
        if now.occupant is None:
            self._tenants.pop(seat.id, None)
        else:
            self._tenants[seat.id] = now.occupant
        seat.tenant = now.occupant
        if now.source != before.source:
            seat.obey(now.source, now_ns)
        return now != before
