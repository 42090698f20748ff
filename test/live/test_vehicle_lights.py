# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Indicators and horn of a scripted driver: live, recorded, exported and offline alike."""

import json
from pathlib import Path

from commonroad.common.file_reader import CommonRoadFileReader
from crgame_ros.game.game import load_game
from crgame_ros.messages.joints import from_joint_trajectory
from crgame_ros.recording.export import export_scenario
from crgame_ros.recording.reader import BagReader
from crgame_ros.recording.run_cycles import read_cycles
from crgame_ros.recording.run_trajectories import read_trajectories
from crgame_ros.simulation.offline import run_offline
from crgame_ros.simulation.setup import build_setup
from live_support import Launcher, SCENARIOS
import numpy as np
import pytest
import yaml

pytestmark = pytest.mark.exhaustive

SECONDS = 1.5
KEYS = """keys:
  - {from: 0.0, to: 9.0, hold: [throttle]}
  - {from: 0.2, to: 0.4, hold: [left]}
"""
LIGHTS = """  - {from: 0.0, to: 0.6, hold: [left_indicator]}
  - {from: 0.5, to: 1.0, hold: [right_indicator]}
  - {from: 0.8, to: 1.2, hold: [horn]}
"""
# The lights of the script, by the seconds at which they change.
SAID = [('left', False), ('hazard', False), ('right', False), ('right', True), ('off', True),
        ('off', False)]


def _game(folder: Path, name: str, keys: str) -> Path:
    game = yaml.safe_load((SCENARIOS / 'cut_in.yaml').read_text())
    game['scenario'] = str(SCENARIOS / game['scenario'])
    game['humans'][0]['driver'] = f'keys:{name}.keys.yaml'
    if name == 'lit':
        game['avs'][0]['lights'] = True
    (folder / f'{name}.keys.yaml').write_text(keys)
    path = folder / f'{name}.yaml'
    path.write_text(yaml.safe_dump(game))
    return path


def test_lights_are_recorded_and_change_no_motion(tmp_path: Path) -> None:
    """The topic has each change; cycles and export agree with it; hashes stay equal."""
    path = _game(tmp_path, 'lit', KEYS + LIGHTS)
    lit, dark = (run_offline(build_setup(load_game(each)), duration_s=SECONDS)
                 for each in (path, _game(tmp_path, 'dark', KEYS)))
    assert lit.state_hash == dark.state_hash
    assert set(lit.commands[:, 0, 4]) == {0, 1, 3, 2, 6, 4} and not dark.commands[:, 0, 4].any()

    # Slowly: a busy machine must not skip a light that is on for a tenth of a second.
    with Launcher([path, '--duration', str(SECONDS), '--real-time-factor', 0.1],
                  tmp_path / 'run') as launcher:
        assert launcher.wait() == 0, launcher.text
    bag = tmp_path / 'run' / 'bag'
    with BagReader(bag) as reader:
        told = [json.loads(item.message.data)
                for item in reader.decoded(['/vehicles/signals'])]
    assert {name for each in told for name in each['vehicles']} == {'hv0', 'av0'}
    human = [each['vehicles']['hv0'] for each in told]
    # The first step may have come before the driver's first command.
    changes = [(each['indicator'], each['horn']) for each in human]
    assert changes[-len(SAID):] == SAID and len(changes) <= len(SAID) + 1
    assert all(each['vehicles']['av0'] == {'indicator': 'off', 'horn': False} for each in told)

    cycles = read_cycles(bag)
    lights = cycles.commands('hv0')[:, 4]
    # The planner asks for them: each request has their state at its time.
    log = read_trajectories(bag)
    shown = dict(zip(cycles.column('n').tolist(), lights.tolist(), strict=True))
    with BagReader(bag) as reader:
        requests = [from_joint_trajectory(item.message, item.topic)
                    for item in reader.decoded(['/av0/plan_request'])]
    asked = {log.game.scheduler.tick_of_stamp(each.stamp_ns):
             each.positions[0, each.names.index('hv0/lights')] for each in requests}
    assert len(asked) >= 10 and set(asked.values()) >= {1.0, 2.0, 4.0}
    assert asked == {n: shown.get(n, 0.0) for n in asked}
    places = np.flatnonzero(np.diff(lights)) + 1
    assert [each['n'] for each in told][-len(places):] == cycles.column('n')[places].tolist()

    exported = export_scenario(log)
    (tmp_path / 'run.xml').write_text(exported.xml_text)
    scenario, _ = CommonRoadFileReader(str(tmp_path / 'run.xml')).open()
    obstacle = scenario.obstacle_by_id(exported.obstacle_ids['hv0'])
    horns = [obstacle.signal_state_at_time_step(step).horn for step in range(15)]
    assert any(horns) and not all(horns)
    assert obstacle.signal_state_at_time_step(3).indicator_left
