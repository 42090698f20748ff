# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Maps of other formats become scenarios on which one drives, by the real converters."""

from collections.abc import Iterator
import math
from pathlib import Path
import subprocess

from command_line import crgame
from crgame_ros.errors import InputError
from crgame_ros.roads.network import RoadNetwork
from crgame_ros.scenario.export_network import schema_errors
from crgame_ros.scenario.loading import load_scenario, LoadedScenario
from crgame_ros.worlds.environments import SUMO_TOOLS
from crgame_ros.worlds.kinds import find_kind
from crgame_ros.worlds.lanelet2 import mercator_degrees, prepare_lanelet2, tangent_plane
from crgame_ros.worlds.mending import mend_map
from lxml import etree
from made_maps import lanelet2, opendrive, openstreetmap
import numpy as np
import pytest


def import_map(source: Path, *words: str) -> tuple[int, str, str]:
    folder = source.parent
    return crgame(folder, 'import', source, '--out', folder / 'worlds', *words)


def imported(source: Path, *words: str) -> tuple[LoadedScenario, RoadNetwork, str, str]:
    code, out, told = import_map(source, *words)
    assert code == 0, told
    path = source.parent / 'worlds' / f'{source.name.split(".")[0]}.xml'
    assert out.splitlines()[-1] == f'./run.sh --scenario {path}'
    assert not schema_errors(etree.parse(path).getroot())
    loaded = load_scenario(path)
    return loaded, RoadNetwork(loaded.scenario.lanelet_network), out, told


def lanes(network: RoadNetwork) -> Iterator[int]:
    return (lanelet for lanelet in network.lanelet_ids if network.is_drivable(lanelet))


def test_an_opendrive_map_is_driven_on_in_metres(tmp_path: Path) -> None:
    source = tmp_path / 'bend.xodr'
    source.write_text(opendrive())
    loaded, network, out, told = imported(source)
    # Lane centres are 1.75 m beside the reference line: inside and outside of the bend.
    lengths = sorted(network.line(lanelet).length for lanelet in lanes(network))
    assert lengths == pytest.approx([100.0 + 98.25, 100.0 + 101.75], abs=0.02)
    assert [network.width_at(lanelet, 50.0) for lanelet in lanes(network)] == \
        pytest.approx([3.5] * 2, abs=0.01)
    # The converter joins the roads.
    limits = sorted(network.speed_limit(lanelet) or 0.0 for lanelet in lanes(network))
    assert limits == pytest.approx([15.0, 70 / 3.6], rel=2e-3)
    assert 'no speed limit' not in told and 'limits change at 1 places' in told
    assert '1 signs of no known country or type are left out: SE c' in told
    crosswalks = [lanelet for lanelet in network.lanelet_ids if not network.is_drivable(lanelet)]
    middle = network.line(crosswalks[0]).points.mean(axis=0)
    assert len(crosswalks) == 1 and middle == pytest.approx([50.0, 0.0], abs=0.01)
    assert 'touched nothing and stayed on the road; none of ' in out
    assert len(loaded.planning_problems) == 1


def test_a_lanelet2_map_keeps_its_distances(tmp_path: Path) -> None:
    source = tmp_path / 'lanes.osm'
    source.write_text(lanelet2(False))
    _, network, _, told = imported(source, '--no-drive')
    # Of the ellipsoid at 49.002 degrees: length of 0.002 degrees of a meridian, by its radius
    # a (1 - e^2) / (1 - e^2 sin^2)^1.5 (EPSG guidance note 7-2).
    flattening = 1 / 298.257223563
    squared = flattening * (2 - flattening)
    below = 1 - squared * math.sin(math.radians(49.002)) ** 2
    length = math.radians(0.002) * 6378137 * (1 - squared) / below ** 1.5
    width = math.radians(0.00005) * 6378137 / below ** 0.5 * math.cos(math.radians(49.002))
    assert [network.line(lanelet).length for lanelet in lanes(network)] == \
        pytest.approx([length] * 4, rel=1e-4)
    assert [network.width_at(lanelet, 0.5 * length) for lanelet in lanes(network)] == \
        pytest.approx([width] * 4, abs=0.003)
    limits = [network.speed_limit(lanelet) for lanelet in lanes(network)]
    assert sorted(limit for limit in limits if limit) == pytest.approx([30 / 3.6, 50 / 3.6])
    assert 'metres from 49.002000 N' in told
    assert '1 speed limits without a value are left out' in told


