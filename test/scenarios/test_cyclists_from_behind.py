# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Cyclists faster than the AV that ride into its lane from behind, at shallow angles."""

import math
from pathlib import Path

from crgame_ros.launcher.arguments import RunRequest
from crgame_ros.launcher.run_plan import effective_game, with_planners
from crgame_ros.simulation.contacts import Contact, contacts_of
from crgame_ros.simulation.offline import OfflineResult, run_offline
from crgame_ros.simulation.setup import build_setup
import pytest
from test_cyclists import DT, TICKS, write

# Of the vehicle: from rear axle to centre, and half its width [m].
REAR_TO_CENTER, HALF_WIDTH = 1.4227, 0.805
# Of the cyclist [m].
HALF_BIKE = 0.3
MEETING_S = 3.0


def ride_beside(path: Path, speed: float, ride: float, angle: float, ahead: float) -> Path:
    """
    Write a scenario whose cyclist would touch the side of an AV at constant speed after 3 s.

    :param angle: of the cyclist into the lane, from the right if positive [deg]
    :param ahead: distance ahead of the AV's centre at that time [m]
    """
    yaw, side = math.radians(angle), -math.copysign(1.0, angle)
    x = speed * MEETING_S + REAR_TO_CENTER + ahead - MEETING_S * ride * math.cos(yaw)
    y = side * (HALF_WIDTH + HALF_BIKE) - MEETING_S * ride * math.sin(yaw)
    return write(path, speed, (x, y), yaw, ride)


def drive(path: Path) -> tuple[OfflineResult, list[Contact]]:
    """Drive with `idm`; return the AV's contacts with the cyclist."""
    game = effective_game(RunRequest(scenario=path, duration_s=DT * TICKS))
    result = run_offline(with_planners(build_setup(game), ('idm',)))
    return result, [item for item in contacts_of(result)
                    if (item.vehicle_id, item.other_id) == ('av0', 'o50')]


@pytest.mark.exhaustive
@pytest.mark.parametrize('angle', [5.0, -10.0, 20.0])
@pytest.mark.parametrize(('speed', 'ride'), [(5.0, 10.0), (8.0, 10.0)])
def test_it_makes_room_for_a_cyclist_from_behind(speed: float, ride: float, angle: float,
                                                 tmp_path: Path) -> None:
    """
    It brakes in time for one beside its rear, middle or front; it once drove on at 5 to 8 m/s.

    To let in a cyclist beside its middle takes some 5 m in 3 s, 1.1 m/s^2. The remaining contact
    is a cyclist that rides into the AV's rear in its own lane, which only the cyclist can avoid.
    """
    for ahead in (-1.8, 0.0, 1.5):
        path = ride_beside(tmp_path / f'{ahead}.xml', speed, ride, angle, ahead)
        result, contacts = drive(path)
        assert [item for item in contacts if item.side != 'rear'] == [], ahead
        assert all(item.avoidable_by == ('o50',) for item in contacts)
        # It never shifts sideways: others expect it in its own lane.
        assert abs(result.states_of('av0')[:, 1]).max() < 0.05


def test_a_contact_that_no_driver_could_avoid(tmp_path: Path) -> None:
    """A cyclist beside it turns in at 20 degrees: the AV holds its lane; the verdict says so."""
    yaw = math.radians(20.0)
    start = REAR_TO_CENTER - 0.5, -(HALF_WIDTH + HALF_BIKE) - 1.5
    path = write(tmp_path / 'beside.xml', 8.0, start, yaw, 8.6)
    result, (contact,) = drive(path)
    assert contact.side == 'right'
    assert 'av0' not in contact.avoidable_by
    assert contact.verdict == 'not avoidable by braking'
    assert abs(result.states_of('av0')[:, 1]).max() < 0.05
