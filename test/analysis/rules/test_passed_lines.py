# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Red lights and stop signs on a made junction, and against the independent judge of traffic."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
import sys

from commonroad.scenario.intersection import Intersection, IntersectionIncomingElement
from commonroad.scenario.lanelet import LineMarking
from commonroad.scenario.lanelet import StopLine as FileLine
from commonroad.scenario.scenario import Scenario
from commonroad.scenario.traffic_light import (
    TrafficLight,
    TrafficLightCycle,
    TrafficLightCycleElement,
    TrafficLightDirection,
    TrafficLightState,
)
from commonroad.scenario.traffic_sign import TrafficSign, TrafficSignElement, TrafficSignIDGermany
from crgame_ros.analysis.rules.passed_lines import DrivenTrack, LineRules, PassedLine
from crgame_ros.game.traffic_spec import TrafficSpec
from crgame_ros.roads.network import RoadNetwork
from crgame_ros.roads.signs import TrafficLights
from crgame_ros.vehicle.state import STATE_WIDTH, StateColumn
from made_roads import made, Piece
import numpy as np
from numpy.typing import NDArray
import pytest
import shapely

Array = NDArray[np.float64]
STEP_S, FRONT = 0.1, 2.0
STRAIGHT_ON = [(-60.0, 0.0), (60.0, 0.0)]
TO_THE_LEFT = [(-60.0, 0.0), (5.0, 0.0), (12.0, 3.0), (15.0, 10.0), (15.0, 40.0)]
# Lane 1 ends at x = 0; 2 goes on straight, 4 turns left, 6 is beside 1, to its left.
PIECES = {1: Piece((-60.0, 0.0, 0.0), 60.0, after=(2, 4), left=6),
          2: Piece((0.0, 0.0, 0.0), 30.0, after=(3,)), 3: Piece((30.0, 0.0, 0.0), 60.0),
          4: Piece((0.0, 0.0, 0.0), 23.56, 90.0, after=(5,)),
          5: Piece((15.0, 15.0, 90.0), 60.0), 6: Piece((-60.0, 3.5, 0.0), 60.0, right=1),
          7: Piece((15.0, -60.0, 90.0), 75.0, after=(5,))}
# Red from k = 0, red-yellow from 40, green from 50, yellow from 90 to 100.
PHASES = ((TrafficLightState.RED, 40), (TrafficLightState.RED_YELLOW, 10),
          (TrafficLightState.GREEN, 40), (TrafficLightState.YELLOW, 10))


def junction(*arrows: TrafficLightDirection, line: float | None = None, sign: bool = False,
             on: bool = True, lane: int = 1, named: bool = True) -> Scenario:
    """Make it with lights or a stop sign for a lane; every second light is always green."""
    scenario = Scenario(STEP_S)
    scenario.replace_lanelet_network(made(PIECES).lanelet_network)
    network = scenario.lanelet_network
    found = network.find_lanelet_by_id(lane)
    if line is not None:
        # From the right to the left, as some files have it.
        found.stop_line = FileLine(np.array((line, -1.75)), np.array((line, 1.75)),
                                   LineMarking.SOLID)
    for number, arrow in enumerate(arrows):
        phases = PHASES if number == 0 else ((TrafficLightState.GREEN, 10),)
        network.add_traffic_light(TrafficLight(90 + number, np.zeros(2), TrafficLightCycle(
            [TrafficLightCycleElement(*phase) for phase in phases]), direction=arrow, active=on),
            {lane})
    if sign:
        network.add_traffic_sign(TrafficSign(80, [TrafficSignElement(
            TrafficSignIDGermany.STOP)], {lane}, np.zeros(2)), {lane})
    if named:
        network.add_intersection(Intersection(70, [IntersectionIncomingElement(
            71, incoming_lanelets={1}, successors_straight={2}, successors_left={4})]))
    return scenario


def track(points: Sequence[tuple[float, float]], s: Array, first_k: int = 0) -> DrivenTrack:
    """Drive along a polyline: its centre is at arc lengths (K) [m]."""
    way = shapely.LineString(points)
    place, ahead = (shapely.get_coordinates(shapely.line_interpolate_point(way, each))
                    for each in (s, s + 0.1))
    states = np.zeros((len(s), STATE_WIDTH))
    states[:, :2] = place
    states[:, StateColumn.YAW] = np.arctan2(*(ahead - place).T[::-1])
    states[:, StateColumn.SPEED] = np.gradient(s, STEP_S)
    return DrivenTrack(states, first_k + np.arange(len(s)), 0.0, FRONT)


def passed(scenario: Scenario, driven: DrivenTrack) -> tuple[PassedLine, ...]:
    return LineRules(scenario, RoadNetwork(scenario.lanelet_network)).passed(driven)


# At 10 m/s the front is at x = 0 after 5.8 s, at k = 58 of a run that begins at k = 0.
S = np.arange(100.0)


@pytest.mark.parametrize(('first_k', 'is_red'), [
    (-20, True), (-15, True), (-5, False), (15, False), (35, False), (45, True)])
def test_red_and_red_yellow_count_but_not_yellow(first_k: int, is_red: bool) -> None:
    """At k = 38, 43, 53, 73, 93 and 103: red, red-yellow, green, green, yellow, red again."""
    found = passed(junction(TrafficLightDirection.ALL), track(STRAIGHT_ON, S, first_k))
    assert [each.kind for each in found] == ['red light'] * is_red
    if is_red:
        assert found[0] == PassedLine('red light', pytest.approx(first_k + 58.0), 1, 10.0)


