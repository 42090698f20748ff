# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The split of a late step: its causes, and that they add up to its lateness."""

from crgame_ros.timing.cycle_rows import CycleRows, CycleTable, LATE_COLUMNS
from crgame_ros.timing.late_step import (
    Causes,
    causes_of,
    longest_phase,
    NO_CAUSES,
    Phase,
    PhaseUse,
    StepConditions,
)
from crgame_ros.timing.late_steps import LateSteps, WORST
from crgame_ros.timing.time_controller import Cycle
import numpy as np
import pytest

MS = 1e6
STEP_MS = 10.0


def split(*uses: PhaseUse, late_ms: float, around: StepConditions | None = None) -> Causes:
    """Split a step's lateness [ms]."""
    found = causes_of(uses, late_ms * MS, around or StepConditions())
    return Causes(*(time_ns / MS for time_ns in found))


def use(phase: Phase, lasted: float, computed: float, waited: float | None = 0.0,
        collected: float = 0.0, minor: int = 0, major: int = 0) -> PhaseUse:
    """Make the use of a phase; times in [ms]."""
    return PhaseUse(phase, lasted * MS, computed * MS, None if waited is None else waited * MS,
                    collected * MS, minor, major)


USUAL = (use(Phase.INPUTS, 0.25, 0.25), use(Phase.STEP, 1.0, 1.0), use(Phase.PUBLISH, 0.75, 0.75))


def test_each_kind_of_time_has_its_name() -> None:
    """
    After 2 ms of usual work and a cause of 20 ms a step is 12 ms late, all by that cause.

    The step has time for its own work of 2 ms and for 8 ms of the rest.
    """
    for strange, around, cause in (
            (use(Phase.STEP, 20.0, 0.0, 20.0), StepConditions(), 'processor'),
            (use(Phase.STEP, 20.0, 0.0, 0.0), StepConditions(), 'blocked'),
            (use(Phase.STEP, 20.0, 0.0, 0.0, major=1), StepConditions(), 'page_faults'),
            (use(Phase.STEP, 20.0, 0.0, 0.0), StepConditions(stopped=True), 'stopped'),
            (use(Phase.STEP, 20.0, 20.0, collected=20.0), StepConditions(), 'gc'),
            (use(Phase.STEP, 20.0, 20.0, minor=20_000), StepConditions(fault_ns=1000.0),
             'page_faults'),
            (use(Phase.SERVICES, 20.0, 5.0), StepConditions(), 'services'),
            (use(Phase.STEP, 20.0, 20.0), StepConditions(stolen_ns=20.0 * MS), 'host'),
            (use(Phase.STEP, 20.0, 0.0, 20.0), StepConditions(stolen_ns=20.0 * MS), 'host'),
            (use(Phase.STEP, 20.0, 20.0), StepConditions(), 'work')):
        found = split(*USUAL, strange, late_ms=2.0 + 20.0 - STEP_MS, around=around)
        assert found == pytest.approx(NO_CAUSES._replace(**{cause: 12.0})), cause


def test_a_wait_counts_from_the_time_at_which_it_should_have_ended() -> None:
    """A wait is 3 ms too long: a part by the run queue, and a part by a late timer."""
    overslept = use(Phase.WAIT, 3.0, 0.1, 2.0)
    assert split(*USUAL, overslept, late_ms=3.0) == pytest.approx(
        Causes(processor=2.0, host=1.0))
    assert split(*USUAL, overslept, late_ms=3.0, around=StepConditions(stopped=True)) \
        == pytest.approx(Causes(processor=2.0, stopped=1.0))
    # It was on the run queue before its time as well.
    assert split(*USUAL, use(Phase.WAIT, 3.0, 0.1, 7.0), late_ms=3.0) == pytest.approx(
        Causes(processor=3.0))


def test_what_the_kernel_does_not_tell_stays_unexplained() -> None:
    """Without run delays the cause of a waiting thread is unknown; its computing is known."""
    found = split(use(Phase.STEP, 20.0, 14.0, None), use(Phase.WAIT, 0.0, 0.1, None),
                  late_ms=10.0)
    assert found == pytest.approx(Causes(work=4.0 + 6.0))
    found = split(use(Phase.STEP, 20.0, 4.0, None), late_ms=10.0)
    assert found == pytest.approx(Causes(work=4.0))


