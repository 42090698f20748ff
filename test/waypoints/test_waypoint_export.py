# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Way-point roads as scenarios: round trips, cuts at speed limits, refusals, and a game there."""

from collections.abc import Sequence
import math
from pathlib import Path
import re

import commonroad
from crgame_ros.errors import InputError
from crgame_ros.game.game import load_game
from crgame_ros.paths import scenarios_directory
from crgame_ros.roads.network import RoadNetwork
from crgame_ros.scenario.loading import load_scenario, LoadedScenario, parse_scenario
from crgame_ros.simulation.offline import run_offline
from crgame_ros.simulation.setup import build_setup
from crgame_ros.waypoints.export import Drive, export_roads, ExportedRoads
from crgame_ros.waypoints.roads import LaneLinks, WaypointRoads
from crgame_ros.waypoints.waypoints import WaypointLane
from lxml import etree
import numpy as np
import pytest
import shapely

SCHEMA = Path(commonroad.__path__[0]) / 'scenario_definition' / 'xml_definition_files' \
    / 'XML_commonRoad_XSD.xsd'
T = np.arange(0.0, 201.0, 10.0)
S_BEND = np.stack((T, 20.0 * np.sin(T * math.pi / 100.0)), axis=-1)
NARROWING = np.interp(T, [0.0, 80.0, 120.0, 200.0], [4.0, 4.0, 3.0, 3.0])


def lane(points: Sequence[Sequence[float]] | np.ndarray, width: object = 3.5,
         limit: object = math.inf) -> WaypointLane:
    """Make a lane; one width or limit holds for all of it."""
    x, y = np.asarray(points, dtype=np.float64).T
    return WaypointLane(x, y, np.broadcast_to(np.asarray(width, dtype=np.float64), x.shape),
                        np.broadcast_to(np.asarray(limit, dtype=np.float64), x.shape))


def circle(radius: float, angle: float = 2.0 * math.pi, count: int = 25) -> np.ndarray:
    """Return points of an arc around the origin."""
    phi = np.linspace(0.0, angle, count)
    return radius * np.stack((np.cos(phi), np.sin(phi)), axis=-1)


def town() -> WaypointRoads:
    """Make an S-bend that forks, an oncoming lane without cuts, and a narrow turn."""
    away = np.array([1.0, 0.2 * math.pi]) / math.hypot(1.0, 0.2 * math.pi)
    beside = np.array([-away[1], away[0]])
    end = S_BEND[-1]
    arc = [end + 15.0 * (math.sin(a) * away + (math.cos(a) - 1.0) * beside)
           for a in np.linspace(0.0, 0.5 * math.pi, 13)]
    slope = 0.2 * math.pi * np.cos(T * math.pi / 100.0)
    normal = np.stack((-slope, np.ones_like(slope)), axis=-1) / np.hypot(1.0, slope)[:, None]
    return WaypointRoads(
        {1: lane(S_BEND, NARROWING, np.where(T < 100.0, 13.9, 8.3)),
         2: lane((S_BEND + normal * NARROWING[:, None])[::-1], NARROWING[::-1], 11.1),
         3: lane([end + s * away for s in (0.0, 30.0, 60.0)], 3.0),
         4: lane(arc, 3.0, 8.3)},
        {1: LaneLinks(successors=(3, 4), oncoming_left=2), 2: LaneLinks(oncoming_left=1),
         3: LaneLinks(predecessors=(1,)), 4: LaneLinks(predecessors=(1,))})


def network_of(exported: ExportedRoads) -> RoadNetwork:
    """Load the exported network."""
    return RoadNetwork(parse_scenario(exported.xml_text, 'x').scenario.lanelet_network)


def errors_of(exported: ExportedRoads) -> list[str]:
    """List the errors that the schema finds."""
    schema = etree.XMLSchema(etree.parse(str(SCHEMA)))
    schema.validate(etree.fromstring(exported.xml_text.encode('utf-8')))
    return [entry.message for entry in schema.error_log]


def rejoined(roads: WaypointRoads, exported: ExportedRoads, number: int) -> WaypointLane:
    """Join the lanes of the pieces of a lane, each of which begins where the last one ended."""
    rows = [roads.lane(piece).rows for piece in exported.lanelets(number)]
    return WaypointLane.from_rows(np.concatenate([*(part[:-1] for part in rows[:-1]), rows[-1]]))


