# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Criticality of two cars in closed form, and on real maps in any placement and numbering."""

from dataclasses import replace
import json
import math
from pathlib import Path

from commonroad.scenario.lanelet import Lanelet, LaneletNetwork
from commonroad.scenario.scenario import Scenario
from crgame_ros.analysis.criticality.criticality import COLUMN, Criticality, TickMeasures
from crgame_ros.analysis.measure_command import HEAD, NEVER, replay_rows
from crgame_ros.game.game import DrivabilitySpec
from crgame_ros.game.objects import ObjectDescription, ObjectStates, Role
from crgame_ros.game.scenario_scheduler import ScenarioScheduler
from crgame_ros.geometry.rigid_transform import RigidTransform
from crgame_ros.geometry.shape import Shape
from crgame_ros.scenario.loading import load_scenario, LoadedScenario
from crgame_ros.scenario.obstacles import ScenarioObstacles
from crgame_ros.simulation.observer import ObservedRun
from crgame_ros.vehicle.state import STATE_WIDTH, StateColumn
import numpy as np
from numpy.typing import NDArray
import pytest

Array = NDArray[np.float64]
SCHEDULER = ScenarioScheduler(100_000_000, 10)


class Placement:
    """The placement of a map and its vehicles: mirrored at the x axis first, then turned."""

    def __init__(self, angle: float = 0.0, mirrored: bool = False, renumbered: bool = False,
                 offset: tuple[float, float] = (0.0, 0.0)) -> None:
        self.angle, self.mirrored, self.renumbered = angle, mirrored, renumbered
        self._offset = np.array(offset)
        self._turn = np.array(((math.cos(angle), math.sin(angle)),
                               (-math.sin(angle), math.cos(angle))))

    def vectors(self, vectors: Array) -> Array:
        """Place vectors, of two columns."""
        return np.asarray((vectors * (1.0, -1.0 if self.mirrored else 1.0)) @ self._turn)

    def points(self, points: Array) -> Array:
        """Place points, of two columns."""
        return self.vectors(points) + self._offset

    def yaw(self, yaw: Array) -> Array:
        """Place angles."""
        return (-yaw if self.mirrored else yaw) + self.angle

    def number(self, lanelet: int | None) -> int | None:
        """Return the id of a lanelet."""
        return lanelet if lanelet is None or not self.renumbered else 1_000_000 - lanelet

    def network(self, network: LaneletNetwork) -> LaneletNetwork:
        """Place a road network."""
        lanelets = [self._lanelet(each) for each in network.lanelets]
        return LaneletNetwork.create_from_lanelet_list(
            lanelets[::-1] if self.renumbered else lanelets)

    def _lanelet(self, lanelet: Lanelet) -> Lanelet:
        left, center, right = (self.points(each[:, :2]) for each in (
            lanelet.left_vertices, lanelet.center_vertices, lanelet.right_vertices))
        sides = [(self.number(lanelet.adj_left), lanelet.adj_left_same_direction),
                 (self.number(lanelet.adj_right), lanelet.adj_right_same_direction)]
        if self.mirrored:
            left, right, sides = right, left, sides[::-1]
        return Lanelet(left, center, right, self.number(lanelet.lanelet_id),
                       [self.number(each) for each in lanelet.predecessor],
                       [self.number(each) for each in lanelet.successor],
                       sides[0][0], sides[0][1], sides[1][0], sides[1][1],
                       lanelet_type=lanelet.lanelet_type)


def _car(name: str, role: Role, length: float = 4.5, width: float = 1.8) -> ObjectDescription:
    return ObjectDescription(name, 'car', role, Shape('rectangle', length, width))


def _run(loaded: LoadedScenario, vehicles: list[ObjectDescription],
         others: list[ObjectDescription]) -> ObservedRun:
    return ObservedRun(tuple(vehicles), tuple(others), loaded, SCHEDULER, DrivabilitySpec(), None,
                       (RigidTransform(),) * len(vehicles), np.zeros((len(vehicles), STATE_WIDTH)))


def _state(pose: Array, speed: float, acceleration: float) -> Array:
    state = np.zeros(STATE_WIDTH)
    state[[StateColumn.X, StateColumn.Y, StateColumn.YAW]] = pose
    state[StateColumn.SPEED], state[StateColumn.ACCELERATION] = speed, acceleration
    return state


def _lane(loaded: LoadedScenario, placement: Placement) -> LoadedScenario:
    """Replace a scenario's roads by a straight lane of 400 m."""
    x = np.linspace(0.0, 400.0, 81)
    sides = [np.column_stack((x, np.full_like(x, y))) for y in (1.75, 0.0, -1.75)]
    network = LaneletNetwork.create_from_lanelet_list([Lanelet(*sides, 7)])
    return _with_network(loaded, placement.network(network))


