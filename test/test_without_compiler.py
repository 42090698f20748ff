# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Features that work on a machine without a compiler.

Polygon3, which commonroad_dc.boundary imports, is the one package without wheels. Everything here
runs in processes in which it cannot be imported.
"""

import json
from pathlib import Path
import subprocess
import sys

import pytest

HEAD = """
import json, sys
sys.modules['Polygon'] = None
"""
MONITOR = """
from commonroad.scenario.lanelet import Lanelet, LaneletNetwork
import numpy as np
from crgame_ros.drivability.monitor import DrivabilityMonitor
from crgame_ros.game.game import DrivabilitySpec
from crgame_ros.game.objects import ObjectDescription, Role
from crgame_ros.vehicle.parameters import load_vehicle_parameters

left, right = np.array([(0.0, 4.0), (100.0, 4.0)]), np.array([(0.0, 0.0), (100.0, 0.0)])
network = LaneletNetwork.create_from_lanelet_list([Lanelet(left, (left + right) / 2, right, 1)])
car = load_vehicle_parameters()
human = ObjectDescription('hv0', 'car', Role.HUMAN, car.shape, car.rear_to_center)
monitor = DrivabilityMonitor([human], [], network, DrivabilitySpec())
states = np.zeros((1, 8))
states[0, :2] = 50.0, 2.0
monitor.prepare(states)
verdicts = []
for y in (2.0, 3.19, 3.20, 9.0):
    states[0, 1] = y
    verdicts.append(monitor.check(0, 0.0, states)[0].off_road)
print(json.dumps([verdicts, car.width]))
"""
RUN = """
from crgame_ros.paths import scenarios_directory
from crgame_ros.game.game import load_game
from crgame_ros.simulation.offline import run_offline
from crgame_ros.simulation.setup import build_setup

result = run_offline(build_setup(load_game(scenarios_directory() / 'cut_in.yaml')), duration_s=2.0)
av = result.planners['av0']
print(json.dumps([av.counters.accepted, av.statistics.fallbacks,
                  [verdict.off_road for verdict in result.violations]]))
"""
COMMAND = """
from crgame_ros.cli import main
sys.exit(main(sys.argv[1:]))
"""


def run(code: str, *arguments: str) -> subprocess.CompletedProcess[str]:
    """Run code in a process that has no Polygon3."""
    return subprocess.run([sys.executable, '-c', HEAD + code, *arguments], capture_output=True,
                          text=True, timeout=120, check=False)


def test_monitor_judges_the_road() -> None:
    """On a lane 4 m wide a car 1.61 m wide is off from 3.195 m on."""
    done = run(MONITOR)
    assert done.returncode == 0, done.stderr
    verdicts, width = json.loads(done.stdout.splitlines()[-1])
    assert width == pytest.approx(1.61)
    assert verdicts == [False, False, True, True]


@pytest.mark.slow
def test_offline_run_with_idm() -> None:
    """Every one of the 20 ticks of 2 s is planned, and both cars start on the road."""
    done = run(RUN)
    assert done.returncode == 0, done.stderr
    accepted, fallbacks, off_road = json.loads(done.stdout.splitlines()[-1])
    assert accepted >= 20
    assert fallbacks == 0
    assert off_road == [False, False]


@pytest.mark.slow
@pytest.mark.matrix
@pytest.mark.parametrize('planner', ['reactive', 'reactive-package', 'idm-package'])
def test_planners_that_need_it_say_so(planner: str, project_root: Path, tmp_path: Path) -> None:
    """One line with the remedy and exit code 2, no traceback."""
    done = run(COMMAND, 'offline', str(project_root / 'scenarios' / 'cut_in.yaml'),
               '--planner', planner, '--out', str(tmp_path / 'run'))
    assert done.returncode == 2
    message = done.stderr.splitlines()[-1]
    assert planner in message
    assert 'polygon3' in message
    assert 'apt install gcc python3-dev, then delete .venv' in message
    assert 'Traceback' not in done.stderr