@pytest.mark.matrix('ZAM_Merge-1_1_T-1')
@pytest.mark.slow
@pytest.mark.parametrize('source', ['town', 'ZAM_Roundabout-1_1_T-1', 'ZAM_Merge-1_1_T-1'])
def test_table_to_scenario_and_back(source: str, tmp_path: Path) -> None:
    """Centres and widths within 1 cm, the same limits and links, none of them lost or new."""
    if source == 'town':
        roads = town()
    else:
        found = load_scenario(scenarios_directory() / f'{source}.xml').scenario.lanelet_network
        roads = WaypointRoads.from_lanelets(RoadNetwork(found))
    roads.to_csv(tmp_path / 'roads.csv')
    exported = export_roads(WaypointRoads.from_csv(tmp_path / 'roads.csv'), 'roads')
    back = WaypointRoads.from_lanelets(network_of(exported))
    for number in roads.lane_ids:
        before, after = roads.lane(number), rejoined(back, exported, number)
        here = before.at(np.linspace(0.0, before.length - 1e-3, 500))
        points = np.stack((here.x, here.y), axis=-1)
        s, d = after.project(points)
        there = after.at(s)
        assert np.hypot(there.x - here.x, there.y - here.y).max() < 0.01
        assert there.width == pytest.approx(here.width, abs=0.01)
        # Except for a sample beside a cut, which may be on either side of it.
        cuts = after.s[1:][after.speed_limit[1:] != after.speed_limit[:-1]]
        apart = np.abs(s[:, None] - cuts).min(axis=1, initial=1.0) > 0.01
        assert there.speed_limit[apart].tolist() == here.speed_limit[apart].tolist()
        pieces, links = exported.lanelets(number), roads.links(number)
        first, last = back.links(pieces[0]), back.links(pieces[-1])
        assert first.predecessors == tuple(exported.lanelets(x)[-1] for x in links.predecessors)
        assert last.successors == tuple(exported.lanelets(x)[0] for x in links.successors)
        if len(pieces) == 1:
            assert (first.left, first.right, first.oncoming_left, first.oncoming_right) == (
                links.left, links.right, links.oncoming_left, links.oncoming_right)
    assert len(back.lane_ids) == len(exported.pieces)
    assert len(exported.pieces) == len(roads.lane_ids) + 2 * (source == 'town')


@pytest.mark.matrix('ZAM_DenseMerge-1_1_T-1')
@pytest.mark.slow
@pytest.mark.parametrize('name', ['ZAM_Intersection-1_1_T-1', 'ZAM_DenseMerge-1_1_T-1'])
def test_scenario_to_table_and_back(name: str, tmp_path: Path) -> None:
    """Every lanelet keeps its id and 99 % of the area, neighbours too, over both conversions."""
    before = load_scenario(scenarios_directory() / f'{name}.xml').scenario.lanelet_network
    WaypointRoads.from_lanelets(RoadNetwork(before)).to_csv(tmp_path / 'roads.csv')
    exported = export_roads(WaypointRoads.from_csv(tmp_path / 'roads.csv'), name)
    assert exported.benchmark_id == name
    after = network_of(exported).lanelet_network
    assert [x.lanelet_id for x in after.lanelets] == [x.lanelet_id for x in before.lanelets]
    for old, new in zip(before.lanelets, after.lanelets, strict=True):
        one, two = old.polygon.shapely_object, new.polygon.shapely_object
        assert one.intersection(two).area > 0.99 * one.union(two).area
        assert (old.successor, old.predecessor) == (new.successor, new.predecessor)
        assert (old.adj_left, old.adj_left_same_direction, old.adj_right) == (
            new.adj_left, new.adj_left_same_direction, new.adj_right)


def test_bounds_of_the_s_bend() -> None:
    """Half the width beside the analytic centre along its normal, and a cut where the limit is."""
    road = lane(S_BEND, NARROWING, np.where(T < 100.0, 13.9, 8.3))
    exported = export_roads(WaypointRoads({7: road}, {}), 'bend')
    network = network_of(exported)
    assert [(x.number, x.lane, x.speed_limit) for x in exported.pieces] == [
        (7, 7, 13.9), (8, 7, 8.3)]
    assert exported.lanelets(7) == (7, 8)
    first, second = (network.lanelet_network.find_lanelet_by_id(x) for x in (7, 8))
    assert (first.successor, second.predecessor) == ([8], [7])
    assert (network.speed_limit(7), network.speed_limit(8)) == (13.9, 8.3)
    # The cut is at the way-point: its place, and a vertex of every bound.
    assert first.center_vertices[-1] == pytest.approx(S_BEND[10], abs=1e-4)
    assert first.left_vertices[-1].tolist() == second.left_vertices[0].tolist()
    for bound, sign in ((first.left_vertices, 1.0), (second.left_vertices, 1.0),
                        (first.right_vertices, -1.0), (second.right_vertices, -1.0)):
        s, d = road.project(bound)
        assert sign * d == pytest.approx(0.5 * road.at(s).width, abs=1e-3)
        steps = np.hypot(*np.diff(bound, axis=0).T)
        assert 0.05 < steps.min() and steps.max() < 1.1
    assert network.width_at(7, 10.0) == pytest.approx(4.0, abs=1e-3)
    assert network.width_at(8, 100.0) == pytest.approx(3.0, abs=1e-3)
    # Chords stay within 3 mm of the bend: vertices are closer where it is tight.
    fine = road.at(np.linspace(0.0, road.length, 20_000))
    left = np.stack((fine.x - 0.5 * fine.width * np.sin(fine.yaw),
                     fine.y + 0.5 * fine.width * np.cos(fine.yaw)), axis=-1)
    drawn = shapely.LineString(np.concatenate((first.left_vertices, second.left_vertices[1:])))
    assert shapely.distance(shapely.points(left), drawn).max() < 0.0035


