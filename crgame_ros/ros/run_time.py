# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Detection of a run's time running back, as in a recording that is played again."""

from enum import Enum
import time

from rclpy.node import Node

USUAL_NS = 1_000_000_000
# This many stamps in a row must agree that time has jumped: a single one may be an error.
AGREEING = 3
# Time after which a run without a published game is reported [s].
PATIENCE_S = 2.0


class TimeCourse(Enum):
    """
    The relation of a message to the previous ones.

    ON is the usual case. AHEAD and BEHIND are far from them, perhaps by an error. BACK, together
    with the BEHIND just before it, proves that time has run back: a recording is played again.
    """

    ON = 'on'
    AHEAD = 'ahead'
    BEHIND = 'behind'
    BACK = 'back'


class RunTime:
    """
    The course of time in the stamps of one topic.

    :param usual_ns: largest usual time from one message to the next [ns].
    :param at_ns: where it begins; None: with the first stamp, whatever it is [ns].
    :ivar at_ns: where it is; None before the first stamp [ns].
    """

    def __init__(self, usual_ns: int = USUAL_NS, at_ns: int | None = None) -> None:
        self._usual_ns = usual_ns
        self.at_ns = at_ns
        self._elsewhere_ns: list[int] = []

    def follow(self, stamp_ns: int) -> TimeCourse:
        """Return how the stamp of the next message [ns] follows the previous ones."""
        if self.at_ns is None or 0 <= stamp_ns - self.at_ns <= self._usual_ns:
            self.at_ns = stamp_ns
            self._elsewhere_ns.clear()
            return TimeCourse.ON
        if self._elsewhere_ns \
                and not 0 < stamp_ns - self._elsewhere_ns[-1] <= self._usual_ns:
            self._elsewhere_ns.clear()
        self._elsewhere_ns.append(stamp_ns)
        back = stamp_ns < self.at_ns
        if len(self._elsewhere_ns) < AGREEING:
            return TimeCourse.BEHIND if back else TimeCourse.AHEAD
        self.at_ns = stamp_ns
        self._elsewhere_ns.clear()
        return TimeCourse.BACK if back else TimeCourse.ON


class GameAwaited:
    """
    A warning, given once, that messages of a run arrive whose game is unknown.

    :param what: what the node cannot do without the game.
    """

    def __init__(self, node: Node, what: str) -> None:
        self._node = node
        self._what = what
        self._since_s: float | None = None
        self._told = False

    def check(self, known: bool, heard: bool) -> None:
        """
        Update the state, and warn if the game is missing for too long.

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
            'recording has it at its beginning only (play it without --start-offset)')
