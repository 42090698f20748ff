# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A planner that fails is told of: its first traceback at once, then one line a minute."""

from pathlib import Path
import re

from crgame_ros import each_minute
from crgame_ros.each_minute import EachMinute
from crgame_ros.planner.manager import FailureLines, PlannerManager
from crgame_ros.vehicle.state import VehicleState
import planner_support as support
import pytest

EGO = VehicleState(0.0, 0.0, 0.0, 10.0, 0.05, 0.3, 0.19, 0.0)
FAILING = '''
import crgame_ros


class Failing(crgame_ros.Planner):
    name = 'failing'
    calls = 0

    def setup(self, context):
        """Set nothing up."""

    def plan(self, request):
        self.calls += 1
        return self.search(request)

    def search(self, request):
        raise ValueError(f'call {self.calls}: no path')
'''


def test_the_first_failure_is_shown_from_the_planner_on_and_others_are_counted(
        tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    now_s = 1000.0
    monkeypatch.setattr(each_minute.time, 'monotonic', lambda: now_s)
    (tmp_path / 'failing.py').write_text(FAILING)
    manager = PlannerManager(support.context(support.plain(), support.problem(10.0)),
                             f'{tmp_path / "failing.py"}:Failing', {})
    said: list[str] = []
    lines = FailureLines('av0', said.append)
    lines.note(manager)
    assert said == []
    for _ in range(10):
        manager.plan(support.request(EGO))
        lines.note(manager)
        now_s += 10.0
    first, braked, later = said
    assert 'av0: planner' in first and first.endswith('ValueError: call 1: no path')
    # Its own frames only, the outermost first.
    assert re.findall(r'File "(.*)", line \d+, in (\w+)', first) == [
        (str(tmp_path / 'failing.py'), 'plan'), (str(tmp_path / 'failing.py'), 'search')]
    assert braked.endswith('ValueError: call 1: no path')
    assert later.endswith('ValueError: call 7: no path (5 more since the last such line)')
    lines.refuse(None)
    lines.refuse('1.4 m from the vehicle')
    lines.refuse('1.5 m from the vehicle')
    assert said[3:] == [
        'av0: its planner answered, but the plan was refused: 1.4 m from the vehicle']


def test_kinds_without_end_share_a_line() -> None:
    """A sender that makes up kinds gets no more lines than there are kinds."""
    minute = EachMinute()
    told = [minute.line(f'kind {i}', str(i)) for i in range(1000)]
    assert len([line for line in told if line is not None]) == each_minute.MOST_KINDS + 1


def test_a_slow_planner_is_told_of_with_its_time() -> None:
    """Once its median answer takes longer than a scenario step; one long answer is none."""
    manager = PlannerManager(support.context(support.plain(), support.problem(10.0)), 'idm', {})
    said: list[str] = []
    lines = FailureLines('av0', said.append, 0.1)
    for took_s in (1.5, 0.02, 0.02, 0.02, 0.02, 1.5, 1.5):
        manager.statistics.durations_s.append(took_s)
        lines.note(manager)
    assert said == []
    for _ in range(3):
        manager.statistics.durations_s.append(1.5)
        lines.note(manager)
    assert said == ['av0: planner idm is slow: 1.50 s for a plan, a scenario step is 0.1 s']


def test_requests_without_an_answer_are_told_of() -> None:
    """Of an external planner nothing else is known."""
    said: list[str] = []
    lines = FailureLines('av0', said.append)
    for timed_out in (0, 0, 2, 2, 3):
        lines.wait(timed_out, 1.0)
    assert said == [
        'av0: its planner is slow or gone: no answer in 1 s, requests so far without one: 2']
