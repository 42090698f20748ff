# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The AVs' part in contacts of published scenarios."""

from pathlib import Path

from crgame_ros.game.game import AvSpec, Game, HumanSpec
from crgame_ros.game.objects import Role
from crgame_ros.simulation.contacts import contacts_of
from crgame_ros.simulation.offline import run_offline
from crgame_ros.simulation.setup import build_setup
import pytest


@pytest.mark.parametrize(('name', 'side', 'kind', 'able', 'duration_s'), [
    ('DEU_Test-1_1_T-1', 'rear', 'rear', 'o6', 4.0),
    ('ZAM_Over-1_1', 'front', 'stopped track', 'av0', 4.0)])
def test_contact_of_a_blind_driver(name: str, side: str, kind: str, able: str, duration_s: float,
                                   shared_scenarios: Path) -> None:
    """A recorded car runs into a slow AV; a blind AV runs into a standing obstacle."""
    planner = 'idm' if side == 'rear' else 'constant-velocity'
    setup = build_setup(Game(shared_scenarios / f'{name}.xml', humans=(HumanSpec('hv0', 'idle'),),
                             avs=(AvSpec('av0', planner=planner),)))
    found = contacts_of(run_offline(setup, duration_s=duration_s))
    contact = next(item for item in found if item.other_role is not Role.HUMAN)
    assert (contact.side, contact.kind, contact.avoidable_by) == (side, kind, (able,))
    assert ('does not react' in contact.verdict) is (contact.other_role is Role.RECORDED)
