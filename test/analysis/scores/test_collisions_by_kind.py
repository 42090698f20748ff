# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Collisions by kind and fault, and that the names agree with those of the contacts."""

import math
from pathlib import Path
import sys

from crgame_ros.analysis.scores.collisions_by_kind import find_collisions
from crgame_ros.analysis.scores.route_progress import find_lanes
from crgame_ros.analysis.scores.scored_drive import kind_of_type, ScoredDrive, Track
from crgame_ros.drivability.contact import Course, kind_of, touched_side
from crgame_ros.roads.network import RoadNetwork
import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))

from score_roads import drive, road, track  # noqa: E402, I100

CASES = {
    'stopped ego': (drive(0.0), track(-5.0, 40.0), 'stopped ego', False),
    'stopped track': (drive(10.0), track(0.0, 40.0), 'stopped track', True),
    'front': (drive(10.0), track(3.0, 40.0), 'active front', True),
    'rear': (drive(3.0, start=60.0), track(10.0, 40.0), 'rear', False),
    'side, in lane': (drive(5.0), track(5.0, 22.0, y=7.0, yaw=-math.pi / 2.0), 'lateral', False),
    'side, between lanes': (drive(5.0, y=1.75), track(5.0, 22.0, y=8.0, yaw=-math.pi / 2.0),
                            'lateral', True),
}


@pytest.fixture(scope='module')
def roads() -> RoadNetwork:
    """Return the straight road."""
    return RoadNetwork(road().scenario.lanelet_network)


@pytest.mark.parametrize('case', CASES)
def test_kinds_and_faults(roads: RoadNetwork, case: str) -> None:
    """One of each kind; at fault as nuPlan says."""
    mine, other, kind, at_fault = CASES[case]
    mine = ScoredDrive(mine.vehicle_id, mine.dt_s, mine.shape, 1.4, mine.poses, mine.speeds,
                       (other,))
    found, = find_collisions(mine, find_lanes(roads, mine))
    assert (found.kind, found.at_fault, found.other_id) == (kind, at_fault, 'o1')
    # The contacts of runs are named by the side that was touched; here both ways agree.
    own, theirs = (Course(each.shape, each.poses, each.speeds, 0.0, 0.0)
                   for each in (mine, other))
    assert kind_of(float(mine.speeds[found.step]), float(other.speeds[found.step]),
                   touched_side(own, theirs, found.step)) == kind


def test_the_first_touch_is_found(roads: RoadNetwork) -> None:
    """A gap of 30.5 m less 4.5 m closes with 7 m/s within 3.714 s: at the step of 3.8 s."""
    mine = drive(10.0, track(3.0, 50.5), track(3.0, 50.5, y=3.5, name='o2'))
    found, = find_collisions(mine, find_lanes(roads, mine))
    assert found.other_id == 'o1' and found.step == 38
    assert found.time_s == pytest.approx(3.8)


def test_an_absent_vehicle_is_not_touched(roads: RoadNetwork) -> None:
    """A vehicle without a pose is absent."""
    gone = track(0.0, 40.0)
    gone.poses[:45] = np.nan
    mine = drive(10.0, Track('o1', 'vehicle', gone.shape, gone.poses, gone.speeds))
    assert find_collisions(mine, find_lanes(roads, mine)) == ()


def test_types_are_grouped_as_nuplan_does() -> None:
    """Pedestrians and bicycles are vulnerable; non-driving things are objects."""
    assert kind_of_type('pedestrian') == kind_of_type('bicycle') == 'vulnerable'
    assert kind_of_type('constructionZone') == kind_of_type('pillar') == 'object'
    assert kind_of_type('truck') == kind_of_type('unknown') == 'vehicle'


def test_lanes(roads: RoadNetwork) -> None:
    """Within a lane, and astride two; off the road there is none."""
    inside, astride, off = (find_lanes(roads, drive(y=y)) for y in (0.0, 1.75, -9.0))
    assert inside.in_one_lane.all() and (inside.lanelets == 1).all()
    assert not astride.in_one_lane.any()
    assert (off.lanelets == -1).all() and not off.in_one_lane.any()
    assert not inside.in_intersection.any()
