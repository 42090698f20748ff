# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The cost of FastSim's engines in the live loop: a game without and with them, in turns.

With them its AV perceives, tracks its plan by the estimated pose, and so many agents react.
"""

import argparse
from collections.abc import Mapping
from pathlib import Path
import statistics
import tempfile
import time
from typing import Any

from crgame_ros.paths import scenarios_directory
from crgame_ros.recording.reader import BagReader
from live_graph import LiveGraph
import yaml

ROWS = (('mean step error [ms]', 'mean_step_error_ms'),
        ('step error p99 [ms]', 'step_error_p99_ms'),
        ('max cumulative error [ms]', 'max_cumulative_error_ms'),
        ('timeout ratio', 'timeout_ratio'), ('busy p50 [ms]', 'busy_p50_ms'),
        ('busy p99 [ms]', 'busy_p99_ms'), ('late traffic [ticks]', 'late_ticks'),
        ('plan latency p50 [ms]', 'latency_p50_ms'), ('plan latency p99 [ms]', 'latency_p99_ms'))
# Until the first cycle.
STARTING_S = 3.0
REPORTS = ('traffic_node: agents', 'perception_node: av0')


def write_game(name: str, agents: int, folder: Path) -> Path:
    """Write a game of the package with so many agents, whose first AV perceives; none for 0."""
    values = yaml.safe_load((scenarios_directory() / f'{name}.yaml').read_text())
    values['scenario'] = str(scenarios_directory() / values['scenario'])
    kind, _, timeline = values['humans'][0]['driver'].partition(':')
    values['humans'][0]['driver'] = f'{kind}:{scenarios_directory() / timeline}'
    values.pop('duration')
    if agents:
        values['traffic'] = {'agents': agents}
        values['avs'][0] |= {'perception': {}, 'execution': 'tracked',
                             'tracker': {'name': 'lqr', 'pose': 'estimated'}}
    path = folder / f'{name}_{agents}.yaml'
    path.write_text(yaml.safe_dump(values))
    return path


def run(game: Path, duration_s: float, folder: Path) -> dict[str, Any]:
    """Run a game live; return its timing with the number of late ticks, and the nodes' reports."""
    graph = LiveGraph(folder, [str(game), '--duration', str(duration_s)])
    # Between a fourth and three fourths of the run all nodes have started and none has ended.
    time.sleep(STARTING_S + 0.25 * duration_s)
    before = graph.cpu_seconds()
    time.sleep(0.5 * duration_s)
    used = graph.cpu_seconds()
    share = {name: (used[name] - before[name]) / (0.5 * duration_s)
             for name in used if name in before}
    report = graph.wait()
    late, said = 0, dict[str, list[Mapping[str, str]]]()
    with BagReader(folder / 'bag') as reader:
        for item in reader.decoded(['/diagnostics']):
            for status in item.message.status:
                late += status.name == 'sim_node: traffic'
                if status.name in REPORTS:
                    said.setdefault(status.name, []).append(
                        {value.key: value.value for value in status.values})
    latency = report['planners']['av0']['latency_ms']
    return report | {'late_ticks': late, 'said': said, 'share': share,
                     'latency_p50_ms': latency['p50'], 'latency_p99_ms': latency['p99']}


def print_table(reports: Mapping[str, list[dict[str, Any]]]) -> None:
    """Print medians and worst of both."""
    print(f'\n{"":28}' + ''.join(f'{name:>14}{"(worst)":>12}' for name in reports))
    for label, key in ROWS:
        cells = ''
        for runs in reports.values():
            values = [float(report[key]) for report in runs]
            cells += f'{statistics.median(values):14.4g}{max(values):12.4g}'
        print(f'{label:28}{cells}')
    print('share of a core')
    for node in sorted({node for runs in reports.values() for report in runs
                        for node in report['share']}):
        cells = ''
        for runs in reports.values():
            values = [report['share'][node] for report in runs if node in report['share']]
            cells += (f'{statistics.median(values):14.1%}{max(values):12.1%}' if values
                      else f'{"-":>14}{"-":>12}')
        print(f'  {node:26}{cells}')
    for name in REPORTS:
        work = [values for report in reports['with engines'] for values in
                report['said'].get(name, [])[1:]]
        if work:
            print(f'{name}: a piece of work takes '
                  f'{statistics.median(float(item["work_ms_median"]) for item in work):.2f} ms '
                  f'(worst {max(float(item["work_ms_worst"]) for item in work):.2f})')


def main() -> None:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--game', default='intersection', help='one of the package')
    parser.add_argument('--agents', type=int, default=50)
    parser.add_argument('--runs', type=int, default=3)
    parser.add_argument('--seconds', type=float, default=30.0)
    values = parser.parse_args()
    reports: dict[str, list[dict[str, Any]]] = {'without': [], 'with engines': []}
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        games = {'without': write_game(values.game, 0, folder),
                 'with engines': write_game(values.game, values.agents, folder)}
        for number in range(values.runs):
            for label, game in games.items():
                print(f'run {number + 1} of {values.runs}, {label}: {values.seconds:g} s …',
                      flush=True)
                reports[label].append(
                    run(game, values.seconds, folder / f'{label.split()[0]}_{number}'))
    print_table(reports)


if __name__ == '__main__':
    main()