def test_positions_of_autoware_are_taken_as_they_are() -> None:
    root = etree.fromstring(lanelet2(True))
    assert prepare_lanelet2(root, 'a map')[0] == 'positions are local_x and local_y'
    # As the converter projects them: web Mercator by its definition (EPSG:3857).
    degrees = np.radians([[float(node.get(name)) for name in ('lat', 'lon')]
                          for node in root.iterchildren('node')])
    northing = 6378137.0 * np.log(np.tan(math.pi / 4 + degrees[:, 0] / 2))
    found = np.stack((6378137.0 * degrees[:, 1], northing), axis=-1)
    assert found == pytest.approx(np.array([[4.0 * column, 200.0 * row] for column in range(3)
                                            for row in range(3)]), abs=1e-5)


def test_a_sumo_network_keeps_the_programs_of_its_lights(tmp_path: Path) -> None:
    generate = SUMO_TOOLS.program('netgenerate', print)
    source = tmp_path / 'grid.net.xml'
    subprocess.run([str(generate), '--grid', '--grid.number=2', '--grid.length=100',
                    '--grid.attach-length=80', '-j', 'traffic_light', '-o', str(source)],
                   check=True, capture_output=True)
    loaded, network, _, told = imported(source, '--no-drive')
    assert 'turn by more than' not in told and 'lights' not in told
    lights = {light.traffic_light_id: light
              for light in loaded.scenario.lanelet_network.traffic_lights}
    step = loaded.time_step_s
    crossings: dict[tuple[int, int], dict[bool, list[object]]] = {}
    for lanelet in loaded.scenario.lanelet_network.lanelets:
        for number in lanelet.traffic_lights:
            line = network.line(lanelet.lanelet_id)
            place = tuple(np.round(line.points[-1] / 100.0).astype(int))
            east_west = abs(math.cos(line.heading[-1])) > 0.7
            crossings.setdefault(place, {}).setdefault(east_west, []).append(lights[number])
    assert len(crossings) == 4 and all(len(ways) == 2 for ways in crossings.values())
    for ways in crossings.values():
        greens = []
        for second in range(90):
            now = {way: {str(light.get_state_at_time_step(round(second / step)).value)
                         for light in group} for way, group in ways.items()}
            greens.append([way for way, states in now.items() if 'green' in states])
        # Never both ways at once, and each of them at some time.
        assert all(len(green) <= 1 for green in greens)
        assert {way for green in greens for way in green} == {False, True}


def test_an_openstreetmap_extract_becomes_roads(tmp_path: Path) -> None:
    source = tmp_path / 'crossing.osm'
    source.write_text(openstreetmap())
    _, network, out, _ = imported(source)
    points = np.concatenate([network.line(lanelet).points for lanelet in lanes(network)])
    # 0.004 degrees of latitude and 0.006 of longitude at 52 degrees north; UTM is true to 0.1 %.
    wide = math.radians(0.006) * 6391600 * math.cos(math.radians(52.0))
    assert np.ptp(points, axis=0) == pytest.approx([wide, 445.1], rel=5e-3)
    assert {round((network.speed_limit(lanelet) or 0) * 3.6) for lanelet in lanes(network)} == {30}
    assert 'touched nothing and stayed on the road; none of ' in out


def test_the_plane_of_a_map_is_true_and_passes_the_projection_of_converters() -> None:
    generator = np.random.default_rng(3)
    degrees = np.array([47.0, 8.0]) + generator.uniform(-0.02, 0.02, (50, 2))
    positions = tangent_plane(degrees)
    # Distances beside those of the haversine formula on a sphere of the local mean radius.
    first, second = np.radians(degrees[:-1]), np.radians(degrees[1:])
    haversine = np.sin((second - first) / 2) ** 2
    angle = haversine[:, 0] + np.cos(first[:, 0]) * np.cos(second[:, 0]) * haversine[:, 1]
    expected = 2 * 6379000.0 * np.arcsin(np.sqrt(angle))
    assert np.hypot(*np.diff(positions, axis=0).T) == pytest.approx(expected, rel=3e-3)
    disguised = np.radians(mercator_degrees(positions))
    # Web Mercator by its definition (EPSG:3857).
    x = 6378137.0 * disguised[:, 1]
    y = 6378137.0 * np.log(np.tan(math.pi / 4 + disguised[:, 0] / 2))
    assert np.stack((x, y), axis=-1) == pytest.approx(positions, abs=1e-6)


