# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Lines of profiles are the log's, lines of timing figures and tables the cycles'."""

import csv
from io import StringIO

from crgame_ros.analysis.pictures.critical_moments import Moment
from crgame_ros.analysis.pictures.figure_style import figure_bytes, FORMATS
from crgame_ros.analysis.pictures.frames_figure import frames_figure
from crgame_ros.analysis.pictures.palette import AV_COLOURS, HUMAN_COLOURS
from crgame_ros.analysis.pictures.profiles_figure import ALL_PROFILES, profiles_figure
from crgame_ros.analysis.pictures.scene_frame import FrameScene
from crgame_ros.analysis.pictures.timing_figure import thinned, TimedRun, timing_figure
from crgame_ros.analysis.pictures.timing_table import TimingTable
from crgame_ros.game.events import FiredEvent
from crgame_ros.recording.run_record import RunRecord
from crgame_ros.timing.cycle_rows import CycleTable, TIMING_COLUMNS
import matplotlib
from matplotlib.axes import Axes
import numpy as np
from numpy.typing import NDArray
import pytest

FloatArray = NDArray[np.float64]


def _line(axes: Axes, name: str) -> tuple[FloatArray, FloatArray]:
    """Return a line's data by its label or name."""
    (line,) = [each for each in axes.lines if name in (each.get_label(), each.get_gid())]
    return np.asarray(line.get_xdata()), np.asarray(line.get_ydata())


