# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Exported roads: as in the original, fixed where the schema would refuse them."""

from pathlib import Path
import re
from typing import Any

from crgame_ros.recording.export import export_scenario
from crgame_ros.roads.signs import TrafficLights
from crgame_ros.scenario.loading import parse_scenario
import pytest

CUT_IN = 'ZAM_CutIn-1_1_T-1.xml'


@pytest.mark.exhaustive
def test_traffic_lights_keep_their_states(
        runs: Any, tmp_path: Path, shared_scenarios: Path) -> None:
    """The state of a light at k of the original is that at k - k0 of the export."""
    text = (shared_scenarios / 'USA_Lanker-1_3_T-1.xml').read_text(encoding='utf-8')
    original = parse_scenario(text, 'x').scenario
    cycle = sum(e.duration for e in original.lanelet_network.traffic_lights[0]
                .traffic_light_cycle.cycle_elements)
    for k0 in (0, 13):
        log = runs.drive(runs.shifted(text, k0), tmp_path, duration_s=0.3)
        scenario, _ = runs.read_back(export_scenario(log))
        seen = set()
        for step in range(cycle):
            states = TrafficLights(scenario).states_at(step)
            assert states == TrafficLights(original).states_at(step + k0)
            seen |= set(states.values())
        assert len(states) == 8 and len(seen) > 1


@pytest.mark.parametrize(('pattern', 'replacement'), [
    (r'<location>.*?</location>', ''), (r'<scenarioTags>.*?</scenarioTags>', ''),
    (r'(<location>.*?</location>)(.*)(</commonRoad>)', r'\2\1\3')])
def test_header_elements_that_the_original_lacks(runs: Any, tmp_path: Path, pattern: str,
                                                 replacement: str) -> None:
    """Location and tags are required; missing or misplaced ones need no rewriting of the roads."""
    text = re.sub(pattern, replacement, runs.own(CUT_IN), flags=re.DOTALL)
    log = runs.drive(text, tmp_path, duration_s=0.2)
    exported = export_scenario(log)
    scenario, _ = runs.read_back(exported)
    assert scenario.location.gps_latitude is not None
    assert not any('rewritten' in notice for notice in exported.notices)


@pytest.mark.parametrize(('pattern', 'replacement'), [
    ('<laneletType>.*?</laneletType>', ''),
    ('(<leftBound>.*?</leftBound>)(.*?)(</lanelet>)', r'\2\1\3'),
    ('(</rightBound>)', r'\1<predecessor ref="987654"/>')])
def test_roads_that_break_the_schema(runs: Any, tmp_path: Path, pattern: str,
                                     replacement: str) -> None:
    """Missing types, wrong order and dangling references are written anew."""
    text = re.sub(pattern, replacement, runs.own(CUT_IN), flags=re.DOTALL)
    log = runs.drive(text, tmp_path, duration_s=0.2)
    exported = export_scenario(log)
    scenario, _ = runs.read_back(exported)
    runs.assert_poses(log, exported, scenario)
    assert any('rewritten' in notice for notice in exported.notices)
    assert len(scenario.lanelet_network.lanelets) == len(re.findall('<lanelet id', text))


def test_light_without_a_cycle_is_inactive(runs: Any, tmp_path: Path) -> None:
    """The schema asks for a cycle; a light that has none shows nothing."""
    light = ('<trafficLight id="800"><cycle/><position><point><x>0</x><y>0</y></point></position>'
             '</trafficLight>')
    text = runs.own(CUT_IN).replace('<planningProblem', light + '<planningProblem', 1)
    scenario, _ = runs.read_back(export_scenario(runs.drive(text, tmp_path, duration_s=0.2)))
    assert TrafficLights(scenario).states_at(5) == {800: 'inactive'}


def test_signs_that_the_schema_does_not_know(runs: Any, tmp_path: Path) -> None:
    """They are left out with the references to them; the others stay."""
    text = runs.own(CUT_IN)
    signs = re.findall(r'<trafficSignID>(.*?)</trafficSignID>', text)
    log = runs.drive(text.replace(f'<trafficSignID>{signs[0]}<', '<trafficSignID>no-such<', 1),
                     tmp_path, duration_s=0.2)
    exported = export_scenario(log)
    scenario, _ = runs.read_back(exported)
    network = scenario.lanelet_network
    assert len(network.traffic_signs) == len(signs) - 1
    assert {number for lanelet in network.lanelets for number in lanelet.traffic_signs} == {
        sign.traffic_sign_id for sign in network.traffic_signs}
    assert exported.notices == ('the schema does not know 1 of the traffic signs; they are left '
                                'out',)
