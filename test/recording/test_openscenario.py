# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Runs as OpenSCENARIO: what the files say, how they are asked for, and how esmini plays them."""

from collections.abc import Callable
from dataclasses import dataclass, field
from importlib.metadata import distribution
import math
from pathlib import Path
import shutil
import subprocess
import sys
from typing import Any

from crgame_ros.cli import main
from crgame_ros.errors import InputError
from crgame_ros.game.objects import Role
from crgame_ros.geometry.shape import Shape
from crgame_ros.paths import extra_install, scenarios_directory
from crgame_ros.python_interface.offline_runs import OfflineRun, run
from crgame_ros.recording.conversion import write_openscenario
from crgame_ros.recording.run_trajectories import RunTrajectories
from crgame_ros.simulation.offline import OfflineResult
from lxml import etree
import numpy as np
import pytest
from vehiclemodels.parameters_vehicle2 import parameters_vehicle2

pytest.importorskip('scenariogeneration', reason='the extra openscenario is not installed')

Drive = Callable[..., OfflineResult]
CUT_IN, TRAFFIC = 'ZAM_CutIn-1_1_T-1.xml', 'ZAM_Traffic-1_1_T-1.xml'
# Distance from the rear axle to the centre of CommonRoad's vehicle 2, its parameter b [m].
REAR_TO_CENTER = parameters_vehicle2().b
# Four decimals of place and heading, the latter seen from a centre 3 m ahead [m].
ROUNDING = 3e-4
# Of what a player shows [m].
TOLERANCE = 0.01
NAN = (math.nan, math.nan)


@dataclass
class Entity:
    """What a file says of one entity, read without the code that wrote it."""

    kind: str
    category: str
    center: tuple[float, float]
    size: tuple[float, float]
    placed: list[tuple[float, float, float]] = field(default_factory=list)
    vertices: list[list[list[float]]] = field(default_factory=list)
    appears_s: list[float] = field(default_factory=list)
    vanishes_s: list[float] = field(default_factory=list)

    def center_at(self, time_s: float) -> tuple[float, float]:
        """Return where the middle of its box is at a time; NaN where it is absent."""
        begun = [0.0] * (len(self.placed) - len(self.appears_s)) + self.appears_s
        piece = sum(start <= time_s for start in begun) - 1
        if piece < 0 or piece < len(self.vanishes_s) and time_s > self.vanishes_s[piece]:
            return NAN
        x, y, yaw = self.placed[piece]
        for rows in self.vertices:
            if rows[0][0] <= time_s <= rows[-1][0]:
                times = [row[0] for row in rows]
                x, y, yaw = (float(np.interp(time_s, times, column))
                             for column in zip(*(row[1:] for row in rows), strict=True))
        ahead, left = self.center
        return (x + ahead * math.cos(yaw) - left * math.sin(yaw),
                y + ahead * math.sin(yaw) + left * math.cos(yaw))


def _pose(element: 'etree._Element') -> tuple[float, float, float]:
    place = element.find('.//WorldPosition')
    return float(place.get('x')), float(place.get('y')), float(place.get('h'))


def read(path: Path) -> dict[str, Entity]:
    """Read a file's entities after a check by the schema."""
    schema = distribution('scenariogeneration').locate_file('schemas/OpenSCENARIO_1_2.xsd')
    root = etree.parse(str(path)).getroot()
    etree.XMLSchema(etree.parse(str(schema))).assertValid(root)
    found = {}
    for item in root.iter('ScenarioObject'):
        body = item[0]
        box, size = body.find('BoundingBox/Center'), body.find('BoundingBox/Dimensions')
        assert float(box.get('z')) == 0.5 * float(size.get('height'))
        found[item.get('name')] = Entity(
            body.tag, next(value for key, value in body.items() if key.endswith('Category')),
            (float(box.get('x')), float(box.get('y'))),
            (float(size.get('length')), float(size.get('width'))))
    for private in root.iter('Private'):
        found[private.get('entityRef')].placed.append(_pose(private))
    for event in root.iter('Event'):
        time = event.find('StartTrigger//SimulationTimeCondition')
        for action in event.iter('EntityAction'):
            entity = found[action.get('entityRef')]
            if action.find('AddEntityAction') is not None:
                assert time.get('rule') == 'greaterOrEqual'
                entity.placed.append(_pose(action))
                entity.appears_s.append(float(time.get('value')))
            else:
                assert time.get('rule') == 'greaterThan'
                entity.vanishes_s.append(float(time.get('value')))
    for group in root.iter('ManeuverGroup'):
        found[group.find('Actors/EntityRef').get('entityRef')].vertices = [
            [[float(vertex.get('time')), *_pose(vertex)] for vertex in line.iter('Vertex')]
            for line in group.iter('Polyline')]
    return found


