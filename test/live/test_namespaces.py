# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Two graphs in one ROS domain: separate in two namespaces, refused in the same one."""

import json
import os
from pathlib import Path
import signal
import subprocess
import sys

from live_support import CUT_IN, Launcher
import pytest
from steady_game import write_steady_game

SECONDS = 5


def _finished(launcher: Launcher) -> None:
    """Check that a run has all its cycles, and none of another run."""
    assert launcher.wait() == 0, launcher.text
    timing = json.loads((launcher.out / 'timing.json').read_text())
    assert timing['cycles'] == SECONDS * 100 and timing['gaps'] == 0
    # The machine may be busy; nothing else is to be said.
    assert [text for text in timing['notices'] if not text.startswith('slower than')] == []
    assert timing['planners']['av0']['accepted'] > 10
    assert len(list(launcher.out.glob('*.xml'))) == 1


@pytest.mark.exhaustive
def test_two_graphs_in_one_domain_do_not_touch_each_other(tmp_path: Path) -> None:
    duration = ['--duration', str(SECONDS)]
    with Launcher([CUT_IN, *duration, '--namespace', '/exp1'], tmp_path / 'one') as one, \
            Launcher([CUT_IN, *duration, '--namespace', 'exp2/b'], tmp_path / 'two',
                     domain=one.domain) as two:
        _finished(one)
        _finished(two)


@pytest.mark.exhaustive
def test_a_second_simulation_in_a_namespace_is_refused(tmp_path: Path) -> None:
    """The launcher refuses before it starts a node; so does a sim_node started by hand."""
    game = write_steady_game(tmp_path)
    with Launcher([game, '--namespace', '/exp1'], tmp_path / 'one') as one:
        one.wait_for('recording into')
        one.wait_for('planner idm is ready')
        with Launcher([game, '--namespace', '/exp1'], tmp_path / 'two',
                      domain=one.domain) as two:
            assert two.wait() == 2
            refusal = ('error: another simulation runs in namespace /exp1 of ROS_DOMAIN_ID '
                       f'{one.domain}; end it, or give this one a --namespace or another '
                       'ROS_DOMAIN_ID')
            assert [line for line in two.errors if line] == [refusal]
            assert two.started == []
            assert not two.out.exists()
        node = subprocess.run(
            [sys.executable, '-m', 'crgame_ros.nodes.sim_node', '--ros-args', '-r',
             '__ns:=/exp1'], env=os.environ | {'ROS_DOMAIN_ID': str(one.domain)},
            capture_output=True, text=True, timeout=90.0, check=False)
        assert node.returncode == 2
        assert node.stderr.splitlines() == [refusal]
        one.signal(signal.SIGINT)
        assert one.wait() == 0


def test_what_is_no_namespace_is_refused(tmp_path: Path) -> None:
    with Launcher([CUT_IN, '--namespace', '/a b'], tmp_path / 'run') as launcher:
        assert launcher.wait() == 2
        assert any('is no namespace' in line for line in launcher.errors)
