# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Whether the time of a run goes on, or has begun anew, as in a recording that is played again."""

from enum import Enum
import time

from rclpy.node import Node

USUAL_NS = 1_000_000_000
# So many in a row have to agree that time is somewhere else: a single one is somebody's error.
AGREEING = 3
# Of a run whose game nobody publishes people hear after so long [s].
PATIENCE_S = 2.0


class TimeCourse(Enum):
    """
    How a message follows the ones before.

    ON as it should; AHEAD and BEHIND far from them, perhaps somebody's error; BACK proves, with
    those BEHIND just before it, that time has run back: a recording is played again.
    """

    ON = 'on'
    AHEAD = 'ahead'
    BEHIND = 'behind'
    BACK = 'back'


class RunTime:
    """
    Follows the stamps of one topic.

    :param usual_ns: how much later than the one before a message may be, without further ado [ns].
    """

    def __init__(self, usual_ns: int = USUAL_NS) -> None:
        self._usual_ns = usual_ns
        self._at_ns: int | None = None
        self._elsewhere_ns: list[int] = []

    def follow(self, stamp_ns: int) -> TimeCourse:
        """Take the stamp of the next message [ns]."""
        if self._at_ns is None or 0 <= stamp_ns - self._at_ns <= self._usual_ns:
            self._at_ns = stamp_ns
            self._elsewhere_ns.clear()
            return TimeCourse.ON
        if self._elsewhere_ns \
                and not 0 < stamp_ns - self._elsewhere_ns[-1] <= self._usual_ns:
            self._elsewhere_ns.clear()
        self._elsewhere_ns.append(stamp_ns)
        back = stamp_ns < self._at_ns
        if len(self._elsewhere_ns) < AGREEING:
            return TimeCourse.BEHIND if back else TimeCourse.AHEAD
        self._at_ns = stamp_ns
        self._elsewhere_ns.clear()
        return TimeCourse.BACK if back else TimeCourse.ON


class GameAwaited:
    """
    Says once that a run is heard of whose game is not known.

    :param node: that waits.
    :param what: it cannot do then.
    """

    def __init__(self, node: Node, what: str) -> None:
        self._node = node
        self._what = what
        self._since_s: float | None = None
        self._told = False

    def check(self, known: bool, heard: bool) -> None:
        """
        Take in how it stands.

        :param known: whether the game is.
        :param heard: whether a message of a run has come.
        """
        if known:
            self._since_s = None
        elif heard and self._since_s is None:
            self._since_s = time.monotonic()
        if self._told or self._since_s is None \
                or time.monotonic() - self._since_s < PATIENCE_S:
            return
        self._told = True
        self._node.get_logger().warning(
            f'a run is heard, but its /scenario/game is not published: {self._what}; a '
            'recording tells it at its beginning (play it without --start-offset)')
