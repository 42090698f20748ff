# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The scene document: true to the files, valid JSON for every scenario."""

from dataclasses import replace
import json
import math
from pathlib import Path
import re
from typing import Any

from crgame_ros.cockpit.scene import scene_document
from crgame_ros.game.documents import GAME
from crgame_ros.game.game import load_game
from crgame_ros.game.perception_spec import PerceptionSpec, SensorSpec
from crgame_ros.launcher.arguments import RunRequest
from crgame_ros.launcher.run_plan import effective_game
from crgame_ros.paths import scenarios_directory
from crgame_ros.simulation.run_texts import describe_game
from crgame_ros.simulation.setup import build_setup, Setup
import numpy as np
import pytest
import shapely

GAMES = sorted(path for path in scenarios_directory().glob('*.yaml')
               if path.suffixes == ['.yaml'])
PUBLISHED = (
    'DEU_Flensburg-10_1_T-1', 'DEU_Guetersloh-36_1_T-1', 'DEU_Test-1_1_T-1', 'FRA_Anglet-1_1_T-1',
    'OSC_PedestrianCollision-1_1_T-1', 'USA_Lanker-1_3_T-1', 'USA_US101-4_1_T-1',
    'ZAM-Ramp-1_1-T-1', 'ZAM_Over-1_1', 'ZAM_Tjunction-1_42_T-1', 'ZAM_Tutorial-1_2_T-1')
# Bounds may lose vertices that lie within 1 cm of the rest; coordinates are rounded to 1 mm.
TOLERANCE_M = 0.011


def document_of(setup: Setup, **changes: Any) -> dict[str, Any]:
    text = json.loads(GAME.write(describe_game(setup, epoch=3, clock_offset_ns=2_500_000_000)))
    known = {key: value for key, value in (text | changes).items() if value is not None}
    game = GAME.read(json.dumps(known))
    document = scene_document(setup.loaded, setup.descriptions, game)
    # Parsed as in a browser, which refuses NaN and infinities.
    read: dict[str, Any] = json.loads(json.dumps(document, allow_nan=False))
    return read


def published(directory: Path, name: str) -> Setup:
    return build_setup(effective_game(
        RunRequest(scenario=directory / f'{name}.xml', driver='idle')))


def line(flat: list[float]) -> shapely.LineString:
    return shapely.LineString(np.reshape(flat, (-1, 2)))


def check_against_file(document: dict[str, Any], setup: Setup) -> None:
    """Check that every lanelet, vehicle and object is at its place of the file."""
    network = setup.loaded.scenario.lanelet_network
    assert [entry['id'] for entry in document['lanelets']] == \
        [lanelet.lanelet_id for lanelet in network.lanelets]
    xmin, ymin, xmax, ymax = document['bounds']
    for entry in document['lanelets']:
        lanelet = network.find_lanelet_by_id(entry['id'])
        for name, vertices in (('left', lanelet.left_vertices), ('right', lanelet.right_vertices),
                               ('center', lanelet.center_vertices)):
            shown, true = line(entry[name]), shapely.LineString(vertices[:, :2])
            assert shapely.hausdorff_distance(shown, true, densify=0.2) < TOLERANCE_M
            box = shown.bounds
            assert box[0] >= xmin and box[1] >= ymin and box[2] <= xmax and box[3] <= ymax
    assert [item['id'] for item in document['vehicles']] == list(setup.vehicle_ids)
    assert [item['id'] for item in document['objects']] == list(setup.obstacles.ids)


@pytest.mark.matrix('intersection', 'parked_cars')
@pytest.mark.parametrize('path', GAMES, ids=lambda path: path.stem)
def test_own_games(path: Path) -> None:
    setup = build_setup(load_game(path))
    document = document_of(setup)
    check_against_file(document, setup)
    assert document['title'] == setup.game.title
    assert document['time']['duration_s'] == setup.game.duration
    assert {goal['av'] for goal in document['goals']} == {av.id for av in setup.avs}


@pytest.mark.matrix('USA_Lanker-1_3_T-1', 'ZAM_Tjunction-1_42_T-1')
@pytest.mark.parametrize('name', PUBLISHED)
def test_published_scenarios(name: str, shared_scenarios: Path) -> None:
    setup = published(shared_scenarios, name)
    check_against_file(document_of(setup), setup)


