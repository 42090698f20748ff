# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Who drove each seat of a run, from which step to which."""

from collections.abc import Iterable

from crgame_ros.game.seat_documents import DrivingSpell, SeatPerson, spells_document

# Further changes are told as one: people change seats a few times, a flood does it for ever.
MAX_SPELLS = 500
Driven = tuple[str, str, str, SeatPerson | None]


class SeatSpells:
    """
    The stretches of a run, in the order in which they began.

    :param epoch: of the run.
    """

    def __init__(self, epoch: int) -> None:
        self._epoch = epoch
        self._spells: list[DrivingSpell] = []
        self._last: dict[str, DrivingSpell] = {}

    def note(self, n: int, now: Iterable[Driven]) -> None:
        """
        Take who drives from step n on.

        :param now: seat, source, the game's driver and the person, of each seat that is driven.
        """
        driven = {item[0]: item for item in now}
        for seat, spell in list(self._last.items()):
            if driven.get(seat) != (spell.seat, spell.source, spell.driver, spell.person):
                spell.until_n = n
                del self._last[seat]
        for seat, item in driven.items():
            if seat not in self._last:
                self._begin(seat, DrivingSpell(*item, n))
        # Nothing was driven in a stretch of no steps.
        self._spells = [item for item in self._spells if item.until_n != item.from_n]

    def document(self) -> str:
        """Write `/seats/drivers`."""
        return spells_document(self._epoch, self._spells)

    def _begin(self, seat: str, spell: DrivingSpell) -> None:
        if len(self._spells) < MAX_SPELLS:
            self._spells.append(spell)
        self._last[seat] = spell
