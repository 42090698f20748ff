# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The nodes of a graph over the games of a session, with processes that do not run."""

from dataclasses import asdict
import json
import os
from pathlib import Path

from crgame_ros.launcher import launch
from crgame_ros.launcher.launch import Graph
from crgame_ros.launcher.node_process import NodeSpec
from crgame_ros.launcher.node_specs import participant_specs, Roster
from crgame_ros.simulation.roster import Participants
import pytest

FIRST = NodeSpec('sim_node')
GAME = Participants(humans={}, avs={'av0': 'reactive'}, perceiving=(), traffic=False,
                    occupancy=False, instruments=False)


class Process:
    """A node that has ended with a code, or runs for a while."""

    codes: dict[str, int | None] = {}

    def __init__(self, spec: NodeSpec, _namespace: str) -> None:
        self.spec, self.pid = spec, 1
        reading, writing = os.pipe()
        os.close(writing)
        self.output = os.fdopen(reading, 'rb', buffering=0)
        self._patience = 100

    def read_lines(self) -> list[str]:
        return []

    def exit_code(self) -> int | None:
        self._patience -= 1
        return self.codes.get(self.spec.name, None if self._patience else 0)

    def interrupt(self) -> None:
        self.codes.setdefault(self.spec.name, 0)

    def kill(self) -> None:
        pass

    def close(self) -> None:
        self.output.close()


@pytest.mark.parametrize(('code', 'starts'), ((2, 1), (1, 6)))
def test_another_game_starts_a_node_that_was_given_up(
        code: int, starts: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What ended a node may be over in the next game."""
    path, said = tmp_path / 'roster.json', list[str]()
    path.write_text(json.dumps(asdict(GAME)))

    def say(line: str) -> None:
        said.append(line)
        if line.endswith('the others go on'):
            if said.count(line) == 2:
                Process.codes[FIRST.name] = 0
                return
            fresh = path.with_suffix('.new')
            fresh.write_text(path.read_text())
            fresh.replace(path)

    monkeypatch.setattr(launch, 'NodeProcess', Process)
    monkeypatch.setattr(Process, 'codes', {'planner_node_av0': code})
    roster = Roster(path)
    # The graph begins with the nodes of the first game.
    assert roster.changed_specs() == []
    assert Graph([FIRST, *participant_specs(GAME, path)], say, roster).run() == 0
    assert said.count('planner_node_av0: process 1') == 2 * starts
