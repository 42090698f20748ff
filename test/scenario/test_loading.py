# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Loading: real scenarios, faults repaired with a notice, uncertain initial states."""

import hashlib
import math
from pathlib import Path
import subprocess
import sys

from crgame_ros.errors import InputError
from crgame_ros.scenario.light_and_air import environment_of
from crgame_ros.scenario.loading import load_scenario, parse_scenario
import pytest

SHARED = Path(__file__).resolve().parents[3] / 'shared' / 'scenarios'
LANELET = """<lanelet id="{id}">
<leftBound><point><x>{x0}</x><y>2</y></point><point><x>{x1}</x><y>2</y></point></leftBound>
<rightBound><point><x>{x0}</x><y>-2</y></point><point><x>{x1}</x><y>-2</y></point></rightBound>
{links}</lanelet>"""
PROBLEM = """<planningProblem id="{id}"><initialState>
<position>{position}</position>
<orientation><intervalStart>-0.2</intervalStart><intervalEnd>0.6</intervalEnd></orientation>
<time><exact>3</exact></time>
<velocity><intervalStart>8</intervalStart><intervalEnd>10</intervalEnd></velocity>
<yawRate><exact>0</exact></yawRate><slipAngle><exact>0</exact></slipAngle></initialState>
<goalState><time><intervalStart>10</intervalStart><intervalEnd>20</intervalEnd></time></goalState>
</planningProblem>"""
RECTANGLE = ('<rectangle><length>2</length><width>1</width><orientation>0.3</orientation>'
             '<center><x>12</x><y>0.5</y></center></rectangle>')


def write(links: str = '', rest: str = '', benchmark: str = 'ZAM_Mini-1_1_T-1',
          tags: str = '<scenarioTags/>') -> str:
    """Write a scenario of two lanelets in a row; `links` go into the first."""
    return (f'<commonRoad timeStepSize="0.04" commonRoadVersion="2020a" benchmarkID="{benchmark}" '
            f'author="a" affiliation="b" source="c" date="2026-01-01">{tags}'
            + LANELET.format(id=1, x0=0, x1=50, links='<successor ref="2"/>' + links)
            + LANELET.format(id=2, x0=50, x1=99, links='<predecessor ref="1"/>')
            + rest + '</commonRoad>')


def shared(name: str = '') -> Path:
    """Find a real scenario, or skip."""
    if not (SHARED / name).exists():
        pytest.skip('the real scenarios (../shared/scenarios) are not on this machine')
    return SHARED / name


@pytest.mark.slow
def test_all_real_scenarios_load_as_published() -> None:
    """The eleven files' numbers of lanelets, obstacles and problems are those counted in XML."""
    files = sorted(shared().glob('*.xml'))
    assert len(files) >= 11
    for path in files:
        text = path.read_text(encoding='utf-8')
        loaded = load_scenario(path)
        assert len(loaded.scenario.lanelet_network.lanelets) == text.count('<lanelet id=')
        assert len(loaded.scenario.obstacles) == (
            text.count('<dynamicObstacle ') + text.count('<staticObstacle ')
            + text.count('<obstacle '))
        assert len(loaded.planning_problems) == text.count('<planningProblem ')
        assert loaded.sha256 == hashlib.sha256(path.read_bytes()).hexdigest()
        assert loaded.time_step_s == 0.1


def test_malformed_benchmark_id_is_renamed_and_said() -> None:
    """The published ZAM-Ramp-1_1-T-1 becomes the intended id."""
    loaded = load_scenario(shared('ZAM-Ramp-1_1-T-1.xml'))
    assert loaded.benchmark_id == 'ZAM_Ramp-1_1_T-1'
    assert 'ZAM_Ramp-1_1_T-1' in loaded.notices[0]


@pytest.mark.parametrize(('given', 'valid'), [
    ('C-USA_US101-33_2_T-1', 'C-USA_US101-33_2_T-1'), ('XYZ_Town-1', 'ZAM_XYZTown1-1'),
    ('../../etc/passwd', 'ZAM_etcpasswd-1'), ('', 'ZAM_Unnamed-1'), ('DEU_A-0', 'DEU_A0-1'),
    ('USA_Test4Way-1_1_T.1', 'USA_Test4Way-1_1_T-1'), ('USA_-', 'ZAM_USA-1')])
