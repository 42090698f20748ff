# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Time that runs back is distinguished from one or two messages of another time."""

from crgame_ros.ros.run_time import RunTime, TimeCourse

MS = 1_000_000
ON, AHEAD, BEHIND, BACK = TimeCourse.ON, TimeCourse.AHEAD, TimeCourse.BEHIND, TimeCourse.BACK


def _courses(*stamps_ms: int) -> list[TimeCourse]:
    follower = RunTime()
    return [follower.follow(stamp * MS) for stamp in stamps_ms]


def test_a_run_goes_on() -> None:
    """The run continues over steps, a repeated step, and half a second of lost ones."""
    assert _courses(5000, 5010, 5010, 5020, 5520) == [ON] * 5


def test_a_loop_runs_back() -> None:
    """The third message proves it; the following ones are normal."""
    assert _courses(9980, 9990, 0, 10, 20, 30, 40) == [ON, ON, BEHIND, BEHIND, BACK, ON, ON]


def test_messages_of_another_time_own_nothing() -> None:
    """An occasional forged message, of the past or of a far future, changes nothing."""
    assert _courses(5000, 5010, 100, 5020, 10**9, 5030, 10**9 + 1, 5040, 100, 5050) == [
        ON, ON, BEHIND, ON, AHEAD, ON, AHEAD, ON, BEHIND, ON]


def test_a_standstill_and_the_way_back_from_a_wrong_start() -> None:
    """After 30 s without messages it goes on; it recovers from a forged first message."""
    assert _courses(5000, 35_000, 35_010, 35_020, 35_030) == [ON, AHEAD, AHEAD, ON, ON]
    assert _courses(10**9, 0, 10, 20, 30) == [ON, BEHIND, BEHIND, BACK, ON]