def test_tight_bends_have_more_vertices() -> None:
    """On a circle of 10 m, chords of 1 m would be 14 mm off the outer bound; the error is 3 mm."""
    road = lane(circle(10.0, 3.0, 40), 4.0)
    found, = network_of(export_roads(WaypointRoads({1: road}, {}), 'arc')).lanelet_network.lanelets
    arc = 12.0 * circle(1.0, 3.0, 20_000)
    off = shapely.distance(shapely.points(arc), shapely.LineString(found.right_vertices))
    assert off.max() < 0.0035
    assert np.hypot(*np.diff(found.right_vertices, axis=0).T).min() > 0.2


def test_links_that_one_lane_names_are_completed() -> None:
    """Successors, predecessors and neighbours, each given by one of the two lanes only."""
    roads = WaypointRoads(
        {1: lane([(0.0, 0.0), (50.0, 0.0)]), 2: lane([(50.0, 0.0), (90.0, 0.0)]),
         3: lane([(50.0, 3.5), (90.0, 3.5)]), 4: lane([(90.0, 7.0), (50.0, 7.0)]),
         5: lane([(0.0, 3.5), (50.0, 3.5)])},
        {1: LaneLinks(successors=(2,)), 2: LaneLinks(left=3), 4: LaneLinks(oncoming_left=3),
         3: LaneLinks(predecessors=(5,))})
    back = WaypointRoads.from_lanelets(network_of(export_roads(roads, 'links')))
    assert {number: back.links(number) for number in back.lane_ids} == {
        1: LaneLinks(successors=(2,)), 2: LaneLinks(predecessors=(1,), left=3),
        3: LaneLinks(predecessors=(5,), right=2, oncoming_left=4), 4: LaneLinks(oncoming_left=3),
        5: LaneLinks(successors=(3,))}


def test_neighbours_are_cut_beside_a_cut() -> None:
    """The oncoming lane of one limit is cut too, so that every lanelet has one neighbour."""
    exported = export_roads(town(), 'town')
    network = network_of(exported).lanelet_network
    (one, two), (back, front) = exported.lanelets(1), exported.lanelets(2)
    for lanelet, other in ((one, front), (two, back), (back, two), (front, one)):
        found = network.find_lanelet_by_id(lanelet)
        assert (found.adj_left, found.adj_left_same_direction) == (other, False)
        # The left bound of each is that of the other one, in the opposite direction.
        mine = shapely.LineString(found.left_vertices)
        theirs = shapely.LineString(network.find_lanelet_by_id(other).left_vertices)
        assert shapely.hausdorff_distance(mine, theirs) < 0.3
    assert {piece.speed_limit for piece in exported.pieces if piece.lane == 2} == {11.1}


def test_lanes_that_meet_do_not_gape() -> None:
    """
    Two straight lanes with 0.2 rad between them share their vertices where they meet.

    The pieces of the first do so, too; it is cut where its end is already turned.
    """
    roads = WaypointRoads({1: lane([(0.0, 0.0), (46.0, 0.0), (50.0, 0.0)], limit=(9.0, 8.0, 8.0)),
                           2: lane([(50.0, 0.0), (99.0, 10.0)])}, {1: LaneLinks(successors=(2,))})
    network = network_of(export_roads(roads, 'corner')).lanelet_network
    first, end, second = (network.find_lanelet_by_id(x) for x in (1, 3, 2))
    assert first.right_vertices[-1].tolist() == end.right_vertices[0].tolist()
    first_x, end_x = first.right_vertices[-1, 0], end.right_vertices[-1, 0]
    # The turn fades out over 7 m: 3/7 of it 4 m before the end; 1.75 m times its sine.
    assert (first_x - 46.0, end_x - 50.0) == pytest.approx(
        [1.75 * math.sin(turn * 0.5 * math.atan2(10.0, 49.0)) for turn in (3.0 / 7.0, 1.0)],
        abs=1e-4)
    assert end.right_vertices[-1].tolist() == second.right_vertices[0].tolist()
    assert end.left_vertices[-1].tolist() == second.left_vertices[0].tolist()
    # Elsewhere the bounds are those of the straights.
    assert network.find_lanelet_by_id(1).left_vertices[:40, 1].tolist() == [1.75] * 40
    assert second.predecessor == [3]