def test_benchmark_ids_are_safe_file_names(given: str, valid: str) -> None:
    """For any file the id matches the documented pattern; what can be read of it is kept."""
    assert parse_scenario(write(benchmark=given), 'x').benchmark_id == valid


def test_uncertain_initial_state_is_reduced_to_its_centre() -> None:
    """Rectangle and intervals become their middles, with one notice."""
    loaded = parse_scenario(write(rest=PROBLEM.format(id=9, position=RECTANGLE)), 'x.xml')
    state = loaded.planning_problems[0].initial_state
    assert state.position.tolist() == [12.0, 0.5]
    assert state.orientation == pytest.approx(0.2)
    assert (state.velocity, state.time_step) == (9.0, 3)
    assert 'planning problem 9' in loaded.notices[0] and len(loaded.notices) == 1


def test_problems_keep_the_order_of_the_file() -> None:
    """The AVs av0, av1, … take the problems in file order, not in id order."""
    point = '<point><x>5</x><y>0</y></point>'
    text = write(rest=''.join(PROBLEM.format(id=i, position=point) for i in (30, 10, 20)))
    problems = parse_scenario(text, 'x').planning_problems
    assert [p.planning_problem_id for p in problems] == [30, 10, 20]


def test_scenario_without_problem_is_said_in_one_line() -> None:
    """A map alone is fine: the human drives alone."""
    loaded = parse_scenario(write(), 'map.xml')
    assert loaded.planning_problems == () and loaded.time_step_s == 0.04
    assert loaded.notices == (
        'map.xml: the scenario has no planning problem: the human drives alone',)


@pytest.mark.parametrize(('links', 'rest', 'notice'), [
    ('<successor ref="77"/>', '', 'the missing lanelet 77'),
    ('<adjacentLeft ref="77" drivingDir="same"/>', '', 'the missing lanelet 77'),
    ('<adjacentLeft drivingDir="same"/>', '', 'without a ref'),
    ('<trafficSignRef ref="78"/>', '', 'the missing trafficSign 78'),
    ('<adjacentRight ref="1" drivingDir="same"/>', '', 'closes a circle'),
    ('', '<trafficSign id="5"><trafficSignElement><trafficSignID>274</trafficSignID>'
     '</trafficSignElement></trafficSign>', 'trafficSign 5 belongs to no lanelet'),
    ('<trafficLightRef ref="6"/>', '<trafficLight id="6"/>', 'has no cycle'),
    ('', '<location><geoNameId>-999</geoNameId><gpsLatitude>NaN</gpsLatitude>'
     '<gpsLongitude>1</gpsLongitude></location>', 'location'),
    ('', '<dynamicObstacle id="7"><type>car</type><shape><circle><radius>1</radius></circle>'
     '</shape><initialState><position><point><x>1</x><y>0</y></point></position><time><exact>0'
     '</exact></time></initialState><trajectory/></dynamicObstacle>', 'empty trajectory'),
    ('<trafficSignRef ref="5"/>', '<trafficSign id="5"><trafficSignElement><trafficSignID>274'
     '</trafficSignID></trafficSignElement><position><point><x>inf</x><y>0</y></point></position>'
     '</trafficSign>', 'trafficSign 5: its position is no number'),
    ('<trafficLightRef ref="6"/>', '<trafficLight id="6"><position><point><x>1</x><y>nan</y>'
     '</point></position><cycle/></trafficLight>', 'trafficLight 6: its position is no number'),
    ('', '<staticObstacle id="7"><type>car</type><shape><circle><radius>1</radius></circle>'
     f'</shape><initialState><position>{RECTANGLE}</position><orientation><exact>0</exact>'
     '</orientation><time><exact>0</exact></time></initialState></staticObstacle>',
     'obstacle 7: the uncertain position is reduced to its centre'),
    ('', '<phantomObstacle id="7"><occupancySet><occupancy><shape><circle><radius>1</radius>'
     '</circle></shape><time><exact>0</exact></time></occupancy><occupancy><shape><circle><radius>'
     '2</radius></circle></shape><time><exact>1</exact></time></occupancy></occupancySet>'
     '</phantomObstacle>', 'its occupancies change their shape'),
])
def test_mendable_faults_load_with_a_notice(links: str, rest: str, notice: str) -> None:
    """Each of these faults stops commonroad-io or traps it; here it loads, with a notice."""
    loaded = parse_scenario(write(links, rest), 'x')
    assert len(loaded.scenario.lanelet_network.lanelets) == 2
    assert loaded.scenario.lanelet_network.find_lanelet_by_id(1).successor == [2]
    assert sum(notice in n for n in loaded.notices) == 1


