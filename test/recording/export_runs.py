# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Runs to export, and the checks of every exported file."""

from collections import Counter
from dataclasses import replace
import math
from pathlib import Path
import re
from typing import Any

import commonroad
from commonroad.common.reader.file_reader_xml import XMLFileReader
from commonroad.planning.planning_problem import PlanningProblemSet
from commonroad.scenario.scenario import Scenario
from crgame_ros.driver.source import ReplayDriver
from crgame_ros.game.game import AvSpec, Game, HumanSpec
from crgame_ros.game.objects import ObjectDescription, Role
from crgame_ros.geometry.shape import Shape
from crgame_ros.paths import scenarios_directory
from crgame_ros.recording.export import ExportedScenario
from crgame_ros.recording.run_trajectories import RunTrajectories, trajectories_of
from crgame_ros.simulation.offline import run_offline
from crgame_ros.simulation.setup import build_setup
from lxml import etree
import numpy as np
from vehiclemodels.parameters_vehicle2 import parameters_vehicle2

# Distance from the rear axle to the centre of CommonRoad's vehicle 2, its parameter b [m].
REAR_TO_CENTER = parameters_vehicle2().b
# The file has four decimals: half a unit of the last one, in each direction.
POSITION_TOLERANCE = 0.5e-4 * math.sqrt(2.0) + 1e-9
VALUE_TOLERANCE = 0.5e-4 + 1e-9
SCHEMA = Path(commonroad.__path__[0]) / 'scenario_definition' / 'xml_definition_files' \
    / 'XML_commonRoad_XSD.xsd'
BENCHMARK_ID = re.compile(r'(C-)?[A-Z]{3}_[A-Za-z0-9]+-[1-9]\d*_[1-9]\d*_T-1')