def test_a_circuit_of_one_lane() -> None:
    """A lane that follows itself becomes two lanelets that follow each other."""
    exported = export_roads(WaypointRoads({0: lane(circle(30.0))}, {0: LaneLinks((0,))}), 'ring')
    network = network_of(exported)
    assert exported.lanelets(0) == (1, 2)
    assert [network.straightest_successor(x) for x in (1, 2)] == [2, 1]
    ring = shapely.union_all([x.polygon.shapely_object
                              for x in network.lanelet_network.lanelets])
    assert ring.area == pytest.approx(2.0 * math.pi * 30.0 * 3.5, rel=2e-3)


@pytest.mark.parametrize('kind', ['urban', 'highway'])
def test_the_file(kind: str) -> None:
    """With a drive the file is valid; without one only the missing planning problem is invalid."""
    drive = Drive(1, 20.0, 8.0, 4)
    exported = export_roads(town(), 'town', kind, drive)  # type: ignore[arg-type]
    assert errors_of(exported) == []
    loaded: LoadedScenario = parse_scenario(exported.xml_text, 'x')
    assert loaded.notices == ()
    assert loaded.time_step_s == 0.1
    assert loaded.benchmark_id == exported.benchmark_id == 'ZAM_town-1_1_T-1'
    network = RoadNetwork(loaded.scenario.lanelet_network)
    assert all(network.is_drivable(x) for x in network.lanelet_ids)
    assert {item.value for x in network.lanelet_network.lanelets
            for item in x.lanelet_type} == {kind}
    problem, = loaded.planning_problems
    state = problem.initial_state
    here = town().lane(1).at(np.array([20.0]))
    assert (*state.position, state.orientation, state.velocity) == pytest.approx(
        (here.x[0], here.y[0], here.yaw[0], 8.0), abs=1e-4)
    assert state.yaw_rate == pytest.approx(8.0 * here.curvature[0], abs=1e-4)
    assert problem.goal.lanelets_of_goal_position == {0: [4]}
    alone = export_roads(town(), 'town', kind)  # type: ignore[arg-type]
    assert len(errors_of(alone)) == 1 and 'planningProblem' in errors_of(alone)[0]
    assert alone.xml_text == re.sub('<planningProblem.*</planningProblem>\n', '',
                                    exported.xml_text, flags=re.DOTALL)


def test_people_and_traffic_drive_there(tmp_path: Path) -> None:
    """A game with a human, no AV and three agents runs for 5 s; they move and stay on the road."""
    (tmp_path / 'town.xml').write_text(export_roads(town(), 'town').xml_text, encoding='utf-8')
    (tmp_path / 'town.yaml').write_text(
        'scenario: town.xml\nduration: 5\nseed: 1\navs: []\ntraffic: {agents: 3}\n'
        'humans: [{driver: idle, spawn: {lanelet: 4, s: 5.0, d: 0.0, speed: 0.0}}]\n',
        encoding='utf-8')
    setup = build_setup(load_game(tmp_path / 'town.yaml'))
    result = run_offline(setup, duration_s=5.0)
    assert len(result.vehicle_states) == 501
    assert all(item.is_valid for item in result.violations)
    poses = result.object_poses
    present = np.isfinite(poses[:, :, 0]).all(axis=0)
    assert present.sum() == 3
    moved = np.hypot(*(poses[-1, present, :2] - poses[0, present, :2]).T)
    assert moved.max() > 10.0
    network = RoadNetwork(setup.loaded.scenario.lanelet_network)
    assert (network.lanelets_at(poses[:, present].reshape(-1, 3)) >= 0).all()


