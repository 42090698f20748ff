# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Recordings become scenario files: from every storage, cut off, chosen, placed and refused."""

from collections.abc import Callable
from datetime import datetime, UTC
import math
from pathlib import Path
from typing import Any

from commonroad.common.reader.file_reader_xml import XMLFileReader
from crgame_ros.cli import main
from crgame_ros.errors import InputError
from crgame_ros.game.game import AvSpec
from crgame_ros.recording.conversion import convert
from crgame_ros.recording.export import ExportedScenario
from crgame_ros.scenario.export_network import schema_errors
from crgame_ros.scenario.loading import load_scenario
from crgame_ros.scenario.obstacles import ScenarioObstacles
from crgame_ros.simulation.offline import OfflineResult
from lxml import etree
import numpy as np
import pytest
from rosbags.rosbag2 import StoragePlugin
from vehiclemodels.parameters_vehicle2 import parameters_vehicle2

Drive = Callable[..., OfflineResult]
TRAFFIC, CUT_IN = 'ZAM_Traffic-1_1_T-1.xml', 'ZAM_CutIn-1_1_T-1.xml'
AV = (AvSpec('av0', 'constant-velocity'),)
# By how much a scenario may differ from the recorded poses [m].
TOLERANCE = 1e-3


def assert_holds(made: Path, report: ExportedScenario, result: OfflineResult) -> None:
    """Compare the file with the run's rear-axle states and object poses at each tick."""
    data = made.read_bytes()
    assert schema_errors(etree.fromstring(data)) == []
    scenario, problems = XMLFileReader(data).open()
    setup = result.setup
    rear_to_center = parameters_vehicle2().b
    for vehicle in setup.vehicle_ids:
        obstacle = scenario.obstacle_by_id(report.obstacle_ids[vehicle])
        assert report.problem_ids[vehicle] in problems.planning_problem_dict
        states = result.states_of(vehicle)[::10][report.first_k:]
        for step in range(report.time_steps):
            x, y, yaw = states[step, :3]
            assert math.dist(obstacle.state_at_time(step).position, (
                x + rear_to_center * math.cos(yaw), y + rear_to_center * math.sin(yaw))
            ) < TOLERANCE
        assert obstacle.state_at_time(report.time_steps) is None
    for column, item in enumerate(setup.obstacles.descriptions):
        obstacle = scenario.obstacle_by_id(report.obstacle_ids[item.id])
        for step in range(report.time_steps):
            assert math.dist(obstacle.state_at_time(step).position, setup.obstacles.states_at(
                report.first_k + step).poses[column, :2]) < TOLERANCE


@pytest.mark.matrix('sqlite3')
@pytest.mark.slow
@pytest.mark.parametrize('kind', ['ours', 'mcap', 'sqlite3'])
def test_recordings_of_every_make(tmp_path: Path, recorder: Any, drive: Drive, kind: str) -> None:
    """The file lies beside the recording, is named by its id, and is dated by the log time."""
    result = drive(TRAFFIC, duration_s=2.0, avs=AV)
    messages = recorder.messages(result, offset_ns=3_000_000_000)
    folder = recorder.ours(tmp_path / 'bag', messages) if kind == 'ours' else recorder.rosbag2(
        tmp_path / 'bag', messages, StoragePlugin[kind.upper()])
    made, report = convert(folder)
    assert made == tmp_path / 'C-ZAM_Traffic-1_1_T-1.xml'
    assert (report.first_k, report.time_steps, report.notices) == (0, 21, ())
    assert len(report.obstacle_ids) == 2 + 6
    assert_holds(made, report, result)
    day = datetime.fromtimestamp(messages[0][2] * 1e-9, UTC).date().isoformat()
    assert etree.parse(str(made)).getroot().get('date') == day == '2023-11-14'