def test_the_line_is_where_the_file_draws_it() -> None:
    """At x = -15 the front passes at k = 43 of the track, as the light turns green."""
    scenario = junction(TrafficLightDirection.ALL, line=-15.0)
    assert len(passed(scenario, track(STRAIGHT_ON, S, 6))) == 1
    assert passed(scenario, track(STRAIGHT_ON, S, 8)) == ()
    # Without a line, a light of a lane inside the junction stands where that begins.
    inside = junction(TrafficLightDirection.ALL, lane=4)
    found, = passed(inside, track(TO_THE_LEFT, S, -30))
    assert (found.lanelet, found.k) == (4, pytest.approx(28.0))
    assert passed(inside, track(STRAIGHT_ON, S, -30)) == ()


def test_who_waits_backs_up_or_is_put_elsewhere_runs_no_light() -> None:
    scenario = junction(TrafficLightDirection.ALL)
    waits = np.minimum(S, 57.9)
    assert passed(scenario, track(STRAIGHT_ON, waits)) == ()
    backwards = track(STRAIGHT_ON, S[::-1])
    assert passed(scenario, backwards) == ()
    put = track(STRAIGHT_ON, np.concatenate((S[:40], S[70:])), -20)
    assert len(passed(scenario, put)) == 1
    assert passed(scenario, put._replace(jumps=(40,))) == ()
    # In the lane beside, nobody minds this light.
    assert passed(scenario, track([(x, 3.5) for x, _ in STRAIGHT_ON], S, -30)) == ()
    # On the line, once: it halts there, rolls back and goes on.
    halts = np.concatenate((S[:58], [58.0] * 5, [57.5, 57.5, 58.0, 58.5], S[59:]))
    assert len(passed(scenario, track(STRAIGHT_ON, halts, -40))) == 1


@pytest.mark.parametrize('named', [True, False])
def test_an_arrow_is_for_the_way_that_is_driven(named: bool) -> None:
    """The left arrow is red, the one straight on green."""
    scenario = junction(TrafficLightDirection.LEFT, TrafficLightDirection.STRAIGHT, named=named)
    found, = passed(scenario, track(TO_THE_LEFT, S, -30))
    assert (found.kind, found.k) == ('red light', pytest.approx(28.0))
    assert passed(scenario, track(STRAIGHT_ON, S, -30)) == ()
    # A run that ends on the line does not tell where the vehicle wanted to go.
    assert passed(scenario, track(TO_THE_LEFT, S[:60], -30)) == ()


@pytest.mark.parametrize(('halt', 'kinds'), [
    (None, ['stop sign']), (56.5, []), (57.9, []), (45.0, ['stop sign']), (58.5, ['stop sign'])])
def test_a_stop_sign_demands_a_halt_before_its_line(halt: float | None,
                                                    kinds: list[str]) -> None:
    """Within 4 m before x = 0; 13 m before it, as in a queue, or beyond it does not count."""
    s = S if halt is None else np.concatenate((S[S < halt], [halt] * 5, S[halt < S]))
    assert [each.kind for each in passed(junction(sign=True), track(STRAIGHT_ON, s))] == kinds


def test_a_light_that_is_on_overrules_the_sign() -> None:
    """At green nobody halts; switched off, the sign counts."""
    green, off = (junction(TrafficLightDirection.ALL, sign=True, on=on) for on in (True, False))
    assert passed(green, track(STRAIGHT_ON, S)) == ()
    assert [each.kind for each in passed(off, track(STRAIGHT_ON, S))] == ['stop sign']


@pytest.mark.slow
@pytest.mark.matrix('USA_Lanker-1_3_T-1')
@pytest.mark.parametrize('name', ['USA_Lanker-1_3_T-1', 'DEU_Starnberg-1_1_T-1'])
def test_agents_run_the_lights_that_the_judge_says(
        name: str, shared_scenarios: Path, project_root: Path,
        monkeypatch: pytest.MonkeyPatch) -> None:
    """Agents of which a third ignores lights; also with the lights' cycles moved in time."""
    path = next(shared_scenarios.rglob(f'{name}.xml'), None)
    if path is None:
        pytest.skip(f'{name} is not on this machine')
    monkeypatch.setattr(sys, 'path', [*sys.path, str(project_root / 'benchmarks')])
    from judge.lights import red_lines
    from judge.roads import JudgedRoads
    from traffic_drive import drive
    driven = drive(path, TrafficSpec(recorded='reactive', agents=15, flow=600.0,
                                     red_runners=0.3), 40.0)
    history, scenario = driven.history, driven.scenario.scenario
    rules, lights = LineRules(scenario, RoadNetwork(scenario.lanelet_network)), TrafficLights(
        scenario)
    roads, total = JudgedRoads(scenario.lanelet_network), 0
    for later in (0, 90, 180):
        ks = np.arange(len(history)) + later
        shown = np.array([[lights.states_at(int(k))[i] for i in history.light_ids] for k in ks])
        judged = {(event.ids[0], round(event.at_s / history.time_step_s))
                  for event in red_lines(replace(history, lights=shown), roads)}
        found = set()
        for life in history.lives:
            rows = slice(life.first, life.last + 1)
            if life.column < history.agents:
                states = np.zeros((life.last - life.first + 1, STATE_WIDTH))
                states[:, :3] = history.poses[rows, life.column]
                states[:, StateColumn.SPEED] = history.speed[rows, life.column]
                found |= {(history.ids[life.column], int(each.k) - later)
                          for each in rules.passed(DrivenTrack(
                              states, ks[rows], 0.0, 0.5 * float(history.length[life.column])))
                          if each.kind == 'red light'}
        assert found == judged
        total += len(found)
    assert total > 10
