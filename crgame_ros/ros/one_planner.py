# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The choice of one planner, where several programs answer the requests to an AV."""

from collections.abc import Callable, Mapping

# The nodes of this package that run a planner.
OWN = 'planner_node'
# Another planner takes over after answers to so many requests that the present one left open.
ANSWERED_ALONE = 2


class OnePlanner:
    """
    The publisher whose plans an AV follows.

    It stays while it answers. A program of the same name that comes later replaces it, since it
    may have been killed and started again; if both then answer, the earlier one stays.

    :param listed: returns the names of the nodes that publish the AV's plans, by publisher.
    :param own: whether the game names a planner that a node of this package runs; if there is such
        a node, it is chosen first.
    """

    def __init__(self, listed: Callable[[], Mapping[bytes, str]], own: bool) -> None:
        self._listed = listed
        self._own = own
        self._names: dict[bytes, str] = {}
        self._present: frozenset[bytes] = frozenset()
        self._looked_ns = -1
        self._chosen: bytes | None = None
        self._answered_ns = -1
        # Publishers that the chosen one has replaced, and those that answer beside it.
        self._replaced: set[bytes] = set()
        self._others: dict[bytes, set[int]] = {}

    def refusal(self, publisher: bytes, stamp_ns: int) -> str | None:
        """
        Return why a plan is not taken, None if its publisher is the chosen one.

        :param stamp_ns: of the request that it answers [ns]
        """
        if publisher != self._chosen and not self._chooses(publisher, stamp_ns):
            return f'of another planner: {self._name(publisher)} answers besides {self._rival}'
        self._answered_ns = max(stamp_ns, self._answered_ns)
        self._others.pop(publisher, None)
        return None

    def _chooses(self, publisher: bytes, stamp_ns: int) -> bool:
        """Return whether this publisher is the chosen one from now on."""
        if stamp_ns != self._looked_ns or publisher not in self._names:
            self._looked_ns = stamp_ns
            names = self._listed()
            self._names |= names
            self._present = frozenset(names)
        before = self._chosen
        if before is None and self._own and not self._is_own(publisher) \
                and any(map(self._is_own, self._present)):
            return False
        if before is None or before not in self._present:
            self._chosen = publisher
        elif publisher in self._replaced:
            # It was not gone, so there are two.
            self._replaced.remove(publisher)
            self._others[before] = set()
            self._chosen = publisher
        elif publisher not in self._others and self._name(publisher) == self._name(before):
            self._replaced.add(before)
            self._chosen = publisher
        elif self._answered_alone(publisher, stamp_ns):
            self._others[before] = set()
            self._chosen = publisher
        return self._chosen == publisher

    def _answered_alone(self, publisher: bytes, stamp_ns: int) -> bool:
        """Return whether another planner has answered requests that the chosen one has not."""
        alone = {at for at in (*self._others.get(publisher, ()), stamp_ns)
                 if at > self._answered_ns}
        self._others[publisher] = alone
        return len(alone) >= ANSWERED_ALONE

    def _is_own(self, publisher: bytes) -> bool:
        return self._names.get(publisher, '').rpartition('/')[2].startswith(OWN)

    def _name(self, publisher: bytes) -> str:
        return self._names.get(publisher, 'an unknown node')

    @property
    def _rival(self) -> str:
        """Return the name of the planner that is followed instead."""
        if self._chosen is not None:
            return self._name(self._chosen)
        return next(self._name(item) for item in self._present if self._is_own(item))