def test_an_av_drives_there(tmp_path: Path) -> None:
    """Without AVs in the game the planning problem gets one, which follows the lane."""
    exported = export_roads(town(), 'town', drive=Drive(1, 20.0, 8.0, 3))
    (tmp_path / 'town.xml').write_text(exported.xml_text, encoding='utf-8')
    (tmp_path / 'town.yaml').write_text('scenario: town.xml\nhumans: []\n', encoding='utf-8')
    result = run_offline(build_setup(load_game(tmp_path / 'town.yaml')), duration_s=10.0)
    states = result.vehicle_states[:, 0]
    s, d = town().lane(1).project(states[:, :2])
    assert np.abs(d).max() < 0.5 and s[-1] > 90.0
    assert all(item.is_valid for item in result.violations)


def straight(**columns: object) -> WaypointRoads:
    """Make a straight lane of 21 way-points, 10 m apart."""
    return WaypointRoads({5: lane(np.stack((T, 0.0 * T), axis=-1), **columns)}, {})


def pair(gap: float = 0.0, **links: object) -> WaypointRoads:
    """Make two straight lanes in a row, with links of the first."""
    return WaypointRoads({5: lane([(0.0, 0.0), (50.0, 0.0)]),
                          6: lane([(50.0 + gap, 0.0), (90.0, 0.0)])},
                         {5: LaneLinks(**links)})  # type: ignore[arg-type]


FIGURE_8 = np.stack((40.0 * np.sin(np.linspace(-0.5, 4.0, 40)),
                     20.0 * np.sin(2.0 * np.linspace(-0.5, 4.0, 40))), axis=-1)


@pytest.mark.parametrize(('roads', 'message'), [
    (WaypointRoads({5: lane(circle(3.0, 4.0), 8.0)}, {}),
     r'roads\.csv, lane 5, s = \d\.\d m: the left bound turns back: the bend has a radius of '
     r'(2\.9|3\.0)\d m, and half the width is 4\.00 m'),
    (WaypointRoads({5: lane(circle(3.0, -4.0), 8.0)}, {}), 'the right bound turns back'),
    (WaypointRoads({5: lane(FIGURE_8)}, {}),
     r'lane 5, s = \d+\.\d m: the bounds meet themselves or each other'),
    (straight(width=np.where(T == 50.0, 0.0, 3.0)), r'lane 5, s = 50\.0 m: the width is 0'),
    (straight(width=0.0), r's = \d\.\d m: the width is 0'),
    (pair(successors=(6,), gap=1.5), r'lane 5: lane 6 follows lane 5, but begins 1\.5 m from its'),
    (pair(left=6, oncoming_left=6), 'lane 5: there are lane 6 and the oncoming lane 6 on its'),
    (pair(left=5), 'lane 5: it is its own neighbour on the left'),
    (WaypointRoads({5: lane([(0.0, 0.0), (1e6, 0.0)])}, {}), 'lane 5: is 1000 km long'),
    (WaypointRoads({i: lane([(0.0, 9.0 * i), (9e4, 9.0 * i)]) for i in range(7)}, {}),
     r'roads\.csv: the lanes are 630 km long together'),
    (WaypointRoads({5: WaypointLane(T, T, T + 1.0, T + 1.0, {'speed_limit': 'cubic'})}, {}),
     'lane 5: the speed limit changes gradually'),
], ids=['bend left', 'bend right', 'crossing', 'pinched', 'no width', 'gap', 'two neighbours',
        'itself', 'long', 'all long', 'cubic limit'])
def test_what_is_no_lanelet_is_refused(roads: WaypointRoads, message: str) -> None:
    """Each message names the lane, and the station if there is one."""
    with pytest.raises(InputError, match=message):
        export_roads(roads, 'roads', where='roads.csv')


def test_a_lane_may_end_in_a_point() -> None:
    """A taper to no width at the end is a lanelet like others."""
    exported = export_roads(straight(width=np.linspace(3.0, 0.0, 21)), 'taper')
    lanelet, = network_of(exported).lanelet_network.lanelets
    assert lanelet.polygon.shapely_object.area == pytest.approx(300.0, rel=1e-3)


@pytest.mark.parametrize(('drive', 'message'), [
    (Drive(9, 0.0, 0.0, 1), '--start: there is no lane 9'),
    (Drive(1, 0.0, 0.0, 9), '--goal: there is no lane 9'),
    (Drive(3, 61.0, 0.0, 3), r'--start: the station 61 m is not on lane 3; give 0 to 60\.0 m'),
    (Drive(1, 0.0, -1.0, 3), '--start: the speed is -1 m/s'),
    (Drive(3, 0.0, 0.0, 4), '--goal: no way leads from lane 3 to lane 4')],
    ids=['start', 'goal', 'station', 'speed', 'way'])
def test_drives_that_cannot_be(drive: Drive, message: str) -> None:
    """A planning problem that no planner can solve is refused."""
    with pytest.raises(InputError, match=message):
        export_roads(town(), 'town', drive=drive)
