# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Networks of way-point lanes: from lanelets, from CSV and back, and the nearest lane."""

from pathlib import Path
import time

from crgame_ros.errors import InputError
from crgame_ros.paths import scenarios_directory
from crgame_ros.roads.network import RoadNetwork
from crgame_ros.scenario.loading import load_scenario
from crgame_ros.waypoints.lanelets import (
    graded,
    lane_of_chain,
    lanelet_chain,
    lanelet_waypoints,
)
from crgame_ros.waypoints.roads import LaneLinks, WaypointRoads
from crgame_ros.waypoints.waypoints import WaypointLane
import numpy as np
import pytest
import shapely

SHARED = Path(__file__).resolve().parents[3] / 'shared' / 'scenarios'
OWN = sorted(scenarios_directory().glob('*.xml'))
TABLE = """\
lane,x,y,width,speed_limit,successors,left
7,0.0,0.0,3.5,13.9,8 9,
7,10.0,0.5,3.25,13.9,,
8,10.0,0.5,3.25,,,9
8,20.0,0.0,0,,,

9,10.0,0.5,3.25,8.3,,
9,20.0,5.0,3.25,8.3,,
"""


def roads_of(file: Path) -> tuple[RoadNetwork, WaypointRoads]:
    """Make the roads of a map."""
    network = RoadNetwork(load_scenario(file).scenario.lanelet_network)
    return network, WaypointRoads.from_lanelets(network)


def published(name: str) -> Path:
    """Return the path of a real scenario, or skip."""
    if not (SHARED / name).exists():
        pytest.skip('the real scenarios (../shared/scenarios) are not on this machine')
    return SHARED / name


@pytest.mark.matrix('ZAM_Intersection-1_1_T-1')
@pytest.mark.slow
@pytest.mark.parametrize('file', OWN, ids=lambda file: file.stem)
def test_lanes_follow_their_lanelets(file: Path) -> None:
    """The centre is within 1 cm, widths are those of the bounds, limits those of the signs."""
    network, roads = roads_of(file)
    assert roads.lane_ids == network.lanelet_ids
    for lanelet_id in roads.lane_ids:
        lanelet = network.lanelet_network.find_lanelet_by_id(lanelet_id)
        lane = roads.lane(lanelet_id)
        s = np.linspace(0.0, lane.length, 200)
        here = lane.at(s)
        center = shapely.LineString(lanelet.center_vertices)
        points = shapely.points(np.stack((here.x, here.y), axis=-1))
        assert shapely.distance(points, center).max() < 0.01
        # Between the bounds, independently of vertices: the two distances add up to the width.
        across = sum(shapely.distance(points, shapely.LineString(bound))
                     for bound in (lanelet.left_vertices, lanelet.right_vertices))
        assert here.width == pytest.approx(across, abs=0.03)
        limit = network.speed_limit(lanelet_id)
        assert set(here.speed_limit.tolist()) == {np.inf if limit is None else limit}


@pytest.mark.matrix('ZAM_Intersection-1_1_T-1')
@pytest.mark.slow
@pytest.mark.parametrize('file', OWN, ids=lambda file: file.stem)
def test_links_are_the_lanelets_own(file: Path) -> None:
    """Successors, predecessors, and neighbours by their direction."""
    network, roads = roads_of(file)
    opposite = 0
    for lanelet in network.lanelet_network.lanelets:
        links = roads.links(lanelet.lanelet_id)
        assert list(links.successors) == lanelet.successor
        assert list(links.predecessors) == lanelet.predecessor
        for same, other, given, direction in (
                (links.left, links.oncoming_left, lanelet.adj_left,
                 lanelet.adj_left_same_direction),
                (links.right, links.oncoming_right, lanelet.adj_right,
                 lanelet.adj_right_same_direction)):
            assert (same, other) == ((given, None) if direction else (None, given))
            opposite += given is not None and not direction
    if 'Intersection' in file.stem:
        assert opposite > 0


def test_false_successors_are_left_out() -> None:
    """A lanelet named as its own successor does not follow itself (ZAM-Ramp)."""
    network, roads = roads_of(published('ZAM-Ramp-1_1-T-1.xml'))
    assert network.lanelet_network.find_lanelet_by_id(2).successor == [2]
    assert roads.successors(2) == ()
    for lanelet_id in roads.lane_ids:
        for other in roads.successors(lanelet_id):
            gap = roads.lane(other).points[0] - roads.lane(lanelet_id).points[-1]
            assert np.hypot(*gap) <= 1.0


@pytest.mark.parametrize(('name', 'bound'), [
    ('OSC_PedestrianCollision-1_1_T-1.xml', 0.35), ('DEU_Guetersloh-36_1_T-1.xml', 0.1),
    ('USA_US101-4_1_T-1.xml', 0.1)], ids=lambda value: str(value)[:7])