def _with_network(loaded: LoadedScenario, network: LaneletNetwork) -> LoadedScenario:
    scenario = Scenario(loaded.time_step_s)
    scenario.replace_lanelet_network(network)
    return replace(loaded, scenario=scenario)


@pytest.fixture(scope='module')
def cut_in(project_root: Path) -> LoadedScenario:
    """Load some scenario."""
    return load_scenario(project_root / 'scenarios' / 'ZAM_CutIn-1_1_T-1.xml')


ANGLES = [*np.radians([0.0, 45.0, 90.0, 180.0]),
          *np.random.default_rng(2).uniform(-np.pi, np.pi, 200)]


def test_two_cars_at_any_heading(cut_in: LoadedScenario) -> None:
    """20 m/s behind 10 m/s, 45.5 m between them: 4.55 s, braking with 3 m/s^2 3.10 s."""
    for angle in ANGLES:
        placement = Placement(float(angle), offset=(120.0, -40.0))
        criticality = Criticality(_run(
            _lane(cut_in, placement), [_car('av0', Role.AUTONOMOUS)],
            [_car('o1', Role.RECORDED), _car('o2', Role.RECORDED)]))
        places = placement.points(np.array([(50.0, 0.2), (100.0, -0.3), (80.0, 4.0)]))
        yaw = np.full(3, placement.yaw(np.array(0.0)))
        poses = np.column_stack((places, yaw))
        direction = placement.vectors(np.array([1.0, 0.0]))
        for n, speed in ((0, 10.3), (10, 10.0)):
            moves = np.zeros((2, 3))
            moves[0, :2], moves[1, :2] = speed * direction, 20.0 * direction
            criticality.observe(n, 0.0, _state(poses[0], 20.0, 0.0)[None],
                                ObjectStates(poses[1:], moves))
        tick, = criticality.latest
        leader, beside = tick.values
        found = {name: leader[column] for name, column in COLUMN.items()}
        assert found == pytest.approx({
            'gap': 45.5, 'time_gap': 2.275, 'thw': 2.275, 'ttc': 4.55,
            'ttc_a': (math.sqrt(373.0) - 10.0) / 3.0, 'drac': 100.0 / 91.0,
            'a_req': -200.0 / (45.5 + 50.0 / 3.0), 'ttc_2d': 4.55, 'min_distance': 45.5}, rel=1e-9)
        # In the lane beside, at the same speed: only a distance.
        assert np.isnan(beside[COLUMN['gap']]) and beside[COLUMN['drac']] == 0.0
        assert np.isinf(beside[[COLUMN[name] for name in ('ttc', 'ttc_a', 'ttc_2d')]]).all()


def test_time_exposed_while_closing_in(cut_in: LoadedScenario) -> None:
    """20 m/s behind 10 m/s, from 35.05 m to 10.05 m: below 30 m a ttc of 3 s, below 20 m 1 s."""
    criticality = Criticality(_run(_lane(cut_in, Placement()), [_car('av0', Role.AUTONOMOUS)],
                                   [_car('o1', Role.RECORDED)]))
    gaps = 35.05 - np.arange(26)
    for tick, gap in enumerate(gaps.tolist()):
        place = 50.0 + 2.0 * tick
        pose, moves = np.array([[place + gap + 4.5, 0.0, 0.0]]), np.array([[10.0, 0.0, 0.0]])
        criticality.observe(10 * tick, 0.0, _state(np.array([place, 0.0, 0.0]), 20.0, 0.0)[None],
                            ObjectStates(pose, moves))
    assert criticality.report()[0].exposures == pytest.approx({
        'tet_s': 0.1 * (gaps < 30.0).sum(), 'tit': 0.1 * np.clip(3.0 - gaps / 10.0, 0.0, 9).sum(),
        'short_time_gap_s': 0.1 * (gaps < 20.0).sum()})


