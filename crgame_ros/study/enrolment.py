# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Who takes part in a study, and the places in the orders that are free."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
import fcntl
import os
from pathlib import Path

from crgame_ros.errors import InputError
from crgame_ros.study.groups import Allocation, first_free
from crgame_ros.study.session_journal import read_journal, SessionEvent


@dataclass(frozen=True)
class Enrolment:
    """
    What a journal says of its participant's part in the study.

    :param participant: id.
    :param place: among all, from 0 on.
    :param dropped_out: whether the participant was excluded, or the session ended for good: the
        place is free again.
    :param allocation: to a group; None before it, and in studies without groups.
    """

    participant: str
    place: int
    dropped_out: bool = False
    allocation: Allocation | None = None


def read_enrolment(folder: Path) -> Enrolment | None:
    """Return the enrolment of the participant of a folder; None before the session has begun."""
    found: Enrolment | None = None
    for entry in read_journal(folder):
        if found is None:
            if entry['entry'] == SessionEvent.BEGUN:
                found = Enrolment(folder.name, entry['place'])
        elif entry['entry'] in (SessionEvent.ENDED, SessionEvent.EXCLUDED):
            found = Enrolment(found.participant, found.place, True, found.allocation)
        elif entry['entry'] == SessionEvent.ALLOCATED:
            found = Enrolment(found.participant, found.place, found.dropped_out,
                              allocation_of(entry))
    return found


def allocation_of(entry: dict[str, object]) -> Allocation:
    """Return the allocation that a journal's entry holds."""
    strata, slot = entry.get('strata'), entry.get('slot')
    return Allocation(str(entry['group']), int(str(entry['place'])),
                      {str(field): str(stratum) for field, stratum in strata.items()}
                      if isinstance(strata, dict) else {}, slot if isinstance(slot, int) else None)


def enrolled(participants: Path) -> list[Enrolment]:
    """
    Return all participants who have begun, in the order of their places.

    :param participants: folder with a folder of each.
    """
    paths = sorted(participants.iterdir()) if participants.is_dir() else ()
    return sorted((found for path in paths if (found := read_enrolment(path)) is not None),
                  key=lambda each: (each.place, each.participant))


def free_place(participants: Path) -> int:
    """Return the first place among all that is free, from 0 on."""
    return first_free({each.place for each in enrolled(participants) if not each.dropped_out})


@contextmanager
def enrolling(participants: Path) -> Iterator[None]:
    """
    Hold the lock of a study's participants while a place or a group is chosen and noted.

    :param participants: folder with a folder of each; must exist.
    :raises InputError: if it cannot be locked.
    """
    try:
        held = os.open(participants, os.O_RDONLY | os.O_DIRECTORY)
    except OSError as error:
        raise InputError(f'cannot be opened ({error.strerror})', str(participants),
                         'make the folder readable') from error
    try:
        # Others hold it for as long as it takes to read the journals and to add a line.
        fcntl.flock(held, fcntl.LOCK_EX)
        yield
    finally:
        os.close(held)