def test_vehicles_and_times_are_those_of_the_game() -> None:
    setup = build_setup(load_game(scenarios_directory() / 'two_avs.yaml'))
    document = document_of(setup)
    assert [item['role'] for item in document['vehicles']] == ['human', 'autonomous', 'autonomous']
    # BMW 320i, CommonRoad vehicle 2.
    assert document['vehicles'][0] == {
        'id': 'hv0', 'role': 'human', 'max_steering_angle': 0.91, 'perception': None,
        'type': 'car', 'powertrain': 'combustion',
        'rear_to_center': pytest.approx(1.4227, abs=5e-5),
        'wheelbase': pytest.approx(2.5789, abs=5e-5),
        'shape': {'kind': 'rectangle', 'length': 4.508, 'width': 1.61, 'vertices': []},
        # config/vehicles/bmw_320i.yaml; the inner mirror hangs below the roof.
        'driver_place': {
            'height': 1.42, 'bonnet_height': 0.95, 'eye': [1.25, 0.36, 1.17],
            'left_mirror': [1.78, 0.92, 0.98], 'right_mirror': [1.78, -0.92, 0.98],
            'inner_mirror': [1.75, 0.0, pytest.approx(1.26)]}}
    assert document['time'] == {
        'epoch': 3, 'dt_s': 0.01, 'dt_c_s': 0.1, 'k0': 0, 'clock_offset_s': 2.5,
        'duration_s': setup.game.duration}
    assert document['planners'] == {'av0': 'idm', 'av1': 'idm'}
    assert document['drivers'] == {'hv0': setup.humans[0].driver}


def test_what_sounds_and_what_does_not_is_told() -> None:
    setup = build_setup(load_game(scenarios_directory() / 'two_avs.yaml'))
    assert document_of(setup)['sound'] == 'on'
    # The recording is older than the key.
    assert document_of(setup, sound=None)['sound'] == 'on'
    setup = replace(setup, game=replace(setup.game, sound='none'), humans=tuple(
        replace(human, vehicle=replace(human.vehicle, powertrain='electric'))
        for human in setup.humans))
    document = document_of(setup)
    assert document['sound'] == 'none'
    assert [item['powertrain'] for item in document['vehicles']] == [
        'electric', 'combustion', 'combustion']


def test_the_reach_of_an_avs_sensors_is_told() -> None:
    game = load_game(scenarios_directory() / 'two_avs.yaml')
    sensors = (SensorSpec('front', horizon=120.0), SensorSpec('rear', yaw=3.14, horizon=40.0))
    perceiving = (PerceptionSpec(sensors=sensors), PerceptionSpec(None, ()))
    game = replace(game, avs=tuple(replace(av, perception=perception) for av, perception in zip(
        game.avs, perceiving, strict=True)))
    vehicles = document_of(build_setup(game))['vehicles']
    assert vehicles[1]['perception'] == {
        'localisation': True, 'sensors': ['front', 'rear'], 'range': 120.0}
    # A sensor that sees everything has no range.
    assert vehicles[2]['perception'] == {'localisation': False, 'sensors': [], 'range': None}


def test_speed_limits_markings_and_neighbours() -> None:
    setup = build_setup(load_game(scenarios_directory() / 'intersection.yaml'))
    lanelets = {entry['id']: entry for entry in document_of(setup)['lanelets']}
    crossing = [entry for entry in lanelets.values() if entry['intersection']]
    assert len(crossing) == 12
    assert {entry['left_line'] for entry in crossing} == {'no_marking'}
    limited = [entry['speed_limit'] for entry in lanelets.values() if entry['speed_limit']]
    assert limited and all(5.0 < limit < 40.0 for limit in limited)
    for entry in lanelets.values():
        assert set(entry['successors']) <= set(lanelets)
        if entry['adj_left'] is not None and not entry['adj_left_same']:
            # Neighbours of opposite directions share their left bounds.
            other = lanelets[entry['adj_left']]
            assert shapely.hausdorff_distance(
                line(entry['left']), line(other['left'])) < 2 * TOLERANCE_M


