# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Scenarios far from the origin, torn apart or enlarged: the same run, or a one-line refusal."""

from pathlib import Path
import re
import time

from crgame_ros.cli import main
from crgame_ros.driver.source import ReplayDriver
from crgame_ros.errors import InputError
from crgame_ros.game.game import load_game
from crgame_ros.paths import scenarios_directory
from crgame_ros.scenario import guard
from crgame_ros.simulation.offline import OfflineResult, run_offline
from crgame_ros.simulation.setup import build_setup, Setup
from lxml import etree
import numpy as np
import pytest

# Munich in UTM zone 32 [m]. An occupancy map has a fixed grid of cells, so it is the same map
# only if it is moved by whole tiles.
OFFSET = np.array((691_234.37, 5_512_345.68))
TILES = np.array((691_200.0, 5_512_300.0))
GAME = """\
scenario: {scenario}
humans: [{{id: hv0, driver: idle}}]
avs: [{{id: av0, planner: {planner}}}]
traffic: {{agents: 4, capacity: 4}}
{rest}"""


def edited(folder: Path, name: str, scale: float = 1.0, offset: np.ndarray = OFFSET,
           lanelet: int | None = None) -> Path:
    """Write a scenario of the package with all coordinates changed, or those of one lanelet."""
    root = etree.parse(scenarios_directory() / name).getroot()
    scopes = [root] if lanelet is None else [root.findall('lanelet')[lanelet]]
    for scope in scopes:
        for node in scope.iter('x', 'y'):
            # Coordinates of shapes are relative to their obstacle.
            if not any(above.tag == 'shape' for above in node.iterancestors()):
                node.text = repr(scale * float(node.text) + float(offset[int(node.tag == 'y')]))
    path = folder / 'scenario.xml'
    etree.ElementTree(root).write(path)
    return path


def setup_of(scenario: Path, planner: str = 'idm', rest: str = '') -> Setup:
    """Place a game on a scenario."""
    game = scenario.with_name('game.yaml')
    game.write_text(GAME.format(scenario=scenario.name, planner=planner, rest=rest))
    return build_setup(load_game(game))


def run(scenario: Path, planner: str, with_map: bool) -> OfflineResult:
    """Drive among agents and over the curb, which is in the occupancy map, if there is one."""
    if with_map:
        assert main(['rasterize', str(scenario), str(scenario.parent / 'map')]) == 0
    setup = setup_of(scenario, planner, 'occupancy: map\n' if with_map else '')
    commands = np.zeros((150, 4))
    commands[:, 0], commands[:, 2] = 0.8, -0.4
    return run_offline(setup, duration_s=1.5, drivers={'hv0': ReplayDriver(commands)})


@pytest.mark.slow
@pytest.mark.matrix
@pytest.mark.parametrize(('name', 'planner', 'offset', 'with_map'), [
    ('ZAM_Crossing-1_1_T-1.xml', 'idm', OFFSET, False),
    ('ZAM_CutIn-1_1_T-1.xml', 'reactive', TILES, True)])
def test_a_run_far_from_the_origin_is_the_run_at_the_origin(
        name: str, planner: str, offset: np.ndarray, with_map: bool, tmp_path: Path) -> None:
    """
    Planner, traffic, collisions and the occupancy map give the same run, moved.

    At 5.5e6 m a float is exact to 1e-9 m. Curvatures are second differences over 0.25 m, steering
    rates their derivatives over 0.01 s: 1e-9 m becomes 1e-4, and 1e-5 m in the position, at most.
    """
    results = []
    for place, moved in (('here', np.zeros(2)), ('there', offset)):
        (tmp_path / place).mkdir()
        results.append(run(edited(tmp_path / place, name, offset=moved), planner, with_map))
    here, there = results
    for before, after in ((here.vehicle_states, there.vehicle_states),
                          (here.object_poses, there.object_poses)):
        assert before.shape == after.shape and before.size
        assert np.array_equal(np.isnan(before), np.isnan(after))
        apart = after - before
        apart[..., :2] -= offset
        apart[..., 2] = np.angle(np.exp(1j * apart[..., 2]))
        assert np.nanmax(np.abs(apart[..., :4])) < 1e-5
        assert np.nanmax(np.abs(apart)) < 1e-4
    assert here.violations == there.violations
    assert with_map == any(item.collision for item in here.violations)
    assert here.planners['av0'].counters == there.planners['av0'].counters


@pytest.mark.matrix('idm-1')
@pytest.mark.slow
@pytest.mark.parametrize('lanelet', [0, 1, 2])
@pytest.mark.parametrize('planner', ['idm', 'reactive', 'constant-velocity'])
def test_a_lanelet_far_away_is_no_way_to_drive_on(
        planner: str, lanelet: int, tmp_path: Path) -> None:
    """A route over it would be sampled every 0.25 m over 5,500 km: 8 GB."""
    start_s = time.process_time()
    setup = setup_of(edited(tmp_path, 'ZAM_Crossing-1_1_T-1.xml', lanelet=lanelet), planner)
    assert any('links of lanelets more than 1000 m apart are ignored, the widest, 55' in notice
               for notice in setup.notices)
    result = run_offline(setup, duration_s=0.3)
    assert np.isfinite(result.vehicle_states[:, :, :4]).all()
    assert time.process_time() - start_s < 10.0