@pytest.mark.parametrize(('text', 'virtual'), [('true', True), ('1', True), ('false', False)])
def test_a_virtual_sign_is_one(text: str, virtual: bool) -> None:
    """The schema has an element for it."""
    loaded = parse_scenario(write('<trafficSignRef ref="5"/>', (
        '<trafficSign id="5"><trafficSignElement><trafficSignID>274</trafficSignID>'
        f'</trafficSignElement><virtual>{text}</virtual></trafficSign>')), 'x')
    assert loaded.scenario.lanelet_network.find_traffic_sign_by_id(5).virtual is virtual


PLACE = ('<location><geoNameId>1</geoNameId><gpsLatitude>2</gpsLatitude><gpsLongitude>3'
         '</gpsLongitude>{}</location>')


@pytest.mark.parametrize(('light', 'weather', 'shown', 'notices'), [
    ('day', 'sunny', ('day', 30000.0), 0), ('night', 'fog', ('dusk', 200.0), 0),
    ('tea time', 'frogs', ('day', 30000.0), 2)])
def test_words_of_the_schema_that_commonroad_io_lacks(
        light: str, weather: str, shown: tuple[str, float], notices: int) -> None:
    """Day and sunny load as such; other words are told and ignored."""
    loaded = parse_scenario(write(tags=PLACE.format(
        f'<environment><time>12:00:00</time><timeOfDay>{light}</timeOfDay><weather>{weather}'
        '</weather><underground>wet</underground></environment>') + '<scenarioTags/>'), 'x')
    found = environment_of(loaded.scenario, None)
    assert (found.light, found.visibility) == shown
    assert sum('is not known and is ignored' in notice for notice in loaded.notices) == notices


def test_half_an_interval_as_the_time_of_a_state_is_refused_in_one_line() -> None:
    """It has no middle."""
    states = ''.join(
        f'<{tag}><position><point><x>1</x><y>0</y></point></position><orientation><exact>0</exact>'
        f'</orientation><time><{time}>1</{time}></time></{tag}>'
        for tag, time in (('initialState', 'exact'), ('state', 'intervalStart')))
    with pytest.raises(InputError, match='commonroad-io cannot read it'):
        parse_scenario(write(rest=(
            '<dynamicObstacle id="7"><type>car</type><shape><circle><radius>1</radius></circle>'
            '</shape>' + states.replace('<state>', '<trajectory><state>')
            + '</trajectory></dynamicObstacle>')), 'x')


def test_a_geo_transformation_without_a_reference_is_told() -> None:
    """The schema allows an empty one."""
    loaded = parse_scenario(write(tags=PLACE.format('<geoTransformation/>') + '<scenarioTags/>'),
                            'x')
    assert loaded.scenario.location.geo_transformation is None
    assert any('has no geoReference' in notice for notice in loaded.notices)


def test_gaps_between_lanelets_are_told_with_the_widest() -> None:
    """A person would see a gap of 30 m, vehicles cross it; one of 1 m is told to nobody."""
    for gap, told in ((30.0, True), (1.0, False)):
        loaded = parse_scenario(write().replace('<x>50</x>', f'<x>{50 - gap}</x>', 2), 'x')
        assert loaded.scenario.lanelet_network.find_lanelet_by_id(1).successor == [2]
        assert any('30 m: from 1 to 2' in notice for notice in loaded.notices) is told


def test_what_only_a_stop_line_names_belongs_to_its_lanelet() -> None:
    """The sign and the light are the lanelet's; one that the lanelet names, too, is there once."""
    sign = ('<trafficSign id="{}"><trafficSignElement><trafficSignID>206</trafficSignID>'
            '</trafficSignElement></trafficSign>')
    loaded = parse_scenario(write(
        '<trafficSignRef ref="5"/><stopLine><lineMarking>solid</lineMarking>'
        '<trafficSignRef ref="5"/><trafficSignRef ref="6"/><trafficLightRef ref="7"/></stopLine>',
        sign.format(5) + sign.format(6) + '<trafficLight id="7"><cycle/></trafficLight>'), 'x')
    network = loaded.scenario.lanelet_network
    assert len(network.traffic_signs) == 2 and len(network.traffic_lights) == 1
    lanelet = network.find_lanelet_by_id(1)
    assert (lanelet.traffic_signs, lanelet.traffic_lights) == ({5, 6}, {7})
    assert not any('belongs to no lanelet' in notice for notice in loaded.notices)


