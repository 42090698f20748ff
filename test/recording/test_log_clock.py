# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The times that a recording gets, while somebody sets the system clock."""

from crgame_ros.recording.writer import LogClock
import pytest

MS, S = 1_000_000, 1_000_000_000
BEGUN_NS = 1_800_000_000 * S


@pytest.mark.parametrize('set_by_ns', [-3 * S, 3 * S, -3600 * S])
def test_times_go_on_when_the_clock_is_set(set_by_ns: int) -> None:
    """Each message has the time that an unchanged clock would have shown; in any order."""
    clock = LogClock(BEGUN_NS, 5 * S)
    logged = []
    for index in range(100):
        steady_ns = 5 * S + index * 10 * MS
        wall_ns = BEGUN_NS + index * 10 * MS + (set_by_ns if index >= 50 else 0)
        # Published 2 ms and received 1 ms ago.
        logged.append(clock.times_ns(wall_ns - 2 * MS, wall_ns - MS, wall_ns, steady_ns))
    assert logged == [(BEGUN_NS + index * 10 * MS - 2 * MS, BEGUN_NS + index * 10 * MS - MS)
                      for index in range(100)]


def test_a_message_from_before_the_clock_was_set_keeps_its_place() -> None:
    """It was received by the old clock and is read by the new one."""
    for set_by_ns in (-3 * S, 3 * S):
        clock = LogClock(BEGUN_NS, 0)
        new_ns = BEGUN_NS + set_by_ns
        assert [clock.times_ns(BEGUN_NS + MS, BEGUN_NS + 2 * MS, BEGUN_NS + 3 * MS, 3 * MS),
                clock.times_ns(BEGUN_NS + 4 * MS, BEGUN_NS + 5 * MS, new_ns + 9 * MS, 9 * MS),
                clock.times_ns(new_ns + 10 * MS, new_ns + 11 * MS, new_ns + 12 * MS, 12 * MS)] == [
            (BEGUN_NS + MS, BEGUN_NS + 2 * MS), (BEGUN_NS + 4 * MS, BEGUN_NS + 5 * MS),
            (BEGUN_NS + 10 * MS, BEGUN_NS + 11 * MS)]


def test_topics_are_read_one_after_the_other() -> None:
    """A message that was received before one that has been read keeps its own time."""
    clock = LogClock(BEGUN_NS, 0)
    later = clock.times_ns(BEGUN_NS + 8 * MS, BEGUN_NS + 9 * MS, BEGUN_NS + 10 * MS, 10 * MS)
    before = clock.times_ns(BEGUN_NS + MS, BEGUN_NS + 2 * MS, BEGUN_NS + 10 * MS, 10 * MS)
    assert (before[1], later[1]) == (BEGUN_NS + 2 * MS, BEGUN_NS + 9 * MS)


def test_a_moment_between_two_looks_at_clocks_is_no_setting() -> None:
    """A process may be interrupted between reading one clock and the other."""
    clock = LogClock(BEGUN_NS, 0)
    assert clock.times_ns(BEGUN_NS, BEGUN_NS, BEGUN_NS + 60 * MS, 0)[1] == BEGUN_NS
    assert clock.times_ns(BEGUN_NS + 61 * MS, BEGUN_NS + 62 * MS, BEGUN_NS + 63 * MS,
                          63 * MS)[1] == BEGUN_NS + 62 * MS