def _timed(label: str, cycles: int, stall_s: float = 0.0) -> TimedRun:
    """Make a run 1 ms late at each cycle, with a stall in the middle that a reset forgives."""
    rows = np.zeros((cycles, len(TIMING_COLUMNS)))
    n = np.arange(1, cycles + 1)
    dropped = np.where(n > cycles // 2, stall_s, 0.0)
    column = {name: i for i, name in enumerate(TIMING_COLUMNS)}
    rows[:, column['n']] = n
    rows[:, column['ideal_s']] = 0.01 * n + dropped
    rows[:, column['actual_s']] = 0.01 * n + dropped + 0.001
    rows[:, column['dropped_s']] = dropped
    rows[:, column['busy_s']] = 0.002
    return TimedRun(label, CycleTable(TIMING_COLUMNS, rows), 0.01)


def test_profiles_are_the_logs(two_avs: RunRecord) -> None:
    """Heading, way, velocity, acceleration and steering of every driven vehicle."""
    log = two_avs.log
    figure = profiles_figure(two_avs, profiles=ALL_PROFILES)
    times_s = 0.1 * np.arange(51)
    for i, item in enumerate(log.vehicles):
        states = log.vehicle_states[:, i]
        for axes, column in zip(figure.axes, (2, None, 3, 5, 4), strict=True):
            x, y = _line(axes, item.id)
            assert x == pytest.approx(times_s if column is not None else states[:, 0])
            assert y == pytest.approx(states[:, 1 if column is None else column])
    labels = [axes.get_ylabel() for axes in figure.axes]
    assert labels == ['heading angle [rad]', 'y [m]', 'velocity [m/s]', 'acceleration [m/s$^2$]',
                      'steering angle [rad]']
    # They can be distinguished without colours, too.
    lines = [line for line in figure.axes[0].lines if line.get_label() in ('hv0', 'av0', 'av1')]
    assert len({str(line.get_marker()) for line in lines}) == 3
    colours = [line.get_color() for line in lines]
    assert colours == [HUMAN_COLOURS[0], *AV_COLOURS[:2]]


def test_events_and_moments_are_marked(cut_in: RunRecord) -> None:
    """Each at its time in every profile over time, events with their names."""
    record = RunRecord(cut_in.log, cut_in.ns, cut_in.commands,
                       (FiredEvent('brake', 250, 25, 'trigger'),))
    figure = profiles_figure(record, [Moment(4.0, 'near', ())])
    for axes in (figure.axes[0], figure.axes[2]):
        assert _line(axes, 'event')[0] == pytest.approx([2.5, 2.5])
        assert _line(axes, 'moment')[0] == pytest.approx([4.0, 4.0])
        assert [text.get_text() for text in axes.texts] == ['brake']
    assert not [each for each in figure.axes[1].lines if each.get_gid() in ('event', 'moment')]


def test_timing_lines_are_the_cycles() -> None:
    """A stall of 50 ms that a reset forgave shows as lag all the same: ideal is t_0 + n dt."""
    ours, naive = _timed('ours', 100), _timed('naive', 200, 0.05)
    figure = timing_figure([ours, naive])
    for column, (run, cycles, stall_s) in enumerate(((ours, 100, 0.0), (naive, 200, 0.05))):
        above, below = figure.axes[column], figure.axes[2 + column]
        n = np.arange(1.0, cycles + 1.0)
        late = 0.001 + stall_s * (n > cycles // 2)
        steps = np.zeros(cycles - 1)
        steps[cycles // 2 - 1] = 1e3 * stall_s
        for axes, name, x, y in (
                (above, 'ideal', n, 0.01 * n), (above, 'actual', n, 0.01 * n + late),
                (below, 'cumulative error', n, 1e3 * late), (below, 'step error', n[1:], steps)):
            np.testing.assert_allclose(_line(axes, name), (x, y), atol=1e-9)
        assert run.label in above.get_xlabel() and run.label in below.get_xlabel()


@pytest.mark.matrix('2-1-4')
@pytest.mark.parametrize(('runs', 'columns', 'panels'),
                         [(1, 1, 2), (1, 2, 2), (2, 1, 4), (3, 2, 6)])
def test_every_run_has_its_two_panels(runs: int, columns: int, panels: int) -> None:
    """This holds for any number of runs; all panels are as wide as the page allows."""
    figure = timing_figure([_timed(f'run{i}', 20) for i in range(runs)], columns)
    assert len(figure.axes) == panels
    figure_bytes(figure, 'png')
    least = 0.75 if columns == 1 else 0.35
    assert all(axes.get_position().width > least for axes in figure.axes)


def test_long_lines_keep_their_extremes() -> None:
    """100,000 cycles become 4,000 points; the one stall among them stays."""
    y = np.random.default_rng(1).normal(size=100_000)
    y[54_321] = 99.0
    x, thin = thinned(np.arange(100_000.0), y)
    assert len(thin) <= 4002 and (np.diff(x) > 0.0).all()
    assert thin.max() == 99.0 and thin.min() == y.min() and x[np.argmax(thin)] == 54_321
    assert thinned(x, thin, 5000)[1] is thin


def test_the_table_is_table_one() -> None:
    """By hand: 200 cycles 1 ms late, 51 ms from the middle on; 1 step of 199 errs by 50 ms."""
    table = TimingTable([_timed('A_1', 100), _timed('B|&', 200, 0.05)])
    rows = {row[0]: row[1:] for row in csv.reader(StringIO(table.csv()))}
    assert rows['metric'] == ['unit', 'A_1', 'B|&']
    duration_s = 1.99 + 0.05
    for name, value in (('Final Error', 51.0), ('Average Step Error', 50.0 / 199),
                        ('Maximum Cumulative Error', 51.0), ('Timeout Ratio', 0.0),
                        ('Final Real-Time Ratio', 1.99 / duration_s),
                        ('Minimum Real-Time Ratio', 0.01 / 0.06),
                        ('Time Efficiency', 199.0 / duration_s),
                        ('Precision Ratio', 0.051 / duration_s)):
        assert float(rows[name][2]) == pytest.approx(value, rel=1e-6), name
    assert '| Final Error | 1.00 ms | 51.00 ms |' in table.markdown()
    assert r'B\|&' in table.markdown().splitlines()[0]
    latex = table.latex()
    assert r'\textbf{A\_1} & \textbf{B|\&} \\' in latex
    assert r'Final Error ($E_f$) & 1.00\,ms & 51.00\,ms \\' in latex
    assert r'$2.50 \times 10^{-2}$' in latex
    assert latex.count('{') == latex.count('}')
    assert table.text().splitlines()[1].split() == ['Final', 'Error', '1.00', 'ms', '51.00', 'ms']


@pytest.mark.matrix('pdf')
@pytest.mark.slow
@pytest.mark.parametrize('file_format', FORMATS)
def test_the_same_run_gives_the_same_bytes(file_format: str, cut_in: RunRecord) -> None:
    """They depend on no user settings and have no date; PDF embeds TrueType fonts."""
    def make() -> list[bytes]:
        ks = cut_in.log.ks[[10, 20]].tolist()
        return [figure_bytes(figure, file_format) for figure in (
            frames_figure(FrameScene(cut_in.log), ks), profiles_figure(cut_in),
            timing_figure([_timed('run', 50)]))]
    first = make()
    with matplotlib.rc_context({'font.size': 20.0, 'svg.fonttype': 'none', 'lines.linewidth': 5}):
        assert make() == first
        assert matplotlib.rcParams['font.size'] == 20.0
    for content in first:
        assert b'CreationDate' not in content and b'dc:date' not in content
        if file_format == 'pdf':
            assert b'/FontFile2' in content and b'/Type3' not in content
        if file_format == 'svg':
            assert b'<text' not in content