def test_gaps_are_narrow_holes_between_lanelets_and_nothing_of_them() -> None:
    setup = build_setup(load_game(scenarios_directory() / 'intersection.yaml'))
    gaps = [shapely.Polygon(np.reshape(gap, (-1, 2))) for gap in document_of(setup)['gaps']]
    surfaces = shapely.union_all([
        shapely.Polygon(np.concatenate((x.left_vertices[:, :2], x.right_vertices[::-1, :2])))
        for x in setup.loaded.scenario.lanelet_network.lanelets])
    # Four left turns leave slits beside the lanes that they cross.
    assert len(gaps) >= 4
    for gap in gaps:
        assert gap.buffer(-0.4).is_empty
        assert shapely.intersection(gap, surfaces).area < 0.01
        assert shapely.Polygon(surfaces.exterior).covers(gap.centroid)


def test_lights_and_stop_lines_lie_at_their_lanes(shared_scenarios: Path) -> None:
    setup = published(shared_scenarios, 'USA_Lanker-1_3_T-1')
    document = document_of(setup)
    lanelets = {entry['id']: entry for entry in document['lanelets']}
    assert len(document['lights']) == 8 and len(document['stop_lines']) == 17
    for light in document['lights']:
        assert light['lanelets'] and set(light['lanelets']) <= set(lanelets)
        center = np.reshape(lanelets[light['lanelets'][0]]['center'], (-1, 2))
        along = center[-1] - center[-2]
        assert math.cos(light['yaw'] - math.atan2(along[1], along[0])) > 0.999
    for stop in document['stop_lines']:
        entry = lanelets[stop['lanelet']]
        surface = shapely.Polygon([*np.reshape(entry['left'], (-1, 2)),
                                   *np.reshape(entry['right'], (-1, 2))[::-1]])
        assert line(stop['points']).distance(surface) < 1.0


def test_lights_say_for_which_movement_they_are(shared_scenarios: Path) -> None:
    setup = published(shared_scenarios, 'USA_Lanker-1_3_T-1')
    told = {light['id']: light['direction'] for light in document_of(setup)['lights']}
    # The value of the file.
    assert told[11522] == 'left' and set(told.values()) == {
        'left', 'right', 'all', 'straightRight'}


def test_signs_have_a_place_readers_and_a_meaning(shared_scenarios: Path) -> None:
    """The vehicles that a sign applies to drive in its direction."""
    setup = published(shared_scenarios / 'more', 'OSC_Overtake-1_1_T-1')
    document = document_of(setup)
    lanelets = {entry['id']: entry for entry in document['lanelets']}
    signs = {sign['id']: sign for sign in document['signs']}
    assert signs[1]['kind'] == 'HIGHWAY_EXIT' and signs[1]['value'] == ''
    assert signs[2]['kind'] == 'MAX_SPEED' and float(signs[2]['value']) * 3.6 == pytest.approx(60)
    assert (signs[2]['x'], signs[2]['y'], signs[2]['virtual']) == (138.168, 6173.77, False)
    # commonroad-io has no country OSC.
    assert document['country'] == 'ZAM'
    for sign in document['signs']:
        headings = [
            math.atan2(y, x) for number in sign['lanelets'] for x, y in np.diff(np.reshape(
                lanelets[number]['center'], (-1, 2)), axis=0)]
        # The dropped vertices turned the line by a small angle.
        assert any(math.cos(sign['yaw'] - heading) > 0.99 for heading in headings) \
            or not sign['lanelets']


def test_a_sign_says_no_more_than_fits_on_a_plate() -> None:
    setup = build_setup(load_game(scenarios_directory() / 'intersection.yaml'))
    sign = setup.loaded.scenario.lanelet_network.traffic_signs[0]
    sign.traffic_sign_elements[0].additional_values[:] = ['<b>' + 'x' * 500]
    told = [entry['value'] for entry in document_of(setup)['signs']
            if entry['id'] == sign.traffic_sign_id]
    assert told[0] == '<b>' + 'x' * 37


