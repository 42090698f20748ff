# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Table I of CRG for recorded runs, as text, CSV, Markdown or LaTeX."""

from collections.abc import Callable, Sequence
import csv
from io import StringIO
from typing import NamedTuple

from crgame_ros.analysis.pictures.timing_figure import TimedRun
from crgame_ros.timing.metrics import TimingMetrics, TimingSummary


class TimingRow(NamedTuple):
    """
    A row of the table.

    :param group: heading under which it stands.
    :param name: name of the metric.
    :param symbol: symbol of the metric, in LaTeX.
    :param unit: unit of the value; empty without one.
    :param value: returns the value.
    :param form: format of the value for people.
    """

    group: str
    name: str
    symbol: str
    unit: str
    value: Callable[[TimingSummary], float]
    form: str


_TIME, _REAL, _EFFICIENCY = 'Time Performance', 'Real-time Performance', 'Efficiency'
# In the order of the paper.
TIMING_ROWS = (
    TimingRow(_TIME, 'Final Error', r'E_f', 'ms', lambda found: found.final_error_ms, '.2f'),
    TimingRow(_TIME, 'Average Step Error', r'\bar{e}_{\mathrm{step}}', 'ms',
              lambda found: found.mean_step_error_ms, '.2f'),
    TimingRow(_TIME, 'Maximum Cumulative Error', r'E_{\max}', 'ms',
              lambda found: found.max_cumulative_error_ms, '.2f'),
    TimingRow(_TIME, 'Timeout Ratio', r'R_{\mathrm{timeout}}', '%',
              lambda found: 100.0 * found.timeout_ratio, '.1f'),
    TimingRow(_REAL, 'Final Real-Time Ratio', r'R_{\mathrm{RT}}', '',
              lambda found: found.real_time_ratio.final, '.4f'),
    TimingRow(_REAL, 'Average Real-Time Ratio', r'\bar{R}_{\mathrm{RT}}', '',
              lambda found: found.real_time_ratio.mean, '.4f'),
    TimingRow(_REAL, 'Minimum Real-Time Ratio', r'R_{\mathrm{RT,min}}', '',
              lambda found: found.real_time_ratio.min, '.2f'),
    TimingRow(_EFFICIENCY, 'Time Efficiency', r'\eta_t', '%',
              lambda found: 100.0 * found.time_efficiency, '.2f'),
    TimingRow(_EFFICIENCY, 'Precision Ratio', r'P_r', '',
              lambda found: found.precision_ratio, '.2e'))
# Escapes for LaTeX and for Markdown: names of runs come from folders.
_LATEX = {'\\': r'\textbackslash{}', '~': r'\textasciitilde{}', '^': r'\textasciicircum{}',
          **{each: f'\\{each}' for each in '&%$#_{}'}}


class TimingTable:
    """
    The metrics of runs side by side; `docs/timing.md` defines them.

    :param runs: in the order of the columns.
    :raises CrgameError: if one has too few cycles.
    """

    def __init__(self, runs: Sequence[TimedRun]) -> None:
        self.labels = tuple(run.label for run in runs)
        self.summaries = tuple(_summary(run) for run in runs)

    def text(self) -> str:
        """Return the table as text for a terminal."""
        rows = [('', *self.labels), *(
            (row.name, *(_format_value(row, found) for found in self.summaries))
            for row in TIMING_ROWS)]
        widths = [max(len(row[column]) for row in rows) for column in range(len(rows[0]))]
        return ''.join(
            '  '.join((f'{row[0]:<{widths[0]}}', *(
                f'{cell:>{width}}' for cell, width in zip(row[1:], widths[1:], strict=True)))
            ).rstrip() + '\n' for row in rows)

    def csv(self) -> str:
        """Return the table as CSV with all digits, a row for each metric."""
        stream = StringIO()
        writer = csv.writer(stream, lineterminator='\n')
        writer.writerow(('metric', 'unit', *self.labels))
        for row in TIMING_ROWS:
            writer.writerow((row.name, row.unit, *(repr(row.value(found))
                                                   for found in self.summaries)))
        return stream.getvalue()

    def markdown(self) -> str:
        """Return the table as Markdown."""
        labels = [label.replace('\\', '\\\\').replace('|', '\\|') for label in self.labels]
        lines = ['| metric | ' + ' | '.join(labels) + ' |', '|---|' + '---:|' * len(labels)]
        lines += [f'| {row.name} | ' + ' | '.join(
            _format_value(row, found) for found in self.summaries) + ' |' for row in TIMING_ROWS]
        return '\n'.join(lines) + '\n'

    def latex(self) -> str:
        """Return the table as a LaTeX `tabular` that needs no package."""
        lines = [rf'\begin{{tabular}}{{l{"r" * len(self.labels)}}}', r'\hline',
                 ' & '.join((r'\textbf{Metric}', *(
                     rf'\textbf{{{"".join(_LATEX.get(each, each) for each in label)}}}'
                     for label in self.labels))) + r' \\']
        group = ''
        for row in TIMING_ROWS:
            if row.group != group:
                group = row.group
                lines += [r'\hline', rf'\multicolumn{{{len(self.labels) + 1}}}{{l}}'
                          rf'{{\textit{{{group}}}}} \\']
            cells = ' & '.join(_latex(_format_value(row, found)) for found in self.summaries)
            lines.append(rf'{row.name} (${row.symbol}$) & {cells} \\')
        return '\n'.join([*lines, r'\hline', r'\end{tabular}', ''])


def _summary(run: TimedRun) -> TimingSummary:
    metrics = TimingMetrics(run.dt_s)
    metrics.add_rows(run.cycles.timing_rows())
    return metrics.summary()


def _format_value(row: TimingRow, found: TimingSummary) -> str:
    value = f'{row.value(found):{row.form}}'
    return f'{value}{"" if row.unit == "%" else " "}{row.unit}' if row.unit else value


def _latex(value: str) -> str:
    if 'e' in value:
        mantissa, exponent = value.split('e')
        return rf'${mantissa} \times 10^{{{int(exponent)}}}$'
    return value.replace('%', r'\%').replace(' ms', r'\,ms')
