# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Who kept the rules of a junction with lights and a stop sign, offline and from a recording."""

from dataclasses import replace
from pathlib import Path
from typing import Any

from crgame_ros.analysis.criticality.recorded import measure_log
from crgame_ros.analysis.report.outcome_section import outcome_section
from crgame_ros.analysis.rules.vehicle_rules import measure_rules
from crgame_ros.analysis.runs.run import Run
from crgame_ros.cli import main
from crgame_ros.evaluation.judging import check_expectations, shortfalls
from crgame_ros.evaluation.results.cell_rows import vehicle_rows
from crgame_ros.game.expectation import Expectation
from crgame_ros.game.game import load_game
from crgame_ros.geometry.rigid_transform import RigidTransform
from crgame_ros.paths import scenarios_directory
from crgame_ros.recording.run_record import run_record_of
from crgame_ros.simulation.contacts import contacts_of
from crgame_ros.simulation.offline import OfflineResult, run_offline
from crgame_ros.simulation.setup import build_setup
from lxml import etree
import pytest

LIGHT = """<trafficLight id="{id}"><cycle>
  <cycleElement><duration>{red}</duration><color>red</color></cycleElement>
  <cycleElement><duration>1000</duration><color>green</color></cycleElement>
  <timeOffset>0</timeOffset></cycle><direction>all</direction><active>true</active>
</trafficLight>"""


def lit(folder: Path, *, human_red: int = 200, sign: bool = False) -> Path:
    """
    Write the game `intersection` with a light for the AV, and a light or a sign for the human.

    :param human_red: number of time steps during which the human's light is red.
    """
    own = scenarios_directory()
    root = etree.parse(own / 'ZAM_Intersection-1_1_T-1.xml').getroot()
    stop, = (each for each in root.iter('trafficSign') if each.get('id') == '308')
    for number, lanelet, red in ((900, '11', 120), (901, '31', human_red)):
        where, = (each for each in root.iterchildren('lanelet') if each.get('id') == lanelet)
        if sign and lanelet == '31':
            stop.find('trafficSignElement/trafficSignID').text = '206'
            continue
        where.append(etree.fromstring(f'<trafficLightRef ref="{number}"/>'))
        stop.addnext(etree.fromstring(LIGHT.format(id=number, red=red)))
    name = 'ZAM_Lit-1_1_T-1'
    root.set('benchmarkID', name)
    etree.ElementTree(root).write(folder / f'{name}.xml', encoding='utf-8')
    text = (own / 'intersection.yaml').read_text().partition('expect:')[0]
    # Both are past the junction, or halt, by then.
    text = text.replace('scenario: ZAM_Intersection-1_1_T-1.xml', f'scenario: {name}.xml')
    text = text.replace('duration: 20', 'duration: 8')
    (folder / 'game.yaml').write_text(text.replace('joy:', f'joy:{own}/'))
    return folder / 'game.yaml'


def driven(game: Path) -> tuple[OfflineResult, dict[str, dict[str, object]]]:
    result = run_offline(build_setup(load_game(game)))
    rows = vehicle_rows(Run('lit', result=result, scoring='none'), result,
                        contacts_of(result))
    return result, {str(row['vehicle']): row for row in rows}


def test_a_red_light_that_the_human_runs(tmp_path: Path, recorder: Any,
                                         capsys: pytest.CaptureFixture[str]) -> None:
    """The IDM planner halts at its own; the recording says the same as the run."""
    result, rows = driven(lit(tmp_path))
    assert [rows[name]['red_lights_run'] for name in ('hv0', 'av0')] == [1, 0]
    assert [rows[name]['stop_lines_run'] for name in ('hv0', 'av0')] == [0, 0]
    assert rows['hv0']['unsafe_distance_s'] is None
    expected = Expectation('red_lights_run', 'hv0', at_most=0.0)
    check_expectations(load_game(tmp_path / 'game.yaml'), 'game.yaml')
    assert shortfalls(expected, list(rows.values())) == ['hv0: red_lights_run is 1']
    recorder.ours(tmp_path / 'run' / 'bag', recorder.messages(result))
    recorded = Run.of_recording(tmp_path / 'run', scoring='none')
    assert recorded.usual_rules == Run('lit', result=result).usual_rules
    passed, = recorded.usual_rules[0].passed
    # With an AV that plans elsewhere than it drives, the human's road is that of its plans.
    record = run_record_of(result)
    transform = RigidTransform(0.7, 120.0, -40.0)
    states = record.log.vehicle_states.copy()
    states[..., :3] = transform.to_simulation(states[..., :3])
    log = replace(record.log, vehicle_states=states, published_states=states, game=replace(
        record.log.game, avs=(replace(record.log.game.avs[0], transform=transform),)))
    moved, = measure_rules(replace(record, log=log), measure_log(log))[0].passed
    assert moved.k == pytest.approx(passed.k) and moved.lanelet == passed.lanelet
    # Its front is 10.7 m from the line at the start, its speed 6 m/s.
    assert (passed.kind, passed.lanelet) == ('red light', 31)
    assert 16.0 < passed.k < 30.0
    html = outcome_section(recorded).html
    assert 'Red lights run' in html and 'red light' in html
    capsys.readouterr()
    assert main(['measure', str(tmp_path / 'run')]) == 0
    said = capsys.readouterr().out
    assert f'red_lights_run{1:>15}' in said
    assert f'red light passed at {passed.speed:.1f} m/s, lanelet 31' in said


@pytest.mark.parametrize(('human_red', 'sign', 'red', 'stop'), [(2, False, 0, 0),
                                                                (0, True, 0, 1)])
def test_a_green_light_and_a_stop_sign(tmp_path: Path, human_red: int, sign: bool, red: int,
                                       stop: int) -> None:
    """At walking pace through a green light; the same past a stop sign is no halt."""
    _, rows = driven(lit(tmp_path, human_red=human_red, sign=sign))
    assert (rows['hv0']['red_lights_run'], rows['hv0']['stop_lines_run']) == (red, stop)
    assert rows['av0']['red_lights_run'] == 0
