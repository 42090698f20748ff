# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
commonroad-crime's THW, TTC and PET beside ours: a table for docs/criticality.md.

    python scripts/compare_crime.py SCENARIO.xml … [--environment DIR] [--write]

Every moving obstacle of a scenario is the subject once. commonroad-crime is installed into an
environment of its own (made once, some minutes), because it needs packages of other versions.
"""

import argparse
from collections.abc import Iterator
import json
import math
from pathlib import Path
import statistics
import subprocess
import sys
import tempfile
from typing import Any
import venv

from commonroad.scenario.obstacle import DynamicObstacle
from crgame_ros.analysis.criticality.criticality import COLUMN, Criticality
from crgame_ros.game.game import DrivabilitySpec
from crgame_ros.game.objects import ObjectDescription, ObjectStates, Role
from crgame_ros.game.scenario_scheduler import ScenarioScheduler
from crgame_ros.geometry.rigid_transform import RigidTransform
from crgame_ros.geometry.shape import Shape
from crgame_ros.scenario.loading import load_scenario, LoadedScenario
from crgame_ros.simulation.observer import ObservedRun
from crgame_ros.vehicle.state import STATE_WIDTH, StateColumn
import numpy as np
from written import between

ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / 'docs' / 'criticality.md'
PACKAGE = 'commonroad-crime==0.4.5'
# At most so many pairs and steps of a scenario are used, spread evenly.
MOST = 30
# Values this near count as the same: half a length of a car is 2 m at least.
NEAR_S = 0.05


def subjects(loaded: LoadedScenario) -> list[DynamicObstacle]:
    """Return the rectangular obstacles that move on trajectories."""
    return [item for item in loaded.scenario.dynamic_obstacles
            if hasattr(item.obstacle_shape, 'length')
            and getattr(item.prediction, 'trajectory', None) is not None]


def measured(loaded: LoadedScenario, moving: list[DynamicObstacle]) -> dict[str, Any]:
    """Measure all against all, as driven vehicles; ids are places in the list."""
    scheduler = ScenarioScheduler(round(loaded.scenario.dt * 1e9), 1, 0, 0)
    vehicles = tuple(ObjectDescription(
        str(item.obstacle_id), 'car', Role.HUMAN,
        Shape('rectangle', item.obstacle_shape.length, item.obstacle_shape.width))
        for item in moving)
    run = ObservedRun(vehicles, (), loaded, scheduler, DrivabilitySpec(), None,
                      (RigidTransform(),) * len(vehicles), np.zeros((len(vehicles), STATE_WIDTH)))
    criticality = Criticality(run)
    pairs: list[dict[str, Any]] = []
    crossings: list[dict[str, Any]] = []
    nothing = ObjectStates(np.empty((0, 3)), np.empty((0, 3)))
    for step in range(max(item.prediction.final_time_step for item in moving) + 1):
        states = np.full((len(moving), STATE_WIDTH), np.nan)
        for row, item in zip(states, moving, strict=True):
            state = item.state_at_time(step)
            if state is not None:
                row[:] = 0.0
                row[[StateColumn.X, StateColumn.Y]] = state.position
                row[StateColumn.YAW], row[StateColumn.SPEED] = state.orientation, state.velocity
        criticality.observe(step, 0.0, states, nothing)
        for tick in criticality.latest:
            for other, values in zip(tick.others.tolist(), tick.values.tolist(), strict=True):
                if math.isfinite(values[COLUMN['gap']]):
                    pairs.append({
                        'ego': moving[tick.subject].obstacle_id, 'step': step,
                        'other': moving[other].obstacle_id, 'thw': values[COLUMN['thw']],
                        'ttc': values[COLUMN['ttc']]})
        crossings += [{'ego': moving[each.first].obstacle_id, 'step': 0,
                       'other': moving[each.second].obstacle_id, 'pet': each.pet_s}
                      for each in criticality.new_crossings]
    return {'pairs': spread(pairs), 'crossings': spread(crossings)}


def spread(items: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Return `MOST` of the items at most, spread evenly."""
    places = np.linspace(0, len(items) - 1, min(MOST, len(items))).round().astype(int)
    return [items[place] for place in places]


def crime_python(environment: Path) -> Path:
    """Return the interpreter of an environment with commonroad-crime; make it where it is not."""
    python = environment / 'bin' / 'python'
    if not python.exists():
        print(f'installing {PACKAGE} into {environment} …', file=sys.stderr, flush=True)
        venv.create(environment, with_pip=True)
        subprocess.run([python, '-m', 'pip', 'install', '-q', PACKAGE], check=True)
    return python


def theirs(python: Path, file: Path, wanted: dict[str, Any]) -> dict[str, Any]:
    """Compute the same by commonroad-crime."""
    with tempfile.TemporaryDirectory() as folder:
        done = subprocess.run(
            [python, str(Path(__file__).with_name('crime_values.py')), str(file.resolve())],
            input=json.dumps(wanted), capture_output=True, text=True, cwd=folder)
    if done.returncode:
        raise SystemExit(f'{file}: {done.stderr[-600:]}')
    found: dict[str, Any] = json.loads(done.stdout.rpartition('\n@')[2])
    return found


def rows(file: Path, ours: dict[str, Any], crime: dict[str, Any]) -> Iterator[str]:
    """Compare, measure by measure."""
    for name, kind in (('THW', 'pairs'), ('TTC', 'pairs'), ('PET', 'crossings')):
        key = name.lower()
        values = [(mine[key], other) for mine, other in zip(ours[kind], crime[key], strict=True)]
        if not values:
            continue
        finite = [(mine, other) for mine, other in values
                  if other is not None and math.isfinite(mine) and math.isfinite(other)]
        same = sum(abs(mine - other) <= NEAR_S for mine, other in finite) + sum(
            not math.isfinite(mine) and other is not None and not math.isfinite(other)
            for mine, other in values)
        refused = sum(other is None for _, other in values)
        off = sorted(abs(mine - other) for mine, other in finite)
        yield (f'| {file.stem} | {name} | {len(values)} | {same} | '
               + (f'{statistics.median(off):.2f} | {off[-1]:.2f}' if off else '– | –')
               + f' | {refused} |')


def main() -> None:
    """Compare the scenarios, and print or write the table."""
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('scenarios', nargs='+', type=Path)
    parser.add_argument('--environment', type=Path, default=ROOT / '.venv-crime')
    parser.add_argument('--write', action='store_true', help='into docs/criticality.md')
    values = parser.parse_args()
    python = crime_python(values.environment)
    lines = ['| scenario | measure | values | same within 0.05 s | median difference [s] | '
             'greatest [s] | it failed |', '|---|---|---|---|---|---|---|']
    for file in values.scenarios:
        loaded = load_scenario(file)
        ours = measured(loaded, subjects(loaded))
        lines += rows(file, ours, theirs(python, file, ours))
        print(lines[-1], file=sys.stderr, flush=True)
    table = '\n'.join(lines)
    if not values.write:
        print(table)
        return
    PAGE.write_text(between(PAGE.read_text(encoding='utf-8'), 'crime', table), encoding='utf-8')


if __name__ == '__main__':
    main()
