# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""An overview figure of a run: frames at some times, with velocities and distances below."""

from collections.abc import Sequence

from crgame_ros.analysis.pictures.figure_style import new_figure, paper_style, WIDTHS
from crgame_ros.analysis.pictures.frame_axes import draw_frame
from crgame_ros.analysis.pictures.profiles_figure import (
    draw_line,
    draw_over_time,
    log_times,
    OVER_TIME,
)
from crgame_ros.analysis.pictures.scene_frame import FrameScene
from crgame_ros.game.objects import Role
from crgame_ros.recording.run_record import RunRecord
from matplotlib.axes import Axes
from matplotlib.figure import Figure
import numpy as np

# Height of the panels below, gap between panels, and margin of the page [inch].
_BELOW, _GAP, _MARGIN = 1.7, 0.04, 0.45
_POINTS = 72.0
# Least length of road in a frame [m].
LEAST = 145.0


def draw_run(record: RunRecord, times_s: Sequence[float]) -> Figure:
    """
    Draw a run over the two columns of a page.

    :param record: record of a recording or an offline run.
    :param times_s: times of the frames, since the start of the run [s]
    """
    scene = FrameScene(record.log)
    ks = [scene.k_at(time_s) for time_s in times_s]
    windows = scene.windows([scene.row(k) for k in ks], standing=False, least=LEAST)
    width = WIDTHS[2]
    metre = width / windows[0].length
    height = windows[0].height * metre
    total = len(ks) * (height + _GAP) + _BELOW
    with paper_style():
        figure = new_figure(2, total)
        figure.set_layout_engine('none')
        for row, (k, window) in enumerate(zip(ks, windows, strict=True)):
            axes = figure.add_axes((0.0, 1.0 - ((row + 1) * height + row * _GAP) / total,
                                    1.0, height / total))
            frame = scene.at(k, window)
            draw_frame(axes, frame, metre * _POINTS, f'{frame.time_s:g} s')
        place = 0.5 * width - _MARGIN - 0.1
        for number, draw in enumerate((_draw_speeds, _draw_distances)):
            axes = figure.add_axes(((_MARGIN + 0.5 * number * width) / width, 0.36 / total,
                                    place / width, (_BELOW - 0.5) / total))
            draw(axes, record, scene)
            axes.set_xlabel('time [s]')
            axes.grid(visible=True)
            if axes.lines:
                axes.legend()
    return figure


def _draw_speeds(axes: Axes, record: RunRecord, scene: FrameScene) -> None:
    draw_over_time(axes, record, scene.styles, *OVER_TIME['velocity'])


def _draw_distances(axes: Axes, record: RunRecord, scene: FrameScene) -> None:
    """Draw the distance between the first human's vehicle and each AV."""
    log = record.log
    roles = [item.role for item in log.vehicles]
    axes.set_ylabel('distance of rear axles [m]')
    if Role.HUMAN not in roles:
        return
    human = roles.index(Role.HUMAN)
    for i, item in enumerate(log.vehicles):
        if item.role is Role.AUTONOMOUS:
            away = log.vehicle_states[:, i, :2] - log.vehicle_states[:, human, :2]
            draw_line(axes, log_times(record), np.hypot(*away.T), item.id, scene.styles, i)
    axes.set_xlim(*log_times(record)[[0, -1]])