def centers(log: RunTrajectories) -> dict[str, list[list[float]]]:
    """Return where the middle of everything was at each step, in closed form; NaN if absent."""
    found = {}
    for column, item in enumerate(log.vehicles):
        found[item.id] = [[row[0] + REAR_TO_CENTER * math.cos(row[2]),
                           row[1] + REAR_TO_CENTER * math.sin(row[2])]
                          for row in log.vehicle_states[:, column].tolist()]
    for column, item in enumerate(log.objects):
        found[item.id] = log.object_poses[:, column, :2].tolist()
    return found


def test_every_pose_is_in_the_file(runs: Any, tmp_path: Path) -> None:
    """The middle of each box is where it was recorded, at all steps and at no other."""
    log = runs.drive(runs.own(CUT_IN), tmp_path)
    steps = len(log.ks)
    everywhere = set(range(steps))
    stands = np.tile((40.0, -6.0, 0.4), (steps, 1))
    turns = runs.track(steps, everywhere)
    turns[:, 2] = np.remainder(3.0 + 0.1 * np.arange(steps) + math.pi, math.tau) - math.pi
    log = runs.with_objects(
        log, (runs.described('o1', 'truck', Role.RECORDED, Shape.rectangle(9.0, 2.5)), turns),
        (runs.described('o2', 'pedestrian', shape=Shape.circle(0.3)), runs.track(
            steps, set(range(5, steps)))),
        (runs.described('o3', 'bicycle'), runs.track(steps, {0, 1, 2, 6, 7, 10}, -2.0)),
        (runs.described('o4', 'parkedVehicle', Role.STATIC), stands),
        (runs.described('o5', 'constructionZone', Role.STATIC, Shape.polygon(
            ((-1.0, -1.0), (3.0, -1.0), (0.0, 2.0)))), stands),
        (runs.described('o6', 'taxi'), runs.track(steps, {0})),
        (runs.described('o7'), runs.track(steps, set())))
    path, notices = write_openscenario(log, tmp_path / 'run.xosc')
    found = read(path)
    assert {name: (entity.kind, entity.category) for name, entity in found.items()} == {
        'hv0': ('Vehicle', 'car'), 'av0': ('Vehicle', 'car'), 'o1': ('Vehicle', 'truck'),
        'o2': ('Pedestrian', 'pedestrian'), 'o3': ('Vehicle', 'bicycle'),
        'o4': ('Vehicle', 'car'), 'o5': ('MiscObject', 'obstacle'), 'o6': ('Vehicle', 'car')}
    recorded = centers(log)
    # The middle of the polygon's extent, ahead of its own centre and to its left.
    ahead, left = 1.0, 0.5
    recorded['o5'] = [[40.0 + ahead * math.cos(0.4) - left * math.sin(0.4),
                       -6.0 + ahead * math.sin(0.4) + left * math.cos(0.4)]] * steps
    for name, entity in found.items():
        for step, place in enumerate(recorded[name]):
            there = entity.center_at(round(step * 0.1, 1))
            assert math.isnan(place[0]) == math.isnan(there[0]), (name, step)
            assert math.isnan(place[0]) or math.dist(there, place) < ROUNDING, (name, step)
    assert found['o2'].appears_s == [0.5]
    assert found['o3'].appears_s == [0.6, 1.0] and found['o3'].vanishes_s == [0.2, 0.7, 1.0]
    # What stands has a place only; no heading jumps by a turn.
    assert not found['o4'].vertices and not found['o5'].vertices
    assert np.abs(np.diff([row[3] for row in found['o1'].vertices[0]])).max() < 0.11
    # The reference point of a vehicle is its rear axle, that of others their middle.
    assert found['hv0'].center == (pytest.approx(REAR_TO_CENTER, abs=1e-4), 0.0)
    assert found['hv0'].size == (4.508, 1.61)
    assert 2.0 < found['o1'].center[0] < 4.5 and found['o1'].size == (9.0, 2.5)
    assert found['o2'].center == (0.0, 0.0) and found['o2'].size == (0.6, 0.6)
    assert found['o5'].center == (ahead, left) and found['o5'].size == (4.0, 3.0)
    assert notices == (
        'the roads are left out: crgame convert --road names an OpenDRIVE file',
        'planning problems are left out: OpenSCENARIO has none',
        'indicators and horns are left out',
        'each circle is written as the box around it: o2',
        'each polygon is written as the box around it: o5',
        'OpenSCENARIO has no type taxi; written as car: o6',
        '1 objects never appeared in the run and are left out')


