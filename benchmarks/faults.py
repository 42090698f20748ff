#!/usr/bin/env python3
# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Kill and freeze every node of running games, and measure the effect on the others.

    source scripts/env.sh
    $CRGAME_PYTHON benchmarks/faults.py [--games GAME.yaml …] [--faults kill freeze]

A Markdown table: how long until the node's own messages are there again, the longest time without
a plan for an AV meanwhile (planners answer ten times a second), how late the 100 Hz loop was at
worst, and at the end of each game what its recording has lost.
"""

import argparse
from collections import defaultdict
from collections.abc import Callable, Iterator
import json
import os
from pathlib import Path
import signal
import sys
import tempfile
import time
from typing import Any
import urllib.request

from live_graph import LiveGraph, RemoteControl

ROOT = Path(__file__).resolve().parents[1]
GAMES = ('occluded_pedestrian', 'dense_merge', 'two_avs')
# Quiet before a fault, how long it is watched at most, and how long a frozen node stands [s].
QUIET_S, WATCHED_S, FROZEN_S = 3.0, 10.0, 3.0
# Until the effects of a kill have ended.
REST_S = 4.0
NS = 1e-9


class Ear:
    """
    Listens to the messages of a graph's nodes.

    :param avs: ids of the AVs; humans likewise.
    :param page: address of the cockpit.
    """

    def __init__(self, avs: list[str], humans: list[str], page: str) -> None:
        from crgame_ros.ros.endpoints import Endpoints
        import rclpy
        self._node = rclpy.create_node('faults')
        endpoints = Endpoints(self._node)
        topics = [('/timing/cycle', ''), ('/diagnostics', ''), ('/traffic/agents', ''),
                  ('/occupancy', ''), ('/markers', ''),
                  *(('/<av>/plan', av) for av in avs), *(('/<av>/plan_request', av) for av in avs),
                  *(('/<v>/driver_command', human) for human in humans),
                  *(('/<v>/drivability', human) for human in humans)]
        self._slots = {(name, vehicle): endpoints.polled(
            name, vehicle, raw=name not in ('/diagnostics', '/timing/cycle'), depth=1000)
            for name, vehicle in topics}
        # When what came, by the wall clock [s].
        self.heard: dict[tuple[str, str], list[float]] = defaultdict(list)
        self.lags: list[tuple[float, float]] = []
        self.first, self.page = humans[0], page

    def listen(self, seconds: float, done: Callable[[], bool] = lambda: False) -> None:
        """Receive messages, for a time or until a condition holds."""
        until_s = time.time() + seconds
        while time.time() < until_s and not done():
            for key, slot in self._slots.items():
                while (taken := slot.pop_timed()) is not None:
                    self._note(key, taken[0], taken[2] * NS)
            time.sleep(0.005)

    def _note(self, key: tuple[str, str], message: Any, at_s: float) -> None:
        from crgame_ros.timing.cycle_rows import CycleTable
        if key[0] == '/timing/cycle':
            table = CycleTable.from_message(message.layout.dim[1].label, message.data)
            self.lags.append((at_s, float(table.column('cumulative_error_s').max())))
        elif key[0] == '/diagnostics':
            for status in message.status:
                self.heard[key[0], status.name.split(':')[0]].append(at_s)
        self.heard[key].append(at_s)

    def speaks(self, node: str) -> Callable[[float], float | None]:
        """Return what tells since when a node works, after a time; None: not yet."""
        kind, _, vehicle = node.partition('_node')
        vehicle = vehicle.removeprefix('_')
        sign = {'planner': ('/<av>/plan', vehicle), 'perception': ('/<av>/plan_request', vehicle),
                'driver': ('/<v>/driver_command', vehicle or self.first),
                'drivability': ('/<v>/drivability', self.first), 'map': ('/occupancy', ''),
                'traffic': ('/traffic/agents', ''), 'marker': ('/markers', ''),
                'timesync': ('/diagnostics', 'timesync_node')}.get(kind)

        def since(after_s: float) -> float | None:
            if sign is None:
                return time.time() if kind == 'cockpit' and self._page_answers() else None
            return next((at for at in self.heard[sign] if at > after_s), None)
        return since

    def _page_answers(self) -> bool:
        try:
            with urllib.request.urlopen(self.page, timeout=0.5) as answer:
                return bool(answer.status == 200)
        except OSError:
            return False

    def longest_gap_s(self, avs: list[str], from_s: float) -> float:
        """Return the longest time without a plan for an AV."""
        longest = 0.0
        for av in avs:
            times = [at for at in self.heard['/<av>/plan', av] if at > from_s - 1.0]
            times.append(time.time())
            longest = max([longest, *(b - a for a, b in zip(times, times[1:], strict=False))])
        return longest


def try_game(game: Path, faults: list[str], wanted: list[str]) -> Iterator[tuple[str, ...]]:
    """Try every fault on every node of a game; return a row of the table for each."""
    with tempfile.TemporaryDirectory() as name:
        graph = LiveGraph(Path(name) / 'run', [str(game), '--duration', '3600'], headless=False)
        try:
            page = graph.page()
            control = RemoteControl()
            control.wait_until_running()
            nodes = [node for node in graph.node_pids() if node != 'sim_node']
            ids = [node.partition('_node_')[2] for node in nodes]
            avs = [i for i, node in zip(ids, nodes, strict=True) if node.startswith('planner')]
            humans = [i for i, node in zip(ids, nodes, strict=True) if node.startswith('driver')]
            ear = Ear(avs, humans, page)
            # A run that ends before its first scenario step leaves no files.
            ear.listen(QUIET_S)
            for node in nodes:
                for fault in faults if not wanted or node in wanted else ():
                    # Put all vehicles at their start: at the end of a road there is nothing to do.
                    control.call('reset')
                    ear.listen(REST_S if fault == 'kill' else QUIET_S)
                    yield game.stem, node, *_strike(graph, ear, node, fault, avs)
            graph.stop()
            yield game.stem, 'all', 'end', *_lost(Path(name) / 'run')
            control.close()
        finally:
            graph.kill()


def _strike(graph: LiveGraph, ear: Ear, node: str, fault: str, avs: list[str]) -> tuple[str, ...]:
    pid, began_s = graph.node_pids()[node], time.time()
    works = ear.speaks(node)
    if fault == 'freeze':
        os.kill(pid, signal.SIGSTOP)
        ear.listen(FROZEN_S)
        os.kill(pid, signal.SIGCONT)
        began_s, fresh_s = time.time(), [time.time()]
    else:
        os.kill(pid, signal.SIGKILL)
        fresh_s = []
    back_s: float | None = None

    def is_back() -> bool:
        nonlocal back_s
        if not fresh_s and graph.node_pids()[node] != pid:
            fresh_s.append(time.time())
        if fresh_s and back_s is None:
            back_s = works(fresh_s[0])
        return back_s is not None

    ear.listen(WATCHED_S if not node.startswith('recorder') else QUIET_S, is_back)
    ear.listen(2.0)
    lag_s = max((lag for at, lag in ear.lags if at > began_s - FROZEN_S), default=0.0)
    back = '' if back_s is None else f'{max(0.0, back_s - began_s):.2f} s'
    return (fault, back, f'{ear.longest_gap_s(avs, began_s):.2f} s', f'{lag_s * 1e3:.1f} ms')


def _lost(folder: Path) -> tuple[str, ...]:
    """Sum up the contents of the recordings of all runs of a graph."""
    reports = [json.loads(path.read_text()) for path in folder.rglob('timing.json')]
    return ('', f'{sum(item["cycles"] for item in reports)} cycles recorded',
            f'{sum(item["gaps"] for item in reports)} missing', )


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--games', nargs='+', type=Path, metavar='GAME.yaml',
                        default=[ROOT / 'scenarios' / f'{name}.yaml' for name in GAMES])
    parser.add_argument('--faults', nargs='+', choices=('kill', 'freeze'),
                        default=['kill', 'freeze'])
    parser.add_argument('--nodes', nargs='+', metavar='NAME', default=[])
    arguments = parser.parse_args()
    print('| game | node | fault | works again after | longest time without a plan | worst lag |')
    print('|---|---|---|---|---|---|', flush=True)
    for game in arguments.games:
        for row in try_game(game, arguments.faults, arguments.nodes):
            print('| ' + ' | '.join(row) + ' |', flush=True)


if __name__ == '__main__':
    sys.exit(main())