@pytest.mark.parametrize('radius', [15.0, -15.0, 40.0])
def test_two_cars_on_a_bend(cut_in: LoadedScenario, radius: float) -> None:
    """
    Along the path both drive at their speeds, wherever their corners are.

    On a circle every corner of a car keeps its angular velocity. The inner front corner is the
    furthest along the path, the inner rear corner the least far.
    """
    angles = np.linspace(0.0, np.pi, 400)
    sides = [np.column_stack((abs(radius) * np.sin(angles), radius - np.sign(radius)
                              * (abs(radius) - np.sign(radius) * d) * np.cos(angles)))
             for d in (1.75, 0.0, -1.75)]
    # d is to the left: towards the centre of a left bend.
    network = LaneletNetwork.create_from_lanelet_list([Lanelet(*sides, 7)])
    criticality = Criticality(_run(_with_network(cut_in, network), [_car('av0', Role.AUTONOMOUS)],
                                   [_car('o1', Role.RECORDED)]))
    speeds = (9.0, 5.0)
    for n, lapse_s in ((0, 0.0), (10, 0.1)):
        turned = np.array([(0.4 * abs(radius) + 2.0 + speeds[0] * lapse_s) / abs(radius),
                           (0.4 * abs(radius) + 18.0 + speeds[1] * lapse_s) / abs(radius)])
        poses = np.column_stack((abs(radius) * np.sin(turned), radius * (1.0 - np.cos(turned)),
                                 np.sign(radius) * turned))
        state = _state(poses[0], speeds[0], 0.0)
        state[StateColumn.YAW_RATE] = speeds[0] / radius
        rates = np.array([(speeds[1] * np.cos(poses[1, 2]), speeds[1] * np.sin(poses[1, 2]),
                           speeds[1] / radius)])
        criticality.observe(n, 0.0, state[None], ObjectStates(poses[1:], rates))
    tick, = criticality.latest
    found = {name: tick.values[0, column] for name, column in COLUMN.items()}
    gap = abs(radius) * (turned[1] - turned[0] - 2.0 * math.atan2(2.25, abs(radius) - 0.9))
    assert found['gap'] == pytest.approx(gap, rel=1e-3)
    assert found['thw'] == pytest.approx(gap / 9.0, rel=2e-3)
    assert found['ttc'] == pytest.approx(gap / 4.0, rel=2e-3)
    assert found['drac'] == pytest.approx(8.0 / gap, rel=4e-3)


@pytest.mark.parametrize('distance', [20.0, -20.0])
@pytest.mark.parametrize('spur', [False, True], ids=['ring', 'way into a ring'])
def test_a_ring_counts_once(cut_in: LoadedScenario, distance: float, spur: bool) -> None:
    """A car 20 m ahead leads at every place of a ring of 251 m; one 20 m behind nowhere."""
    radius, tangent = 40.0, np.linspace(-60.0, 0.0, 31)
    halves = [np.linspace(start, start + np.pi, 200) for start in (0.0, np.pi)]
    lanelets = [Lanelet(*(np.column_stack(((radius - d) * np.sin(angles),
                                           radius - (radius - d) * np.cos(angles)))
                          for d in (1.75, 0.0, -1.75)), number, successor=[3 - number])
                for number, angles in enumerate(halves, start=1)]
    if spur:
        lanelets.append(Lanelet(*(np.column_stack((tangent, np.full_like(tangent, d)))
                                  for d in (1.75, 0.0, -1.75)), 3, successor=[1]))
    criticality = Criticality(_run(
        _with_network(cut_in, LaneletNetwork.create_from_lanelet_list(lanelets)),
        [_car('av0', Role.AUTONOMOUS)], [_car('o1', Role.RECORDED)]))

    def pose(s: float) -> tuple[float, float, float]:
        turned = max(s, 0.0) / radius
        return (radius * math.sin(turned) + min(s, 0.0), radius * (1.0 - math.cos(turned)), turned)

    gap = 20.0 - (2.25 if spur else 0.0) - (1 if spur else 2) * radius * math.atan2(
        2.25, radius - 0.9)
    places = np.arange(-15.0, -5.0) if spur else np.arange(0.0, 250.0, 5.0)
    for tick, s in enumerate(places.tolist()):
        criticality.observe(10 * tick, 0.0, _state(np.array(pose(s)), 5.0, 0.0)[None],
                            ObjectStates(np.array([pose(s + distance)]), np.zeros((1, 3))))
        found = criticality.latest[0].values[0, COLUMN['gap']]
        assert found == pytest.approx(gap if distance > 0.0 else math.nan, abs=0.01, nan_ok=True)


def test_the_nearest_in_the_corridor_leads(cut_in: LoadedScenario) -> None:
    """A cone that stands 10 cm into the corridor, not the car behind it, nor a wall beside."""
    cone = ObjectDescription('cone', 'unknown', Role.STATIC, Shape('circle', 0.4, 0.4))
    run = _run(_lane(cut_in, Placement()), [_car('av0', Role.AUTONOMOUS)],
               [_car('o1', Role.RECORDED), cone, _car('wall', Role.STATIC, 30.0, 0.2)])
    criticality = Criticality(run)
    poses = np.array([(100.0, 0.0, 0.0), (80.0, 0.9 + 0.25 + 0.1, 0.0), (70.0, -1.4, 0.0)])
    criticality.observe(0, 0.0, _state(np.array([50.0, 0.0, 0.0]), 10.0, 0.0)[None],
                        ObjectStates(poses, np.zeros((3, 3))))
    tick, = criticality.latest
    gaps = tick.values[:, COLUMN['gap']]
    assert np.flatnonzero(np.isfinite(gaps)).tolist() == [1]
    assert gaps[1] == pytest.approx(80.0 - 0.2 - 52.25, abs=0.01)


