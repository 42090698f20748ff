# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The style and the files of figures for papers; the same run gives the same bytes."""

from collections.abc import Iterator
from contextlib import contextmanager
from io import BytesIO
from string import ascii_lowercase
from typing import Any

import matplotlib
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

# Widths on IEEE's two-column pages, by number of columns [inch].
WIDTHS = {1: 3.5, 2: 7.16}
POINTS = 72.0  # per inch
FORMATS = ('svg', 'pdf', 'png')
# Resolution of PNG, as journals require for line art with photographs [dots per inch].
RESOLUTION = 300
_SETTINGS: dict[Any, object] = {
    'font.family': 'STIXGeneral', 'mathtext.fontset': 'stix', 'font.size': 8.0,
    'axes.titlesize': 8.0, 'axes.labelsize': 8.0, 'xtick.labelsize': 7.0, 'ytick.labelsize': 7.0,
    'legend.fontsize': 7.0, 'axes.linewidth': 0.6, 'axes.labelpad': 1.5,
    'grid.linewidth': 0.4, 'grid.color': '#d0d0d0',
    'xtick.major.width': 0.5, 'ytick.major.width': 0.5, 'xtick.direction': 'in',
    'ytick.direction': 'in', 'lines.linewidth': 1.1, 'lines.markersize': 3.5,
    'legend.frameon': False, 'legend.handlelength': 2.6, 'axes.axisbelow': True,
    # Text as paths in SVG needs no fonts for display; PDF embeds TrueType, as IEEE requires.
    'svg.fonttype': 'path', 'svg.hashsalt': 'crgame_ros', 'pdf.fonttype': 42}
# Files contain no date.
_METADATA = {'svg': {'Date': None, 'Creator': 'crgame_ros'},
             'pdf': {'CreationDate': None, 'Creator': 'crgame_ros'},
             'png': {'Software': 'crgame_ros'}}


@contextmanager
def paper_style() -> Iterator[None]:
    """Apply the papers' style within a context, and restore the user's settings afterwards."""
    with matplotlib.rc_context():
        matplotlib.rcdefaults()
        matplotlib.rcParams.update(_SETTINGS)
        yield


def new_figure(columns: int, height: float) -> Figure:
    """
    Build an empty figure that is independent of displays and of other figures.

    :param columns: number of page columns for the figure, 1 or 2.
    :param height: [inch]
    """
    figure = Figure(figsize=(WIDTHS[columns], height), layout='constrained')
    FigureCanvasAgg(figure)
    return figure


def panel_letter(number: int) -> str:
    """Return what distinguishes a panel of a figure: (a), (b), … (z), (27), …."""
    return f'({ascii_lowercase[number]})' if number < len(ascii_lowercase) else f'({number + 1})'


def figure_bytes(figure: Figure, file_format: str, resolution: int = RESOLUTION) -> bytes:
    """
    Return the bytes of a figure's file, without a date: equal figures give equal bytes.

    :param file_format: one of `FORMATS`.
    :param resolution: resolution of PNG [dots per inch].
    """
    buffer = BytesIO()
    with paper_style():
        figure.savefig(buffer, format=file_format, dpi=resolution,
                       metadata=_METADATA[file_format])
    return buffer.getvalue()