def test_heights_that_are_no_numbers_are_left_out() -> None:
    root = etree.fromstring(lanelet2(True))
    for number, node in enumerate(root.iterchildren('node')):
        etree.SubElement(node, 'tag', k='ele', v='12 m' if number else '12')
    prepare_lanelet2(root, 'a map')
    assert not root.findall('node/tag[@k="ele"]')


def test_only_the_last_part_of_a_lanelet_has_its_light_and_enters_a_junction() -> None:
    # More than a full turn, on itself.
    turned = np.linspace(0.0, 2.4 * math.pi, 200)

    def bound(side: str, radius: float) -> str:
        points = ''.join(f'<point><x>{radius * math.sin(angle)}</x><y>{-radius * math.cos(angle)}'
                         '</y></point>' for angle in turned)
        return f'<{side}Bound>{points}</{side}Bound>'

    root = etree.fromstring(
        f'<commonRoad><lanelet id="1">{bound("left", 18.0)}{bound("right", 21.5)}'
        '<laneletType>urban</laneletType><trafficLightRef ref="9"/></lanelet>'
        '<trafficLight id="9"><cycle/></trafficLight><intersection id="7"><incoming id="8">'
        '<incomingLanelet ref="1"/></incoming></intersection></commonRoad>')
    mend_map(root, None, 0.1)
    parts = root.findall('lanelet')
    assert len(parts) > 1
    last = next(part for part in parts if part.find('successor') is None)
    assert [part for part in parts if part.find('trafficLightRef') is not None] == [last]
    assert root.find('.//incomingLanelet').get('ref') == last.get('id')


@pytest.mark.parametrize(('name', 'content', 'what'), [
    ('a.xml', '<commonRoad/>', 'is a CommonRoad scenario already'),
    ('a.txt', 'lanes', 'is no XML'),
    ('a.xml', '<html></html>', 'its root element is <html>'),
    ('a.xodr', '<OpenDRIVE><road', 'is no well-formed XML'),
    ('a.xodr', '<!DOCTYPE x [<!ENTITY e "e">]><OpenDRIVE>&e;</OpenDRIVE>', 'document type'),
    ('a.xodr', '<OpenDRIVE><header/></OpenDRIVE>', 'no lane was found in it'),
    ('a.osm', '<osm><relation id="1"><tag k="type" v="lanelet"/></relation></osm>',
     'its nodes have neither'),
    ('a.xodr', '<OpenDRIVE><road><planView><geometry><arc curvature="left"/></geometry></planView>'
     '</road></OpenDRIVE>', 'has a value that is no number')])
def test_what_is_no_map_is_refused_in_a_line(tmp_path: Path, name: str, content: str,
                                             what: str) -> None:
    source = tmp_path / name
    source.write_text(content)
    code, out, told = import_map(source)
    assert code == 2 and not out
    errors = [line for line in told.splitlines() if not line.startswith('converting')]
    assert len(errors) == 1 and errors[0].startswith('error: ') and what in errors[0]
    assert not (tmp_path / 'worlds').exists()


def test_a_file_that_is_there_stays(tmp_path: Path) -> None:
    source = tmp_path / 'bend.xodr'
    source.write_text(opendrive())
    (tmp_path / 'worlds').mkdir()
    (tmp_path / 'worlds' / 'bend.xml').write_text('mine')
    code, _, told = import_map(source)
    assert code == 2 and told.endswith('is there already; add --force to replace it\n')
    assert (tmp_path / 'worlds' / 'bend.xml').read_text() == 'mine'


def test_a_folder_without_data_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match='holds no data set that is known'):
        find_kind(tmp_path)
