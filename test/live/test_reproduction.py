# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The live part of `crgame reproduce`: table I from a graph, and its human replayed."""

from pathlib import Path

from crgame_ros.reproduction.commonroad_game import write_timing_figure
from crgame_ros.reproduction.expectation import judge
from crgame_ros.reproduction.recorded_human import read_recorded
from crgame_ros.reproduction.single_av_evaluation import HUMAN_EXPECTATIONS, SameHuman
from crgame_ros.reproduction.synchronization import (
    judge_synchronization,
    measure_synchronization,
)
from live_support import CUT_IN
import pytest

pytestmark = pytest.mark.clock
DURATION_S = 5.0


@pytest.mark.usefixtures('ros_domain')
def test_both_loops(tmp_path: Path) -> None:
    """Our loop has the smaller errors; its human meets other planners to the last bit."""
    found = measure_synchronization(CUT_IN, 'idm', DURATION_S, tmp_path)
    judged = judge_synchronization(found)
    assert all(each.is_met for each in judged), [each.line for each in judged]
    ours, naive = found.table.summaries
    assert ours.cycles == pytest.approx(DURATION_S * 100, abs=2)
    assert naive.duration_s == pytest.approx(DURATION_S, abs=0.1)
    names = {path.name for path in write_timing_figure(found, tmp_path, ('svg',))}
    assert names == {'figure_14_timing.svg', 'table_1.txt', 'table_1.csv', 'table_1.md'}
    recorded = read_recorded('cut_in', 'idm', tmp_path / 'proposed')
    assert recorded.live is not None
    assert recorded.live.contacts == []
    runs = tuple(map(recorded.against, ('idm', 'constant-velocity')))
    assert all(each.is_met for each in judge(
        '', HUMAN_EXPECTATIONS, SameHuman(recorded.log, runs)))
