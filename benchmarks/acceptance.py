# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The share of a planner's own plans in its answers, in our games and published scenarios.

Each run is exported as well, and each contact of an AV is named with its part in it.
"""

import argparse
from pathlib import Path
import time

from crgame_ros.launcher.arguments import RunRequest
from crgame_ros.launcher.run_plan import effective_game, with_planners
from crgame_ros.paths import scenarios_directory
from crgame_ros.recording.export import export_scenario
from crgame_ros.recording.run_trajectories import trajectories_of
from crgame_ros.scenario.export_network import schema_errors
from crgame_ros.simulation.contacts import contacts_of
from crgame_ros.simulation.offline import run_offline
from crgame_ros.simulation.setup import build_setup
from lxml import etree
import numpy as np


def report(name: str, request: RunRequest, planner: str) -> None:
    """Run one game with one planner, export it, and print its row and contacts."""
    setup = with_planners(build_setup(effective_game(request)), (planner,))
    result = run_offline(setup, clock_s=time.perf_counter)
    exported = export_scenario(trajectories_of(result))
    assert not schema_errors(etree.fromstring(exported.xml_text.encode('utf-8')))
    violations = sorted({item.vehicle_id for item in result.violations if not item.is_valid})
    for av_id, record in result.planners.items():
        p50, p99 = np.percentile(record.statistics.durations_s, [50, 99]) * 1e3
        print(f'{name:34}{planner:18}{av_id:5}{record.accepted_ratio:9.1%}{p50:8.1f}{p99:8.1f}'
              f'  {", ".join(violations):12}'
              + '; '.join(f'{count} x {why}' for why, count in record.statistics.reasons.items()),
              flush=True)
    for contact in contacts_of(result):
        print(f'{"":34}{contact.vehicle_id} touches {contact.other_id} at '
              f'{contact.n * setup.scheduler.dt_s:.2f} s with its {contact.side} '
              f'({contact.kind}, {contact.speed:.1f} m/s, the other {contact.other_speed:.1f}); '
              f'avoidable by {contact.verdict}', flush=True)


def main() -> None:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('scenarios', nargs='*', type=Path, help='CommonRoad files, 10 s each')
    parser.add_argument('--planner', nargs='+', default=['idm', 'reactive'])
    values = parser.parse_args()
    print(f'{"":34}{"planner":18}{"AV":5}{"real":>9}{"p50 ms":>8}{"p99 ms":>8}  violations by')
    games = [path for path in sorted(scenarios_directory().glob('*.yaml'))
             if path.name.count('.') == 1]
    for planner in values.planner:
        for game in games:
            report(game.stem, RunRequest(game=game), planner)
        for path in values.scenarios:
            report(path.stem, RunRequest(scenario=path, driver='idle', duration_s=10.0), planner)


if __name__ == '__main__':
    main()
