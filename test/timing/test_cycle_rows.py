# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The rows of /timing/cycle: filled, taken and read back."""

import math

from crgame_ros.errors import InputError
from crgame_ros.timing.cycle_rows import CycleRows, CycleTable, TIMING_COLUMNS
from crgame_ros.timing.time_controller import Cycle
from crgame_ros.vehicle.driver_command import DriverCommand
import numpy as np
import pytest

FIRST = Cycle(7, 0.07, 0.0701, 0.0001, 0.0002, 0.0101, 1, 0.3)
SECOND = Cycle(8, 0.08, 0.0805, 0.0002, 0.0005, 0.0099, 2, 0.4)
LEFT = DriverCommand(float(np.float32(0.3)), 0.0, float(np.float32(0.1)), False)
BACK = DriverCommand(0.0, 1.0, -1.0, True)


def filled() -> CycleRows:
    """Fill two cycles of two humans."""
    rows = CycleRows(('hv0', 'hv1'), 3)
    rows.add(4, 12, FIRST, 0.002, 0.008, (LEFT, BACK))
    rows.add(4, 13, SECOND, 0.003, 0.007, (BACK, LEFT))
    return rows


def test_columns_name_what_is_in_them() -> None:
    """Each value is found under its name after the way through the flat message."""
    rows = filled()
    table = CycleTable.from_message(','.join(rows.columns), rows.taken())
    assert table.rows.shape == (2, 12 + 9 + 1 + 2 * 6)
    expected = {'epoch': (4, 4), 'n': (7, 8), 'k': (12, 13), 'ideal_s': (0.07, 0.08),
                'actual_s': (0.0701, 0.0805), 'step_error_s': (0.0001, 0.0002),
                'cumulative_error_s': (0.0002, 0.0005), 'busy_s': (0.002, 0.003),
                'sleep_s': (0.008, 0.007), 'dt_eff_s': (0.0101, 0.0099), 'resets': (1, 2),
                'dropped_s': (0.3, 0.4)}
    assert tuple(expected) == TIMING_COLUMNS
    for name, values in expected.items():
        assert table.column(name).tolist() == list(values)
    assert table.epoch == 4


def test_starts_on_the_steady_clock_are_those_that_are_known() -> None:
    """Of a live run, to the nanosecond; offline cycles and earlier versions have none."""
    rows = filled()
    rows.add(4, 14, SECOND, 0.0, 0.0, (LEFT, BACK), steady_s=123_456.000_000_007)
    table = CycleTable.from_message(','.join(rows.columns), rows.taken())
    assert table.steady_rows().tolist() == [[8.0, 123_456.000_000_007]]
    assert not len(CycleTable(TIMING_COLUMNS, table.rows[:, :12]).steady_rows())


def test_commands_keep_their_bits() -> None:
    """Exact reproduction replays them: float32 values pass through unchanged."""
    rows = filled()
    table = CycleTable.from_message(','.join(rows.columns), rows.taken())
    assert table.commands('hv0').tolist() == [list(map(float, LEFT)), list(map(float, BACK))]
    assert table.commands('hv1').tolist() == [list(map(float, BACK)), list(map(float, LEFT))]
    with pytest.raises(InputError, match='hv2 took no part'):
        table.commands('hv2')


def test_an_av_that_follows_its_plan_has_no_command() -> None:
    """Its five columns are NaN, or the command of the driver that takes it over."""
    rows = CycleRows(('hv0', 'av0'), 2)
    rows.add(0, 1, FIRST, 0.0, 0.0, (LEFT, None))
    rows.add(0, 1, SECOND, 0.0, 0.0, (LEFT, BACK))
    commands = CycleTable.from_message(','.join(rows.columns), rows.taken()).commands('av0')
    assert np.isnan(commands[0]).all()
    assert commands[1].tolist() == list(map(float, BACK))


@pytest.mark.parametrize('without', [('/put_back',), ('/lights', '/put_back')])
def test_rows_of_earlier_versions_have_no_switches(without: tuple[str, ...]) -> None:
    """They had four or five columns; the rest was off, and undriven vehicles stay NaN."""
    rows = CycleRows(('hv0', 'av0'), 2)
    rows.add(0, 1, FIRST, 0.0, 0.0, (LEFT._replace(lights=3), None))
    table = CycleTable.from_message(','.join(rows.columns), rows.taken())
    assert table.commands('hv0')[0, 4] == 3.0
    kept = [i for i, name in enumerate(table.columns) if not name.endswith(without)]
    old = CycleTable([table.columns[i] for i in kept], table.rows[:, kept])
    lights = 0.0 if '/lights' in without else 3.0
    assert old.commands('hv0').tolist() == [[*map(float, LEFT[:4]), lights, 0.0]]
    assert np.isnan(old.commands_of(['av0'])).all() and old.commands_of(['av0']).shape == (1, 1, 6)


def test_rows_for_the_metrics() -> None:
    """Ideal and actual start, busy and dropped, in the order that the metrics take."""
    rows = filled()
    table = CycleTable.from_message(','.join(rows.columns), rows.taken())
    assert table.timing_rows().tolist() == [[0.07, 0.0701, 0.002, 0.3], [0.08, 0.0805, 0.003, 0.4]]


def test_taking_empties_the_buffer() -> None:
    """The buffer is used again, and rows that were taken are unchanged."""
    rows = filled()
    assert not rows.full
    rows.add(4, 13, FIRST, 0.0, 0.0, (LEFT, BACK))
    assert rows.full
    taken = rows.taken()
    assert len(taken) == 3 * 34
    assert (rows.count, rows.full, len(rows.taken())) == (0, False, 0)
    rows.add(5, 1, SECOND, 0.0, 0.0, (BACK, LEFT))
    assert (taken[0], taken[1]) == (4.0, 7.0)
    assert rows.taken()[:2].tolist() == [5.0, 8.0]


@pytest.mark.parametrize(('label', 'data'), [
    ('epoch,n', [1.0, 2.0]), ('', []), (','.join(TIMING_COLUMNS), [1.0] * 13)])
def test_other_messages_are_refused(label: str, data: list[float]) -> None:
    """Missing columns or rows that are not whole: another version wrote them."""
    with pytest.raises(InputError, match='/timing/cycle: has other columns'):
        CycleTable.from_message(label, data)


@pytest.mark.parametrize('wrong', [math.inf, -math.inf, math.nan, 1e300])
def test_rows_that_are_no_measurements_are_left_out(wrong: float) -> None:
    """Anyone may publish a row; its numbers must not reach tables or conversions."""
    good = [0.0, 7.0, 1.0, *[0.01] * (len(TIMING_COLUMNS) - 3)]
    for place in range(len(TIMING_COLUMNS)):
        bad = list(good)
        bad[place] = wrong
        table = CycleTable.from_message(','.join(TIMING_COLUMNS), [*good, *bad, *good])
        np.testing.assert_array_equal(table.rows, [good, good])