class ExportRuns:
    """Drives scenarios offline, reads exports back, and checks them."""

    @staticmethod
    def drive(text: str, directory: Path, avs: tuple[AvSpec, ...] | None = None,
              duration_s: float = 2.0) -> RunTrajectories:
        """Drive a scenario with a human that accelerates and steers, and AVs at constant speed."""
        file = directory / 'original.xml'
        file.write_text(text, encoding='utf-8')
        game = Game(file, humans=(HumanSpec('hv0', 'idle'),), avs=avs)
        setup = build_setup(game)
        specs = tuple(replace(av.spec, planner='constant-velocity') for av in setup.avs)
        setup = build_setup(replace(game, avs=specs))
        steps = setup.scheduler.steps_for(duration_s)
        commands = np.zeros((steps, 5))
        commands[:, 0] = 0.3
        commands[:, 2] = 0.1 * np.sin(np.arange(steps) / 40.0)
        # Second by second: left, right with the horn, hazard, only the brake.
        commands[:, 4] = np.resize((1, 6, 3, 0), steps // 50 + 1).repeat(50)[:steps]
        commands[150:, 1] = 0.05
        return trajectories_of(run_offline(setup, duration_s=duration_s, check_drivability=False,
                                           drivers={'hv0': ReplayDriver(commands)}))

    @staticmethod
    def own(name: str) -> str:
        """Read one of our own scenarios."""
        return (scenarios_directory() / name).read_text(encoding='utf-8')

    @staticmethod
    def read_back(exported: ExportedScenario) -> tuple[Scenario, PlanningProblemSet]:
        """Check an export with the schema, the id rules and for NaN, and read it."""
        root = etree.fromstring(exported.xml_text.encode('utf-8'))
        schema = etree.XMLSchema(etree.parse(str(SCHEMA)))
        assert schema.validate(root), list(schema.error_log)[:3]
        ids = Counter(element.get('id') for element in root.iter('*') if element.get('id'))
        assert ids.most_common(1)[0][1] == 1
        assert 'nan' not in exported.xml_text
        assert BENCHMARK_ID.fullmatch(root.get('benchmarkID'))
        assert root.get('benchmarkID') == exported.benchmark_id
        several = len(root.findall('planningProblem')) > 1
        assert exported.benchmark_id.startswith('C-') is several
        scenario, problems = XMLFileReader(exported.xml_text.encode('utf-8')).open()
        assert str(scenario.scenario_id) == exported.benchmark_id
        return scenario, problems

    @staticmethod
    def assert_poses(log: RunTrajectories, exported: ExportedScenario, scenario: Scenario) -> None:
        """Compare every pose at every step with the log; vehicles in closed form."""
        for column, item in enumerate(log.vehicles):
            obstacle = scenario.obstacle_by_id(exported.obstacle_ids[item.id])
            assert obstacle.obstacle_type.value == 'car'
            assert (obstacle.obstacle_shape.length, obstacle.obstacle_shape.width) == (4.508, 1.61)
            for step, row in enumerate(log.vehicle_states[:, column].tolist()):
                state = obstacle.state_at_time(step)
                assert state.time_step == step
                assert math.dist(state.position, (row[0] + REAR_TO_CENTER * math.cos(row[2]),
                                                  row[1] + REAR_TO_CENTER * math.sin(row[2]))
                                 ) <= POSITION_TOLERANCE
                assert abs(math.remainder(state.orientation - row[2], math.tau)) <= VALUE_TOLERANCE
                assert abs(state.velocity - row[3]) <= VALUE_TOLERANCE
                assert abs(state.acceleration - row[5]) <= VALUE_TOLERANCE
                assert abs(state.yaw_rate - row[6]) <= VALUE_TOLERANCE
                if step:
                    assert abs(state.steering_angle - row[4]) <= VALUE_TOLERANCE
            assert obstacle.state_at_time(len(log.ks)) is None
        for column, item in enumerate(log.objects):
            poses = log.object_poses[:, column]
            if item.id not in exported.obstacle_ids:
                assert np.isnan(poses).any(axis=1).all()
                continue
            obstacle = scenario.obstacle_by_id(exported.obstacle_ids[item.id])
            for step, (x, y, yaw) in enumerate(poses.tolist()):
                state = obstacle.state_at_time(step)
                if math.isnan(x):
                    assert state is None
                    continue
                assert math.dist(state.position, (x, y)) <= POSITION_TOLERANCE
                assert abs(math.remainder(state.orientation - yaw, math.tau)) <= VALUE_TOLERANCE

    @staticmethod
    def shifted(text: str, k0: int) -> str:
        """Make planning problems begin at k0, with their goals and the lights as much later."""
        root = etree.fromstring(text.encode('utf-8'))
        for problem in root.findall('planningProblem'):
            problem.find('initialState/time/exact').text = str(k0)
            for bound in problem.findall('goalState/time/*'):
                bound.text = str(int(bound.text or 0) + k0)
        return etree.tostring(root, encoding='unicode')

    @staticmethod
    def with_objects(log: RunTrajectories,
                     *objects: tuple[ObjectDescription, Any]) -> RunTrajectories:
        """Add objects with poses (K, 3) to a log without any; all of them drive at 3 m/s."""
        poses = np.stack([np.asarray(track, dtype=np.float64) for _, track in objects], axis=1)
        velocities = np.stack((3.0 * np.cos(poses[..., 2]), 3.0 * np.sin(poses[..., 2]),
                               np.zeros_like(poses[..., 0])), axis=-1)
        return replace(log, descriptions=(*log.vehicles, *(item for item, _ in objects)),
                       object_poses=poses, object_velocities=velocities)

    @staticmethod
    def described(name: str, kind: str = 'car', role: Role = Role.TRAFFIC,
                  shape: Shape | None = None) -> ObjectDescription:
        """Describe an object, a 4 m x 2 m rectangle by default."""
        return ObjectDescription(name, kind, role, shape or Shape.rectangle(4.0, 2.0))

    @staticmethod
    def track(steps: int, present: set[int], yaw: float = 0.3) -> np.ndarray[Any, Any]:
        """Move along x by 0.3 m a step; NaN where absent."""
        poses = np.array([[0.3 * k, 5.0, yaw] for k in range(steps)])
        poses[[k for k in range(steps) if k not in present]] = np.nan
        return poses