def test_driven_vehicles_are_exact_between_the_steps(drive: Drive, tmp_path: Path) -> None:
    """Lines between vertices follow full braking and steering at each simulation step."""
    result = drive(CUT_IN, duration_s=2.0)
    with pytest.warns(UserWarning, match='the roads are left out'):
        path = OfflineRun('run', result, 0.0).save_scenario(tmp_path / 'run.xosc')
    entity = read(path)['hv0']
    # At the steps alone, the lines would be up to 1.4 cm beside a vehicle at 11 m/s^2.
    assert len(entity.vertices[0]) > 21
    states = result.states_of('hv0')
    assert max(math.dist(entity.center_at(n * 0.01), (
        row[0] + REAR_TO_CENTER * math.cos(row[2]), row[1] + REAR_TO_CENTER * math.sin(row[2])))
        for n, row in enumerate(states.tolist())) < 0.5 * TOLERANCE


def test_the_command_writes_it(tmp_path: Path, recorder: Any, drive: Drive,
                               capsys: pytest.CaptureFixture[str]) -> None:
    """The ending or --format chooses it; the header is that of the recording; equal files."""
    bag = recorder.ours(tmp_path / 'run' / 'bag', recorder.messages(drive(TRAFFIC)))
    road = tmp_path / 'road.xodr'
    road.write_text('<OpenDRIVE/>')
    named, folder = tmp_path / 'new' / 'named.xosc', tmp_path / 'folder'
    assert main(['convert', str(bag), '--out', str(named)]) == 0
    assert capsys.readouterr().out.splitlines()[-1] == str(named)
    assert main(['convert', str(bag), '--out', str(folder), '--format', 'openscenario',
                 '--road', str(road)]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert not any('roads are left out' in line for line in lines)
    second = folder / 'ZAM_Traffic-1_1_T-1.xosc'
    assert second.read_text() == named.read_text().replace(
        '<RoadNetwork />', '<RoadNetwork>\n    <LogicFile filepath="../road.xodr" />\n'
        '  </RoadNetwork>')
    assert main(['convert', str(tmp_path / 'run'), '--format', 'openscenario']) == 0
    assert (tmp_path / 'run' / 'ZAM_Traffic-1_1_T-1.xosc').read_text() == named.read_text()
    header = etree.parse(str(named)).getroot().find('FileHeader')
    original = etree.parse(str(scenarios_directory() / TRAFFIC)).getroot()
    assert dict(header.attrib) == {
        'revMajor': '1', 'revMinor': '2', 'date': '2023-11-14T00:00:00',
        'author': original.get('author'),
        'description': 'ZAM_Traffic-1_1_T-1 driven in crgame_ros'}
    assert len(read(named)) == 1 + 6
    # The recording ends after 1 s, and so does the file.
    stop = etree.parse(str(named)).getroot().find('Storyboard/StopTrigger')
    assert stop.find('.//SimulationTimeCondition').get('value') == '1.0'


@pytest.mark.parametrize(('options', 'message'), [
    (['--out', 'run.xml', '--format', 'openscenario'],
     '--format: is openscenario, and the file ends in .xml; name a folder or a file that ends in '
     '.xosc'),
    (['--road', 'road.xodr'],
     '--road: is for OpenSCENARIO; give --format openscenario as well'),
    (['--out', 'run.xosc', '--road', 'none.xodr'],
     'none.xodr: there is no such file; name an OpenDRIVE file'),
    (['--out', 'mine.xosc'],
     'mine.xosc: a file that is no exported run is there already; name another file or folder')])
def test_refusals(tmp_path: Path, recorder: Any, drive: Drive, monkeypatch: pytest.MonkeyPatch,
                  capsys: pytest.CaptureFixture[str], options: list[str], message: str) -> None:
    """Each says in a line what does not fit; no file is written or changed."""
    monkeypatch.chdir(tmp_path)
    bag = recorder.ours(tmp_path / 'bag', recorder.messages(drive(TRAFFIC, duration_s=0.5)))
    mine = tmp_path / 'mine.xosc'
    mine.write_text('mine')
    before = sorted(tmp_path.iterdir())
    assert main(['convert', str(bag), *options]) == 2
    assert capsys.readouterr().err == f'error: {message}\n'
    assert (sorted(tmp_path.iterdir()), mine.read_text()) == (before, 'mine')


def test_states_without_numbers_are_refused(runs: Any, tmp_path: Path) -> None:
    """The message names vehicle and step, and no file appears."""
    log = runs.drive(runs.own(CUT_IN), tmp_path)
    log.vehicle_states[3, 0, 0] = math.nan
    with pytest.raises(InputError, match='hv0: its state at scenario step 3 holds no numbers'):
        write_openscenario(log, tmp_path / 'run.xosc')
    assert not (tmp_path / 'run.xosc').exists()


def test_the_command_says_what_to_install(tmp_path: Path) -> None:
    """Without the library, one line names the command; runs are not driven first."""
    for command in (['convert', 'nothing', '--out', 'run.xosc'],
                    ['offline', 'cut_in', '--out', 'run.xosc']):
        done = subprocess.run(
            [sys.executable, '-c', 'import sys; sys.modules["scenariogeneration"] = None\n'
             f'from crgame_ros.cli import main; sys.exit(main({command}))'],
            capture_output=True, text=True, cwd=tmp_path)
        assert (done.returncode, done.stdout) == (2, '')
        assert done.stderr.splitlines()[-1] == (
            'error: OpenSCENARIO: needs scenariogeneration (import of scenariogeneration halted; '
            f'None in sys.modules); {extra_install("openscenario")}')
    assert not list(tmp_path.iterdir())


@pytest.mark.skipif(shutil.which('esmini') is None, reason='no esmini on the PATH')
@pytest.mark.parametrize('game', [
    'cut_in', 'occluded_pedestrian', 'parked_cars',
    pytest.param('dense_merge', marks=pytest.mark.slow)])
def test_esmini_shows_what_was_recorded(game: str, tmp_path: Path) -> None:
    """It plays the file without a road; everything is where and when it was, to 1 cm."""
    log = run(game, duration_s=20.0).log
    path, _ = write_openscenario(log, tmp_path / 'run.xosc')
    shown, described = played(path), read(path)
    missing = 0
    for name, places in centers(log).items():
        for step, place in enumerate(places):
            there = shown.get(name, {}).get(step * 10)
            if there is None:
                # What is added appears one of esmini's own steps later.
                appears = step > 0 and math.isnan(places[step - 1][0])
                assert math.isnan(place[0]) or appears, (name, step)
                missing += not math.isnan(place[0])
                continue
            x, y, yaw = there
            ahead, left = described[name].center
            assert math.dist(place, (x + ahead * math.cos(yaw) - left * math.sin(yaw),
                                     y + ahead * math.sin(yaw) + left * math.cos(yaw))
                             ) < TOLERANCE, (name, step)
    assert (missing > 0) is (game == 'dense_merge')


def played(path: Path) -> dict[str, dict[int, tuple[float, float, float]]]:
    """Play a file in esmini: x, y and heading by name and step of 10 ms."""
    table = path.with_suffix('.csv')
    # Its filter leaves out vertices that are less than 0.1 m apart.
    subprocess.run(['esmini', '--osc', path.name, '--headless', '--fixed_timestep', '0.01',
                    '--traj_filter', '0', '--csv_logger', table.name, '--disable_stdout'],
                   cwd=path.parent, check=True, capture_output=True, timeout=120)
    rows = [[cell.strip() for cell in line.split(',')] for line in table.read_text().splitlines()]
    names = next(row for row in rows if row[0].startswith('Index'))
    start = names.index('#1 Entity_Name [-]')
    places = [names.index(f'#1 {name}') - start for name in (
        'World_Position_X [m]', 'World_Position_Y [m]', 'World_Heading_Angle [rad]')]
    found: dict[str, dict[int, tuple[float, float, float]]] = {}
    for row in rows:
        if not row[0].isdecimal():
            continue
        # Blocks of entities end with an empty cell.
        block: list[str] = []
        for cell in row[start:]:
            if cell:
                block.append(cell)
            elif block:
                x, y, yaw = (float(block[place]) for place in places)
                found.setdefault(block[0], {})[round(float(row[1]) * 100)] = (x, y, yaw)
                block = []
    return found
