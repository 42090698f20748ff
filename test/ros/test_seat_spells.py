# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The drivers of a seat, with first and last step."""

from crgame_ros.errors import InputError
from crgame_ros.game.seat_documents import DRIVERS, DrivingSpell, SeatPerson
from crgame_ros.ros.seats import MAX_SPELLS, SeatSpells
import pytest

ADA, BOB = SeatPerson('p1', 'Ada', 'Keyboard'), SeatPerson('p2', 'Bob', 'G29')


def driven(person: SeatPerson | None) -> tuple[str, str, str, SeatPerson | None]:
    """Return a seat of a cockpit with a driver."""
    return 'hv0', 'cockpit', 'cockpit', person


def test_each_stretch_has_its_steps() -> None:
    """Two drivers in turn, with an AV taken over in between; the last stretch is open."""
    spells = SeatSpells(3)
    spells.note(0, [driven(None)])
    # Before the first step: a stretch without steps has no driver.
    spells.note(0, [driven(ADA)])
    spells.note(40, [driven(ADA), ('av0', 'cockpit', 'idm', BOB)])
    spells.note(70, [driven(ADA)])
    spells.note(90, [driven(BOB)])
    told = DRIVERS.read(spells.document())
    assert told.epoch == 3 and told.drivers == (
        DrivingSpell('hv0', 'cockpit', 'cockpit', ADA, 0, 90),
        DrivingSpell('av0', 'cockpit', 'idm', BOB, 40, 70),
        DrivingSpell('hv0', 'cockpit', 'cockpit', BOB, 90))


def test_a_flood_of_changes_is_bounded() -> None:
    """Any peer may order a seat ten times a cycle."""
    spells = SeatSpells(0)
    for n in range(2 * MAX_SPELLS):
        spells.note(n, [driven(ADA if n % 2 else BOB)])
    assert len(DRIVERS.read(spells.document()).drivers) == MAX_SPELLS


@pytest.mark.parametrize('text', [
    '', '[]', '{"epoch": 0}', '{"epoch": 0, "drivers": [{"seat": "hv0"}]}',
    '{"epoch": 0, "drivers": [{"seat": "x", "source": "", "driver": "", "person": null, '
    '"from_n": 0, "until_n": null}]}'])
def test_what_is_no_such_document_is_refused(text: str) -> None:
    """Recordings hold what any peer has published."""
    with pytest.raises(InputError, match='/seats/drivers: is no list of drivers'):
        DRIVERS.read(text)