def test_a_closely_passed_car_does_not_lead(cut_in: LoadedScenario) -> None:
    """0.1 m beside there is no gap; a touched car there has a gap below 0, and no time left."""
    for offset, gap in ((1.9, math.nan), (1.7, -3.5)):
        criticality = Criticality(_run(_lane(cut_in, Placement()),
                                       [_car('av0', Role.AUTONOMOUS)], [_car('o1', Role.STATIC)]))
        criticality.observe(0, 0.0, _state(np.array([50.0, 0.0, 0.0]), 10.0, 0.0)[None],
                            ObjectStates(np.array([(51.0, offset, 0.0)]), np.zeros((1, 3))))
        values, = criticality.latest[0].values
        assert values[COLUMN['gap']] == pytest.approx(gap, nan_ok=True)
        assert (values[COLUMN['ttc']] == 0.0) is not math.isnan(gap)
        assert values[COLUMN['min_distance']] == pytest.approx(max(offset - 1.8, 0.0))
        # Infinite values are no JSON.
        json.dumps(found := criticality.as_dict(), allow_nan=False)
        row, = replay_rows([{'planner': 'recorded', 'criticality': found}])
        assert row[HEAD.index('a_req [m/s^2]')] == NEVER


SCENARIOS = ['DEU_Flensburg-10_1_T-1', 'DEU_Guetersloh-36_1_T-1', 'USA_Lanker-1_3_T-1',
             'USA_US101-4_1_T-1', 'ZAM_Tjunction-1_42_T-1']
SUBJECTS, STEPS = 2, 8


def _measured(loaded: LoadedScenario, placement: Placement) -> list[TickMeasures]:
    """Measure some recorded drives of a placed scenario."""
    obstacles = ScenarioObstacles(loaded)
    known = np.isfinite(obstacles.poses[:STEPS, :, 0]).all(axis=0)
    speeds = np.nan_to_num(np.hypot(*np.moveaxis(obstacles.velocities[:STEPS, :, :2], -1, 0)))
    moving = np.flatnonzero(known & (speeds.mean(axis=0) > 1.0))
    subjects = moving[:SUBJECTS].tolist()
    rest = [i for i in range(len(obstacles.descriptions)) if i not in subjects]
    described = obstacles.descriptions
    criticality = Criticality(_run(
        _with_network(loaded, placement.network(loaded.scenario.lanelet_network)),
        [replace(described[i], role=Role.AUTONOMOUS) for i in subjects],
        [_mirrored(described[i], placement) for i in rest]))
    found = []
    for k in range(STEPS):
        now = obstacles.states_at(obstacles.first_k + k)
        poses = np.column_stack((placement.points(now.poses[:, :2]),
                                 placement.yaw(now.poses[:, 2])))
        moves = np.column_stack((placement.vectors(now.velocities[:, :2]),
                                 placement.yaw(now.velocities[:, 2]) - placement.angle))
        states = np.array([_state(poses[i], float(np.hypot(*now.velocities[i, :2])), 0.5)
                           for i in subjects])
        criticality.observe(10 * k, 0.0, states, ObjectStates(poses[rest], moves[rest]))
        found += criticality.latest
    return found


def _mirrored(description: ObjectDescription, placement: Placement) -> ObjectDescription:
    shape = description.shape
    if not placement.mirrored or shape.kind != 'polygon':
        return description
    vertices = tuple((x, -y) for x, y in reversed(shape.vertices))
    return replace(description, shape=replace(shape, vertices=vertices))


@pytest.mark.matrix('USA_Lanker-1_3_T-1')
@pytest.mark.slow
@pytest.mark.parametrize('name', SCENARIOS)
def test_nothing_depends_on_the_maps_axes_or_numbers(name: str, shared_scenarios: Path) -> None:
    """Turned by eight angles, mirrored, shifted, renumbered: all values equal to 1e-9."""
    loaded = load_scenario(shared_scenarios / f'{name}.xml')
    expected = _measured(loaded, Placement())
    values = np.concatenate([tick.values for tick in expected])
    assert len(expected) == SUBJECTS * STEPS
    assert np.isfinite(values[:, COLUMN['min_distance']]).any()
    placements = [Placement(angle) for angle in np.arange(8) * math.pi / 4.0 + 0.3]
    for placement in [*placements, Placement(mirrored=True), Placement(renumbered=True),
                      Placement(1.1, mirrored=True, renumbered=True)]:
        found = np.concatenate([tick.values for tick in _measured(loaded, placement)])
        np.testing.assert_allclose(found, values, rtol=1e-9, atol=1e-9,
                                   err_msg=str(vars(placement)))
