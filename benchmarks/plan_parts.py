# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Where the time goes from a plan request to its plan.

A live run gives the whole time. The requests and plans of the same game offline go through each
part alone: sim_node writes the request, the middleware unpacks it, the planner reads it, plans,
writes the plan, the middleware unpacks that. The rest of the whole time is transport, waking up,
and waiting for a processor. Parts are processor times.
"""

import argparse
from pathlib import Path
import tempfile
import time

from crgame_ros.game.game import load_game
from crgame_ros.launcher.run_plan import with_planners
from crgame_ros.messages.joints import from_joint_trajectory, JointSeries, plan_to_joints
from crgame_ros.paths import scenarios_directory
from crgame_ros.planner.interface import PlannerContext
from crgame_ros.planner.manager import PlannerManager
from crgame_ros.planner.request_reader import RequestReader
from crgame_ros.ros.messages import SeriesMessage
from crgame_ros.simulation.offline import run_offline
from crgame_ros.simulation.setup import build_setup, Setup
from live_graph import LiveGraph
import matplotlib as mpl
from matplotlib import pyplot as plt
import numpy as np
from numpy.typing import NDArray
from rclpy.serialization import deserialize_message, serialize_message
from trajectory_msgs.msg import JointTrajectory

PLANNERS = ('constant-velocity', 'idm', 'reactive')
WANTED = {'idm': 'p99 <= 5', 'reactive': 'p99 <= 20'}
PARTS = ('request written', 'request unpacked', 'request read', 'planned', 'plan written',
         'plan unpacked and read')
REST = 'transport, waking up'
COLOURS = ('#7f7f7f', '#bcbd22', '#17becf', '#d62728', '#9467bd', '#8c564b', '#dddddd')
# A motorway on which an AV is asked to plan among 60 others.
CROWD = """
scenario: {scenarios}/ZAM_DenseMerge-1_1_T-1.xml
duration: 20
avs:
  - {{id: av0, planning_problem: 100, planner: idm}}
traffic: {{agents: 60, flow: 900, capacity: 60, seed: 17}}
drivability: {{collision: true, road: true, stop: false}}
"""


def parts_of(setup: Setup) -> dict[str, NDArray[np.float64]]:
    """Return the times of each part for all requests of the first AV of a game [ms]."""
    av, rows = setup.avs[0], []
    log = run_offline(setup, keep_messages=True).messages
    requests = [message.content for message in log
                if message.topic == f'/{av.id}/plan_request'
                and isinstance(message.content, JointSeries)]
    objects = {item.id: item for item in setup.descriptions}
    reader = RequestReader(av.id, objects, setup.scheduler)
    manager = PlannerManager(PlannerContext(
        av.id, setup.loaded.scenario, av.planning_problem, av.vehicle, objects,
        setup.scheduler.time_step_s, setup.scheduler.k0, setup.game.seed,
        setup.game.drivability.road), av.spec.planner, av.spec.options)
    asked = answered = None
    for series in requests:
        marks = [time.process_time_ns()]
        asked = SeriesMessage.for_series(series, asked)
        sent = serialize_message(asked.fill(series))
        marks.append(time.process_time_ns())
        message = deserialize_message(sent, JointTrajectory)
        marks.append(time.process_time_ns())
        request = reader.read(from_joint_trajectory(message, 'request'))
        marks.append(time.process_time_ns())
        plan = manager.plan(request)
        marks.append(time.process_time_ns())
        answer = plan_to_joints(plan, av.id, setup.scheduler.time_step_ns)
        answered = SeriesMessage.for_series(answer, answered)
        sent = serialize_message(answered.fill(answer))
        marks.append(time.process_time_ns())
        from_joint_trajectory(deserialize_message(sent, JointTrajectory), 'plan')
        marks.append(time.process_time_ns())
        rows.append(np.diff(marks) * 1e-6)
    return dict(zip(PARTS, np.transpose(rows), strict=True))


def whole_ms(game: Path, planner: str, folder: Path, seconds: float) -> dict[str, float]:
    """Return p50, p99 and max of the whole time in a live run [ms]."""
    report = LiveGraph(folder, [str(game), '--planner', planner, '--duration',
                                str(seconds)]).wait()
    latency: dict[str, float] = next(iter(report['planners'].values()))['latency_ms']
    return latency


def draw(bars: dict[str, dict[str, float]], path: Path) -> None:
    """Draw the parts of each planner's median as bars."""
    mpl.use('Agg')
    figure, axis = plt.subplots(figsize=(8.0, 0.6 + 0.45 * len(bars)), layout='constrained')
    for row, parts in enumerate(bars.values()):
        left = 0.0
        for (part, width), colour in zip(parts.items(), COLOURS, strict=True):
            axis.barh(row, width, left=left, color=colour, label=None if row else part)
            left += width
        axis.annotate(f' {left:.1f}', (left, row), va='center', fontsize=8)
    axis.set_yticks(range(len(bars)), list(bars))
    axis.invert_yaxis()
    axis.set_xlabel('from request to plan, median [ms]')
    axis.spines[['top', 'right']].set_visible(False)
    figure.legend(fontsize=8, ncols=4, loc='outside lower center')
    figure.savefig(path, dpi=110)


def main() -> None:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--seconds', type=float, default=20.0, help='of each live run')
    parser.add_argument('--picture', type=Path, metavar='FILE', help='draw the parts')
    values = parser.parse_args()
    bars: dict[str, dict[str, float]] = {}
    with tempfile.TemporaryDirectory() as name:
        crowd = Path(name) / 'crowd.yaml'
        crowd.write_text(CROWD.format(scenarios=scenarios_directory()))
        print(f'{"median [ms]":32}{"p50":>7}{"p99":>7}{"worst":>7}  '
              + ''.join(f'{part:>24}' for part in (*PARTS, REST)))
        for title, game in (('cut-in', scenarios_directory() / 'cut_in.yaml'),
                            ('60 others', crowd)):
            for planner in PLANNERS:
                setup = with_planners(build_setup(load_game(game)), (planner,))
                times = parts_of(setup)
                whole = whole_ms(game, planner, Path(name) / f'{title}{planner}', values.seconds)
                medians = {part: float(np.median(times[part])) for part in PARTS}
                medians[REST] = max(0.0, whole['p50'] - sum(medians.values()))
                bars[f'{planner}, {title}'] = medians
                print(f'{f"{planner}, {title}":32}{whole["p50"]:7.2f}{whole["p99"]:7.2f}'
                      f'{whole["max"]:7.2f}  '
                      + ''.join(f'{value:24.3f}' for value in medians.values())
                      + f'  planned p99 {np.percentile(times["planned"], 99):.2f}  '
                      + WANTED.get(planner, ''), flush=True)
    if values.picture is not None:
        draw(bars, values.picture)


if __name__ == '__main__':
    main()