def test_thousands_of_kilometres_of_lanes_have_no_traffic(tmp_path: Path) -> None:
    """Tables of lanes grow with their length; without traffic there are no tables."""
    scenario = edited(tmp_path, 'ZAM_Intersection-1_1_T-1.xml', 300.0, np.zeros(2))
    start_s = time.process_time()
    with pytest.raises(InputError, match='km of lanes are more than 600 km; use a part of'):
        setup_of(scenario)
    assert time.process_time() - start_s < 10.0


def refused(scenario: Path, pattern: str, replacement: str) -> str:
    """Change one of the package's scenarios, and return its refusal."""
    text = (scenarios_directory() / 'ZAM_Crossing-1_1_T-1.xml').read_text()
    changed, count = re.subn(pattern, replacement, text, count=1, flags=re.DOTALL)
    assert count == 1
    scenario.write_text(changed)
    start_s = time.process_time()
    with pytest.raises(InputError) as caught:
        setup_of(scenario)
    assert time.process_time() - start_s < 5.0
    told = str(caught.value)
    assert scenario.name in told and len(told) < 500
    return told


@pytest.mark.parametrize('speed', ['1e6', '1e9', '-1e6', '201'])
def test_an_initial_speed_of_no_vehicle_is_refused(speed: str, tmp_path: Path) -> None:
    """At 1e9 m/s the search for places behind the AV took 2 million kilometres: 149 GiB."""
    told = refused(tmp_path / 's.xml', r'(<planningProblem.*?<velocity>\s*<exact>)[^<]*',
                   rf'\g<1>{speed}')
    assert 'planningProblem' in told and 'm/s; give one between -200 and 200 m/s' in told


def test_time_steps_of_a_millisecond_are_refused(tmp_path: Path) -> None:
    """Every plan of 3 s would have 3000 states: 0.5 s took 33 s. Published ones: 0.04 to 0.2 s."""
    told = refused(tmp_path / 's.xml', 'timeStepSize="[^"]*"', 'timeStepSize="0.001"')
    assert "timeStepSize is '0.001'; give seconds from 0.01 to 10" in told


@pytest.mark.exhaustive
def test_bounds_of_thousands_of_points_that_cross_are_refused(tmp_path: Path) -> None:
    """A surface of 20,000 unordered points took gigabytes; in order they are a road."""
    root = etree.parse(scenarios_directory() / 'ZAM_Crossing-1_1_T-1.xml').getroot()
    for order, wanted in ((slice(None), ''), (slice(None, None, -1), 'cross themselves')):
        lanelet = root.find('lanelet')
        for bound in (lanelet.find('leftBound'), lanelet.find('rightBound')):
            points = bound.findall('point')
            ends = np.array([[float(point.find(axis).text) for axis in 'xy']
                             for point in (points[0], points[-1])])
            share = np.linspace(0.0, 1.0, 5000)
            # Unordered: every second piece of three points is reversed.
            share = np.concatenate([piece[order] if number % 2 else piece
                                    for number, piece in enumerate(np.split(share, 1250))])
            for point in points:
                bound.remove(point)
            for x, y in (1.0 - share)[:, None] * ends[0] + share[:, None] * ends[1]:
                point = etree.SubElement(bound, 'point')
                etree.SubElement(point, 'x').text = repr(float(x))
                etree.SubElement(point, 'y').text = repr(float(y))
        path = tmp_path / 's.xml'
        etree.ElementTree(root).write(path)
        if not wanted:
            assert setup_of(path).network.lanelet_ids
            continue
        with pytest.raises(InputError, match=r'bounds of 5000 points cross themselves'):
            setup_of(path)


def test_bounds_of_too_many_points_are_refused(
        tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """All bounds count; 200,000 points are ten times the largest published map, read in 6 s."""
    assert guard.MAX_POINTS == 200_000
    root = etree.parse(scenarios_directory() / 'ZAM_Crossing-1_1_T-1.xml').getroot()
    count = sum(len(lanelet.findall(f'{bound}/point')) for lanelet in root.findall('lanelet')
                for bound in ('leftBound', 'rightBound'))
    monkeypatch.setattr(guard, 'MAX_POINTS', count - 1)
    told = refused(tmp_path / 's.xml', 'author="[^"]*"', 'author="A"')
    assert f'have {count} points, more than {count - 1}; thin them out' in told
    monkeypatch.setattr(guard, 'MAX_POINTS', count)
    assert setup_of(tmp_path / 's.xml').network.lanelet_ids