def test_splines_do_not_swing_out(name: str, bound: float) -> None:
    """100 m segments beside short ones and vertices 1 cm apart: a plain spline is 1.5 m off."""
    network, roads = roads_of(published(name))
    worst, plain = 0.0, 0.0
    for lanelet_id in roads.lane_ids:
        points = network.line(lanelet_id).points
        for lane in (roads.lane(lanelet_id),
                     WaypointLane(*points.T, np.ones(len(points)), np.ones(len(points)))):
            here = lane.at(np.linspace(0.0, lane.length, 1000))
            off = float(shapely.distance(shapely.points(here.x, here.y),
                                         shapely.LineString(points)).max())
            worst, plain = (max(worst, off), plain) if lane is roads.lane(lanelet_id) \
                else (worst, max(plain, off))
    assert worst < bound < plain


def test_grading_adds_way_points_to_straights_only() -> None:
    """Evenly spaced stations stay; 1 m beside 100 m gets 4 m and 16 m on either side."""
    even = np.arange(5.0)
    assert graded(even, 4.0).tolist() == even.tolist()
    assert graded(np.array([0.0, 1.0, 101.0, 102.0]), 4.0).tolist() == pytest.approx(
        [0.0, 1.0, 5.0, 21.0, 81.0, 97.0, 101.0, 102.0])


def test_a_chain_is_one_lane() -> None:
    """A lane over lanelets that follow each other has the lengths and limits of all."""
    network = RoadNetwork(load_scenario(
        scenarios_directory() / 'ZAM_Roundabout-1_1_T-1.xml').scenario.lanelet_network)
    first = next(i for i in network.lanelet_ids if network.straightest_predecessor(i) is None)
    chain = lanelet_chain(network, first, 200.0)
    assert len(chain) > 2 and chain[0] == first
    assert [network.straightest_successor(x) for x in chain[:-1]] == chain[1:]
    lane = lane_of_chain(network, chain)
    assert lane.length == pytest.approx(sum(network.line(x).length for x in chain), abs=0.05)
    path = shapely.LineString(network.lane_path(first, 200.0))
    here = lane.at(np.linspace(0.0, lane.length, 500))
    assert shapely.distance(shapely.points(here.x, here.y), path).max() < 0.05
    with pytest.raises(InputError, match='no lanelet 12345'):
        lanelet_waypoints(network, 12345)


@pytest.mark.slow
def test_nearest_lane_against_every_lane() -> None:
    """Lane, s, d and distance are those of the best of all lanes, taken one by one."""
    _, roads = roads_of(scenarios_directory() / 'ZAM_Intersection-1_1_T-1.xml')
    points = np.random.default_rng(2).uniform(-60.0, 60.0, (400, 2))
    found = roads.nearest(points)
    distances = []
    for lane in map(roads.lane, roads.lane_ids):
        at = lane.at(lane.project(points).s)
        distances.append(np.hypot(at.x - points[:, 0], at.y - points[:, 1]))
    assert found.distance == pytest.approx(np.min(distances, axis=0), abs=1e-3)
    for row in range(len(points)):
        s, d = roads.lane(int(found.lane[row])).project(points[row:row + 1])
        assert (found.s[row], found.d[row]) == pytest.approx((s[0], d[0]), abs=1e-6)


@pytest.mark.clock
def test_finding_the_lane_costs_the_logarithm_of_their_number() -> None:
    """Of 1,000 lanes instead of 10, the nearest is found in less than five times the time."""
    taken = []
    for count in (10, 1_000):
        x = np.arange(0.0, 101.0)
        roads = WaypointRoads(
            {row: WaypointLane(x, np.full(101, 4.0 * row), np.full(101, 4.0), np.full(101, 9.0))
             for row in range(count)}, {})
        points = np.random.default_rng(3).uniform(0.0, (100.0, 4.0 * count), (800, 2))
        found = roads.nearest(points)
        assert found.lane.tolist() == np.clip(np.round(points[:, 1] / 4.0), 0, count - 1).tolist()
        times = []
        for _ in range(5):
            start = time.perf_counter()
            roads.nearest(points)
            times.append(time.perf_counter() - start)
        taken.append(min(times))
    assert taken[1] / taken[0] < 5.0


def test_table_is_read(tmp_path: Path) -> None:
    """Lanes, limits that are missing, and links with the predecessors that follow from them."""
    (tmp_path / 'roads.csv').write_text(TABLE, encoding='utf-8')
    roads = WaypointRoads.from_csv(tmp_path / 'roads.csv')
    assert roads.lane_ids == (7, 8, 9)
    assert roads.links(7) == LaneLinks(successors=(8, 9))
    assert roads.links(8) == LaneLinks(predecessors=(7,), left=9)
    assert (roads.left(8), roads.right(8), roads.predecessors(9)) == (9, None, (7,))
    ends = roads.lane(8).at(np.array([0.0, 100.0]))
    assert ends.width.tolist() == [3.25, 0.0]
    assert ends.speed_limit.tolist() == [np.inf, np.inf]
    assert roads.lane(9).at(np.array([1.0])).speed_limit.tolist() == [8.3]