def test_a_notice_stays_a_line_that_is_read() -> None:
    """A name of 4,700 characters with breaks in it: one line of less than 500."""
    notice, = parse_scenario(write(), 'far/away/\n' * 470).notices
    assert notice.startswith('far/away/ far/away/') and len(notice) < 500


def test_sign_on_a_circle_of_neighbours_ends() -> None:
    """A sign without a position makes commonroad-io walk along neighbours, here for ever."""
    loaded = parse_scenario(write(
        '<adjacentRight ref="1" drivingDir="same"/><trafficSignRef ref="5"/>',
        '<trafficSign id="5"><trafficSignElement><trafficSignID>274</trafficSignID>'
        '<additionalValue>10</additionalValue></trafficSignElement></trafficSign>'), 'x')
    assert loaded.scenario.lanelet_network.find_lanelet_by_id(1).adj_right is None


def test_missing_tags_and_heights_are_tolerated() -> None:
    """2020a files without scenarioTags and with z coordinates are in circulation."""
    text = write(tags='').replace('<y>2</y>', '<y>2</y><z>412.5</z>')
    loaded = parse_scenario(text, 'x')
    assert loaded.scenario.lanelet_network.find_lanelet_by_id(1).left_vertices.shape == (2, 2)
    assert any('heights of 4 points' in n for n in loaded.notices)


def test_format_2018b_has_its_speed_limit_as_a_sign() -> None:
    """The old format loads, and its speedLimit element survives."""
    text = write(links='<speedLimit>12.5</speedLimit>').replace('2020a', '2018b')
    loaded = parse_scenario(text, 'x')
    signs = loaded.scenario.lanelet_network.traffic_signs
    assert [s.traffic_sign_elements[0].additional_values for s in signs] == [['12.5']]


def test_import_leaves_pyplot_and_clcs_alone() -> None:
    """Start-up must not spend time on plotting and curvilinear coordinates."""
    code = ('import sys, crgame_ros.scenario.loading; '
            'print([m for m in sys.modules if "pyplot" in m or "clcs" in m])')
    done = subprocess.run([sys.executable, '-c', code], capture_output=True, text=True,
                          cwd=Path(__file__).resolve().parents[2], check=True)
    assert done.stdout.strip() == '[]'


def test_missing_orientation_does_not_become_nan() -> None:
    """A circle needs no heading; commonroad-io's default of 0 is kept finite."""
    text = write(rest='<staticObstacle id="7"><type>pillar</type><shape><circle><radius>1</radius>'
                 '</circle></shape><initialState><position><point><x>1</x><y>0</y></point>'
                 '</position><time><exact>0</exact></time></initialState></staticObstacle>')
    state = parse_scenario(text, 'x').scenario.obstacle_by_id(7).initial_state
    assert math.isfinite(state.orientation)


def test_each_load_of_a_text_gives_a_scenario_of_its_own() -> None:
    """Changes to one scenario do not affect the next, which is as in the text."""
    first = parse_scenario(write(), 'a file')
    first.scenario.lanelet_network.find_lanelet_by_id(1).left_vertices[:] += 100.0
    first.scenario.remove_lanelet([first.scenario.lanelet_network.find_lanelet_by_id(2)])
    again = parse_scenario(write(), 'a file')
    lanelets = again.scenario.lanelet_network.lanelets
    assert [lanelet.lanelet_id for lanelet in lanelets] == [1, 2]
    assert lanelets[0].left_vertices.tolist() == [[0.0, 2.0], [50.0, 2.0]]
    assert again.notices == first.notices
    elsewhere = parse_scenario(write(), 'b')
    assert elsewhere.source == 'b'
    assert elsewhere.notices == tuple(
        notice.replace('a file: ', 'b: ') for notice in first.notices) != first.notices
