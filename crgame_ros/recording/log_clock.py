# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The times at which a recorder logs messages, while somebody may set the system clock."""

# Messages are read by then after their reception, if the recorder keeps up [ns].
RECENT_NS = 1_000_000_000
# The system clock has been set if it differs by more than this from where it was [ns].
SET_NS = 100_000_000


class LogClock:
    """
    The times at which messages are logged, as if nobody had set the system clock.

    :param wall_ns: system time now [ns since 1970]
    :param steady_ns: the steady clock now [ns]
    """

    def __init__(self, wall_ns: int, steady_ns: int) -> None:
        self._begun_ns = wall_ns - steady_ns
        # By how much the system clock has been set since: now, and before it was set last.
        self._set_by_ns = self._before_ns = 0

    def now_ns(self, steady_ns: int) -> int:
        """Return the time now, as if nobody had set the system clock [ns since 1970]."""
        return self._begun_ns + steady_ns

    def times_ns(self, published_ns: int, received_ns: int, wall_ns: int,
                 steady_ns: int) -> tuple[int, int]:
        """
        Return the times of publication and reception that are to be logged [ns since 1970].

        :param wall_ns: system time now [ns since 1970]
        :param steady_ns: the steady clock now [ns]
        """
        now_ns = self.now_ns(steady_ns)
        # This process may be interrupted for a moment between two looks at clocks.
        if abs(wall_ns - now_ns - self._set_by_ns) > SET_NS:
            self._before_ns, self._set_by_ns = self._set_by_ns, wall_ns - now_ns
        set_by_ns = self._set_by_ns
        # A message that is read just after the clock was set was received before.
        if not self._is_recent(received_ns - set_by_ns, now_ns) \
                and self._is_recent(received_ns - self._before_ns, now_ns):
            set_by_ns = self._before_ns
        logged_ns = min(received_ns - set_by_ns, now_ns)
        return min(published_ns - set_by_ns, logged_ns), logged_ns

    @staticmethod
    def _is_recent(time_ns: int, now_ns: int) -> bool:
        return now_ns - RECENT_NS <= time_ns <= now_ns
