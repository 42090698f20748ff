# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The style and the files of figures for papers; the same run gives the same bytes."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from io import BytesIO
from string import ascii_lowercase
from typing import Any

from crgame_ros.game.objects import ObjectDescription, Role
import matplotlib
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

# Widths on IEEE's two-column pages, by number of columns [inch].
WIDTHS = {1: 3.5, 2: 7.16}
POINTS = 72.0  # per inch
FORMATS = ('svg', 'pdf', 'png')
# Resolution of PNG, as journals require for line art with photographs [dots per inch].
RESOLUTION = 300
# Okabe and Ito's palette, suitable for colour-blind readers: warm for humans, cold for AVs.
HUMAN_COLOURS = ('#d55e00', '#e69f00', '#cc79a7')
AV_COLOURS = ('#0072b2', '#56b4e9', '#009e73')
OBJECT_COLOUR = '#8c8c8c'
PERSON_COLOUR = '#4d4d4d'
PERSONS = ('pedestrian', 'bicycle', 'motorcycle')
ROAD_COLOUR, LANE_COLOUR = '#ebebeb', '#ffffff'
EDGE_COLOUR, DIVIDER_COLOUR = '#7f7f7f', '#9a9a9a'
INK = '#222222'
# Dashes distinguish lines without colours; with more vehicles than dashes, they repeat.
HUMAN_DASHES = ('-', (0, (6, 1, 1, 1)), (0, (6, 1, 1, 1, 1, 1)))
AV_DASHES = ((0, (4, 1.2)), (0, (1.2, 1.2)), (0, (4, 1.2, 1.2, 1.2)))
HUMAN_MARKERS, AV_MARKERS = ('o', 'v', 'P'), ('s', '^', 'D')

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


@dataclass(frozen=True)
class VehicleStyle:
    """
    The style of one driven vehicle in all figures.

    :param colour: as #rrggbb.
    :param dashes: line style of matplotlib.
    :param marker: marker of matplotlib.
    """

    colour: str
    dashes: str | tuple[float, tuple[float, ...]]
    marker: str


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


def vehicle_styles(descriptions: tuple[ObjectDescription, ...]) -> dict[str, VehicleStyle]:
    """Return the style of each driven vehicle, by id."""
    styles = {}
    for role, colours, dashes, markers in (
            (Role.HUMAN, HUMAN_COLOURS, HUMAN_DASHES, HUMAN_MARKERS),
            (Role.AUTONOMOUS, AV_COLOURS, AV_DASHES, AV_MARKERS)):
        for number, item in enumerate(each for each in descriptions if each.role is role):
            place = number % len(colours)
            styles[item.id] = VehicleStyle(colours[place], dashes[place], markers[place])
    return styles


def object_colour(description: ObjectDescription) -> str:
    """Return the colour of an object that is not driven: people on foot or bicycle are darker."""
    return PERSON_COLOUR if description.type in PERSONS else OBJECT_COLOUR


def shade(colour: str) -> str:
    """Return a darker shade of a colour, for text on the road."""
    return '#' + ''.join(f'{round(0.7 * level):02x}' for level in _levels(colour))


def tint(colour: str) -> str:
    """Return a lighter tint of a colour, as on white with 60 % of it."""
    return '#' + ''.join(f'{round(255 - 0.6 * (255 - level)):02x}' for level in _levels(colour))


def _levels(colour: str) -> tuple[int, ...]:
    return tuple(int(colour[i:i + 2], 16) for i in (1, 3, 5))