@pytest.mark.slow
def test_recording_that_was_cut_off_or_began_late(tmp_path: Path, recorder: Any,
                                                  drive: Drive) -> None:
    """The existing part becomes the scenario; the notices name the missing part."""
    result = drive(TRAFFIC, duration_s=2.0, avs=AV)
    messages = recorder.messages(result)
    folder = recorder.ours(tmp_path / 'bag', messages)
    (folder / 'metadata.yaml').unlink()
    file = folder / 'bag_0.mcap'
    file.write_bytes(file.read_bytes()[:-30_000])
    made, report = convert(folder)
    assert 2 < report.time_steps < 21
    assert 'was not finished' in report.notices[0]
    assert_holds(made, report, result)
    late = [m for m in messages if m[1].startswith('std_msgs/msg/String')
            or m[2] > messages[0][2] + 500_000_000]
    made, report = convert(recorder.ours(tmp_path / 'late', late), tmp_path / 'late.xml')
    assert (report.first_k, report.time_steps) == (5, 16)
    assert report.notices == (
        'the recording begins at scenario step 5 of a run that began at 0',
        'time step 0 is scenario step 5 of the original')
    assert_holds(made, report, result)


@pytest.mark.slow
def test_place_and_choice(tmp_path: Path, recorder: Any, drive: Drive) -> None:
    """A folder, a file name, an earlier run; a conversion may be repeated, nothing else lost."""
    first, second = drive(CUT_IN, seed=1), drive(TRAFFIC, duration_s=0.5, seed=2)
    start = 1_700_000_000_000_000_000
    bag = recorder.ours(tmp_path / 'run' / 'bag', [
        *recorder.messages(first, epoch=0, log_ns=start),
        *recorder.messages(second, epoch=1, offset_ns=5_000_000_000,
                           log_ns=start + 5_000_000_000)])
    out = tmp_path / 'out'
    out.mkdir()
    assert convert(bag, out)[0] == out / 'ZAM_Traffic-1_1_T-1.xml'
    made, report = convert(bag, out, epoch=0)
    assert made == out / 'ZAM_CutIn-1_1_T-1.xml'
    assert_holds(made, report, first)
    made, report = convert(bag, out / 'named.xml', epoch=1)
    assert made == out / 'named.xml'
    assert_holds(made, report, second)
    assert_holds(*convert(bag, out / 'named.xml', epoch=0), first)
    (out / 'named.xml').write_text(first.setup.loaded.xml_text)
    with pytest.raises(InputError, match='a file that is no exported run is there already'):
        convert(bag, out / 'named.xml')
    assert (out / 'named.xml').read_text() == first.setup.loaded.xml_text
    # The command makes the folders that are missing, whichever of the two is named.
    for named, path in (('new/run.xml', 'new/run.xml'),
                        ('other', 'other/ZAM_Traffic-1_1_T-1.xml')):
        assert main(['convert', str(bag), '--out', str(tmp_path / named)]) == 0
        assert (tmp_path / path).is_file()
    assert main(['convert', str(bag), '--out', str(out / 'named.xml' / 'below')]) == 2
    # A bare file is a recording too; its folder gets the scenario.
    assert convert(bag / 'bag_0.mcap')[0] == bag / 'ZAM_Traffic-1_1_T-1.xml'


def test_exported_run_can_be_driven_again(tmp_path: Path, recorder: Any, drive: Drive) -> None:
    """The human of one run is a recorded obstacle of the next: its poses are those driven."""
    result = drive(TRAFFIC, duration_s=2.0, avs=AV)
    made, report = convert(recorder.ours(tmp_path / 'bag', recorder.messages(result)))
    obstacles = ScenarioObstacles(load_scenario(made))
    column = obstacles.ids.index(f'o{report.obstacle_ids["hv0"]}')
    states = result.states_of('hv0')[::10]
    found = np.array([obstacles.states_at(k).poses[column] for k in range(21)])
    offset = parameters_vehicle2().b
    np.testing.assert_allclose(found[:, 0], states[:, 0] + offset * np.cos(states[:, 2]),
                               atol=TOLERANCE)
    np.testing.assert_allclose(found[:, 1], states[:, 1] + offset * np.sin(states[:, 2]),
                               atol=TOLERANCE)


@pytest.mark.parametrize(('kept', 'message'), [
    (0, 'no /scenario/game in it'), (3, 'no /vehicles/state in it'),
    (5, 'run 1 ended before it began, after 0 simulation steps')])
def test_recordings_without_a_run(tmp_path: Path, recorder: Any, drive: Drive, kept: int,
                                  message: str) -> None:
    """Nothing, documents alone, or step 0 alone make no scenario, and no file appears."""
    messages = recorder.messages(drive(TRAFFIC, duration_s=0.1))
    folder = recorder.ours(tmp_path / 'bag', messages[:kept])
    with pytest.raises(InputError, match=message):
        convert(folder)
    assert list(tmp_path.iterdir()) == [folder]
