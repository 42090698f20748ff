# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What a report consists of: sections of HTML, and the plots in them."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

Dash = Literal['solid', 'dash', 'dot']


@dataclass(frozen=True)
class PlotLine:
    """
    A line of a plot.

    :param name: as the legend has it: of our own making, for Plotly reads markup in it.
    :param xs: (N) times [s], or positions [m]; rising in plots over time.
    :param ys: (N) values; NaN where there is nothing.
    :param colour: name of the colour, as the page's style declares it.
    :param dash: solid, dash or dot.
    """

    name: str
    xs: NDArray[np.float64]
    ys: NDArray[np.float64]
    colour: str
    dash: Dash = 'solid'


@dataclass(frozen=True)
class PlotLimit:
    """A threshold: a horizontal line, beyond which values are critical."""

    value: float
    label: str


@dataclass(frozen=True)
class PlotSpan:
    """A time that stands out, from one end to the other [s]."""

    start_s: float
    end_s: float
    label: str
    colour: str


@dataclass(frozen=True)
class Plot:
    """
    A plot over time, or of the plane.

    :param key: tells it from others of its section.
    :param title: in words, HTML.
    :param unit: as axes have it.
    :param limits: thresholds.
    :param spans: times that stand out.
    :param bounds: of the values that are shown at first; None for all.
    :param plane: whether x and y are positions in one scale, not values over time.
    """

    key: str
    title: str
    unit: str
    lines: tuple[PlotLine, ...]
    limits: tuple[PlotLimit, ...] = ()
    spans: tuple[PlotSpan, ...] = ()
    bounds: tuple[float, float] | None = None
    plane: bool = False

    @property
    def points(self) -> int:
        """Count the points of its lines."""
        return sum(len(line.xs) for line in self.lines)


@dataclass(frozen=True)
class Section:
    """
    A part of a report.

    :param key: tells it from others of its run, as part of an address in the page.
    :param title: of its heading, HTML.
    :param html: what it says; all that comes from a recording is escaped.
    :param plots: shown below it.
    """

    key: str
    title: str
    html: str
    plots: tuple[Plot, ...] = ()
