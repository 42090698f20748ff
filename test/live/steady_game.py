# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A game for the failure tests: the human holds the pedal and the AV drives on."""

from pathlib import Path
from typing import NamedTuple

from live_peer import Peer
from live_support import Launcher, SCENARIOS

STEP_S, STEP_NS = 0.01, 10_000_000
# A driver holds this pedal all the time; float32 represents it exactly.
THROTTLE = 0.375

GAME = f"""
scenario: {SCENARIOS / 'ZAM_CutIn-1_1_T-1.xml'}
duration: 3600
humans:
  - id: hv0
    driver: joy:steady.joy.yaml
    spawn: {{lanelet: 13, s: 234.0, d: 0.0, speed: 26.0}}
avs:
  - {{id: av0, planning_problem: 100, planner: idm}}
"""
TIMELINE = f"""
joy:
  axes: [throttle, brake, steering]
  points: [[0.0, {THROTTLE}, 0.0, 0.0], [3600.0, {THROTTLE}, 0.0, 0.0]]
"""
TOPICS = ('/clock', '/scenario/game', '/timing/cycle', '/vehicles/state', '/diagnostics',
          ('/<v>/driver_command', 'hv0'), ('/<av>/plan', 'av0'), ('/<av>/plan_request', 'av0'),
          ('/<v>/drivability', 'hv0'))


class Run(NamedTuple):
    """A graph that runs and a node that listens to it."""

    launcher: Launcher
    peer: Peer

    def wait_for_steps(self, steps: int) -> None:
        """Wait until the simulation has gone so many steps on."""
        last = self.peer.n + steps
        self.peer.wait_until(lambda: self.peer.n >= last, f'n = {last}')

    def counters(self) -> dict[str, str]:
        """Return what sim_node reported last about the plans of av0."""
        return self.peer.statuses('sim_node: av0 plans')[-1][1]


def write_steady_game(folder: Path) -> Path:
    """Write the game and its timeline into a folder, and return the game file."""
    (folder / 'steady.joy.yaml').write_text(TIMELINE)
    (folder / 'steady.yaml').write_text(GAME)
    return folder / 'steady.yaml'