def test_light_and_air_are_the_games_else_the_scenarios() -> None:
    setup = build_setup(load_game(scenarios_directory() / 'fog.yaml'))
    assert document_of(setup)['environment'] == {'light': 'day', 'visibility': 80.0}
    # Older recordings do not have the key.
    assert document_of(setup, environment=None)['environment'] == {
        'light': 'day', 'visibility': 30_000.0}


def test_heights_keep_as_true_as_the_ground_plan(tmp_path: Path) -> None:
    """A bridge of 6 m over 100 m, on a road that is straight on the map."""
    def height(x: float) -> float:
        return 6.0 * math.exp(-((x - 100.0) / 30.0) ** 2)

    text = (scenarios_directory() / 'ZAM_CutIn-1_1_T-1.xml').read_text()
    head, lanelets, rest = re.split(r'(?s)(<lanelet .*</lanelet>)', text, maxsplit=1)
    raised = re.sub(r'<x>([^<]+)</x>\s*<y>[^<]+</y>',
                    lambda found: f'{found[0]}<z>{height(float(found[1]))}</z>', lanelets)
    path = tmp_path / 'bridge.xml'
    path.write_text(head + raised + rest)
    setup = build_setup(effective_game(RunRequest(scenario=path, driver='idle')))
    for entry in document_of(setup)['lanelets']:
        for side in ('left', 'right'):
            xs = np.reshape(entry[side], (-1, 2))[:, 0]
            heights = np.array(entry[f'{side}_z'])
            assert heights == pytest.approx([height(x) for x in xs], abs=1e-3)
            lanelet = setup.loaded.scenario.lanelet_network.find_lanelet_by_id(entry['id'])
            # Vehicles have no height.
            true = getattr(lanelet, f'{side}_vertices')
            assert true.shape[1] == 2 and len(xs) < len(true)
            order = np.argsort(xs)
            assert np.interp(true[:, 0], xs[order], heights[order]) == pytest.approx(
                [height(x) for x in true[:, 0]], abs=TOLERANCE_M)
    flat = document_of(build_setup(load_game(scenarios_directory() / 'cut_in.yaml')))
    assert {entry['left_z'] for entry in flat['lanelets']} == {None}


def test_circular_goal_has_its_radius(tmp_path: Path) -> None:
    """A goal's circle has the file's radius; commonroad-io's own outline has half of it."""
    text = (scenarios_directory() / 'ZAM_CutIn-1_1_T-1.xml').read_text()
    start = text.index('<goalState>')
    start = text.index('<position>', start)
    end = text.index('</position>', start)
    circle = '<circle><radius>7.0</radius><center><x>100.0</x><y>0.0</y></center></circle>'
    path = tmp_path / 'circle.xml'
    path.write_text(f'{text[:start]}<position>{circle}{text[end:]}')
    document = document_of(build_setup(effective_game(RunRequest(scenario=path, driver='idle'))))
    outline = shapely.Polygon(np.reshape(document['goals'][0]['polygons'][0], (-1, 2)))
    assert outline.bounds == pytest.approx((93.0, -7.0, 107.0, 7.0), abs=0.05)


def test_events_and_text_of_files_stay_as_they_are() -> None:
    setup = build_setup(load_game(scenarios_directory() / 'cut_in.yaml'))
    event = {'name': 'hide', 'label': '<b>hide</b>', 'kind': 'plan_display',
             'when': None, 'av': 'av0', 'show': False}
    document = document_of(setup, title='<script>alert(1)</script>', events=[event],
                           duration=None)
    assert document['title'] == '<script>alert(1)</script>'
    assert document['events'] == [event]
    assert document['time']['duration_s'] is None


def test_scenario_without_roads_shows_the_surroundings_of_the_vehicles() -> None:
    setup = build_setup(load_game(scenarios_directory() / 'cut_in.yaml'))
    for lanelet_id in [x.lanelet_id for x in setup.loaded.scenario.lanelet_network.lanelets]:
        setup.loaded.scenario.lanelet_network.remove_lanelet(lanelet_id)
    document = document_of(setup)
    xmin, ymin, xmax, ymax = document['bounds']
    for vehicle in setup.vehicles:
        assert xmin <= vehicle.state.x - 49.9 and vehicle.state.x + 49.9 <= xmax
        assert ymin <= vehicle.state.y - 49.9 and vehicle.state.y + 49.9 <= ymax