def test_the_phase_that_took_longest() -> None:
    """A wait counts only with its excess time."""
    assert longest_phase((*USUAL, use(Phase.WAIT, 0.1, 0.1))) is Phase.STEP
    assert longest_phase((*USUAL, use(Phase.WAIT, 1.1, 0.1))) is Phase.WAIT


def rows_of(late_s: dict[int, tuple[float, Causes, Phase]], steps: int, resets: int = 0
            ) -> CycleTable:
    """Make cycles 1 … steps, some of which are late; the last so many with a drift reset."""
    rows = CycleRows(('hv0',), steps)
    for n in range(1, steps + 1):
        error_s, causes, phase = late_s.get(n, (0.0, NO_CAUSES, None))
        rows.add(0, 0, Cycle(n, 0.01 * n, 0.01 * n + error_s, error_s, error_s, 0.01,
                             max(0, n - steps + resets), 0.0), 0.001, 0.008, (None,), causes,
                 phase)
    return CycleTable.from_message(','.join(rows.columns), rows.taken())


def test_late_steps_are_told_with_their_causes() -> None:
    """Two late steps, one of which moved the schedule, and one that is not late enough."""
    table = rows_of({
        5: (0.0004, Causes(work=0.0004), Phase.STEP),
        7: (0.040, Causes(processor=0.030, work=0.009), Phase.PUBLISH),
        20: (0.300, Causes(blocked=0.300), Phase.STEP)}, 20, resets=1)
    late = LateSteps()
    for part in np.array_split(table.rows, 3):
        late.add_table(CycleTable(table.columns, part))
    told = late.as_dict()
    assert told is not None
    assert (told['count'], told['late_ms']) == (2, pytest.approx(340.0))
    assert told['by_cause']['processor'] == {'ms': pytest.approx(30.0), 'steps': 1, 'resets': 0}
    assert told['by_cause']['blocked'] == {'ms': pytest.approx(300.0), 'steps': 1, 'resets': 1}
    assert told['by_cause']['unexplained']['ms'] == pytest.approx(1.0)
    assert sum(entry['ms'] for entry in told['by_cause'].values()) == pytest.approx(340.0)
    assert (told['resets_from_outside'], told['resets_of_ours']) == (0, 1)
    assert [(step['n'], step['cause'], step['during'], step['reset'])
            for step in told['worst']] == [(20, 'blocked', 'step', True),
                                           (7, 'processor', 'publish', False)]
    assert [step['text'] for step in told['worst']] == [
        '300.0 ms late at 0.50 s (n = 20) while stepping: 300.0 ms blocked in a call; '
        'the schedule was moved',
        '40.0 ms late at 0.11 s (n = 7) while publishing: 30.0 ms waiting for the processor, '
        '9.0 ms own work, 1.0 ms unexplained']


def test_only_the_worst_are_kept() -> None:
    """For any length of a run they are those of the greatest lateness."""
    late = LateSteps()
    late.add_table(rows_of({n: (0.001 * (1 + n * 7 % 50), NO_CAUSES, Phase.STEP)
                            for n in range(1, 51)}, 50))
    assert late.count == 50
    assert [round(1e3 * step.late_s) for step in late.worst] == list(range(50, 50 - WORST, -1))


def test_recordings_of_earlier_versions_do_not_tell() -> None:
    """Without the columns there is nothing; bad numbers cost their row."""
    table = rows_of({3: (0.010, Causes(work=0.010), Phase.STEP)}, 5)
    kept = [i for i, name in enumerate(table.columns) if name not in LATE_COLUMNS]
    before = LateSteps()
    before.add_table(CycleTable([table.columns[i] for i in kept], table.rows[:, kept]))
    assert before.as_dict() is None
    table.rows[1, table.columns.index('step_error_s')] = np.inf
    table.rows[2, table.columns.index('late_gc_s')] = np.nan
    table.rows[3, table.columns.index('late_in')] = 77.0
    table.rows[3, table.columns.index('step_error_s')] = 0.002
    strange = LateSteps()
    strange.add_table(table)
    assert [(step.n, step.during, step.main_cause) for step in strange.worst] == [
        (4, None, 'unexplained')]