@pytest.mark.matrix('ZAM_Intersection-1_1_T-1')
@pytest.mark.slow
@pytest.mark.parametrize('file', OWN, ids=lambda file: file.stem)
def test_table_round_trip_keeps_every_bit(file: Path, tmp_path: Path) -> None:
    """What `to_csv` writes, `from_csv` reads: way-points, widths, limits and links."""
    _, roads = roads_of(file)
    roads.to_csv(tmp_path / 'roads.csv')
    again = WaypointRoads.from_csv(tmp_path / 'roads.csv')
    assert again.lane_ids == roads.lane_ids
    for lane in roads.lane_ids:
        assert again.lane(lane).rows.tolist() == roads.lane(lane).rows.tolist()
        assert again.links(lane) == roads.links(lane)


@pytest.mark.parametrize(('change', 'message'), [
    (('lane,x,y', 'lane,x,z'), r'line 1: there is no column "y"'),
    (('left', 'up'), r"line 1: the column 'up' is unknown"),
    (('left', 'x'), r'line 1: there are two columns "x"'),
    (('3.5,', 'nan,'), r"""line 2: "width" is 'nan'; give a finite"""),
    (('10.0,0.5,3.25,13.9,,', '1e999,0.5,3.25,13.9,,'), r"""line 3: "x" is '1e999'"""),
    (('10.0,0.5,3.25,13.9,,', '10.0,0.5,-1,13.9,,'), r"""line 3: "width" is '-1'"""),
    (('13.9,8 9', '0,8 9'), r"""line 2: "speed_limit" is '0'"""),
    (('8,10.0', '8.5,10.0'), r"line 4: '8.5' is no lane"),
    (('7,10.0,0.5,3.25,13.9,,', '7,10.0,0.5'), r'line 3: there are 3 values; give 7'),
    (('7,10.0,0.5,3.25,13.9,,\n', ''), r'line 2: lane 7 has one way-point'),
    (('9,20.0', '7,20.0'), r'line 8: lane 7 goes on after another lane'),
    (('8 9', '8 10'), r'line 2: lane 7 is linked with lane 10, which does not exist'),
    (('7,10.0,0.5,3.25,13.9,,', '7,10.0,0.5,3.25,13.9,8,'), r'line 3: links of lane 7 stand'),
    (('7,10.0,0.5', '7,0.0,0.0'), r'line 2, lane 7: all way-points are the same'),
    (('7,0.0', '7,"0.0'), r'is no CSV'),
    ((TABLE, 'lane,x,y,width,speed_limit\n'), r'there are no way-points'),
    ((TABLE, ''), r'line 1: there is no column "lane"'),
], ids=lambda value: value[:12] if isinstance(value, str) else '')
def test_bad_tables_are_refused(change: tuple[str, str], message: str, tmp_path: Path) -> None:
    """Each message names the file, the line and the error."""
    assert change[0] in TABLE
    (tmp_path / 'roads.csv').write_text(TABLE.replace(*change, 1), encoding='utf-8')
    with pytest.raises(InputError, match=message) as caught:
        WaypointRoads.from_csv(tmp_path / 'roads.csv')
    assert str(tmp_path / 'roads.csv') in str(caught.value)


def test_files_that_are_no_tables_are_refused(tmp_path: Path) -> None:
    """Missing, not text, and too large to be read at all."""
    with pytest.raises(InputError, match='cannot read the way-points'):
        WaypointRoads.from_csv(tmp_path / 'none.csv')
    file = tmp_path / 'binary.csv'
    file.write_bytes(b'\xff\xfe\x00')
    with pytest.raises(InputError, match='is no CSV'):
        WaypointRoads.from_csv(file)
    with file.open('wb') as large:
        large.truncate(33 << 20)
    with pytest.raises(InputError, match='larger than 32 MiB'):
        WaypointRoads.from_csv(file)
    with pytest.raises(InputError, match='cannot be written'):
        roads_of(OWN[0])[1].to_csv(tmp_path / 'none' / 'roads.csv')


def test_lanes_and_links_must_exist() -> None:
    """Unknown lanes are named."""
    lane = WaypointLane(np.array([0.0, 9.0]), np.zeros(2), np.ones(2), np.ones(2))
    with pytest.raises(InputError, match='lane 1 is linked with lane 2'):
        WaypointRoads({1: lane}, {1: LaneLinks(successors=(2,))})
    with pytest.raises(InputError, match='there is no lane'):
        WaypointRoads({}, {})
    with pytest.raises(InputError, match='there is no lane 5'):
        WaypointRoads({1: lane}, {}).successors(5)
