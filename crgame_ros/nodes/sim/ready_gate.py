# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""When a run with drivers in cockpits begins: all are there and ready, after a countdown."""

import math

from crgame_ros.nodes.sim.sim_control import SimControl
from crgame_ros.ros.seats import Seats

NS_PER_S = 1_000_000_000


class ReadyGate:
    """
    Holds a run at its first step for the people who will drive it from a page.

    It begins when all of them have said that they are ready, or somebody starts it for all; in
    either case once all have their hands on the controls, and after a countdown. Who lets go
    during it stops it. A game without such drivers does not wait here.

    :param seats: of the run.
    :param control: orders from outside; told who is awaited, and the countdown.
    """

    def __init__(self, seats: Seats, control: SimControl) -> None:
        self._seats = seats
        self._control = control
        self._began_ns: int | None = None
        self._by_all = False

    def opens(self, now_ns: int, others_ready: bool) -> bool:
        """
        Return whether the run begins now.

        :param now_ns: steady clock [ns]
        :param others_ready: whether planners, traffic and devices are.
        """
        control = self._control
        control.awaited = self._seats.awaited(now_ns)
        self._take_readiness()
        begins = others_ready and not control.awaited and not control.stands_still
        # A step that is ordered during a pause is one at once.
        if not begins or control.paused or not self._seats.of_cockpits:
            self._began_ns, control.countdown_s = None, 0
            return begins
        if self._began_ns is None:
            self._began_ns = now_ns
        left_s = control.countdown_from_s - (now_ns - self._began_ns) / NS_PER_S
        control.countdown_s = max(0, math.ceil(left_s))
        return left_s <= 0.0

    def _take_readiness(self) -> None:
        """Start when all are ready, and no longer when one of them has thought better of it."""
        control, seats = self._control, self._seats.of_cockpits
        ready = bool(seats) and all(seat.ready for seat in seats)
        if ready and not control.started:
            control.paused, control.started, self._by_all = False, True, True
        elif self._by_all and not ready:
            control.paused, control.started, self._by_all = True, False, False
