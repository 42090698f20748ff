# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Make the pictures of the documentation from offline runs of the project's own games."""

from collections.abc import Sequence
from pathlib import Path

from crgame_ros.analysis.criticality.recorded import measure_log
from crgame_ros.analysis.pictures.critical_moments import critical_moments
from crgame_ros.analysis.pictures.figure_style import (
    figure_bytes,
    new_figure,
    paper_style,
    POINTS,
    WIDTHS,
)
from crgame_ros.analysis.pictures.frame_axes import draw_frame
from crgame_ros.analysis.pictures.frames_figure import frames_figure, panel_steps
from crgame_ros.analysis.pictures.profiles_figure import (
    draw_line,
    draw_over_time,
    OVER_TIME,
    profiles_figure,
)
from crgame_ros.analysis.pictures.scene_frame import FrameScene
from crgame_ros.game.objects import Role
from crgame_ros.launcher.arguments import RunRequest
from crgame_ros.launcher.run_plan import effective_game
from crgame_ros.paths import scenarios_directory, share_directory
from crgame_ros.recording.run_record import run_record_of, RunRecord
from crgame_ros.simulation.offline import run_offline
from crgame_ros.simulation.setup import build_setup
from crgame_ros.whole_file import write_bytes
from matplotlib.axes import Axes
from matplotlib.figure import Figure
import numpy as np

# Of PNG on a page that is read on a screen [dots per inch].
RESOLUTION = 150
# Games at a glance: times of the frames [s].
GLANCES = {'cut_in': (2.0, 5.0, 8.0, 11.0, 16.0), 'two_avs': (2.0, 5.0, 8.0, 12.0)}
# Height of the panels below, gap between panels, and margin of the page [inch].
_BELOW, _GAP, _MARGIN = 1.7, 0.04, 0.45
# Least length of road in a frame [m].
LEAST_ROAD = 145.0


def main() -> None:
    """Draw each game."""
    folder = share_directory() / 'docs' / 'images'
    folder.mkdir(parents=True, exist_ok=True)
    records = {name: _record(name) for name in (*GLANCES, 'occluded_pedestrian')}
    for name, times_s in GLANCES.items():
        _write(_overview(records[name], times_s), folder / f'{name}.png')
    walker = records['occluded_pedestrian']
    scene = FrameScene(walker.log)
    (moment, *_) = critical_moments(walker, measure_log(walker.log))
    ks = panel_steps(scene, moment.time_s, 6, 0.4)
    _write(frames_figure(scene, ks, moment.vehicles), folder / 'figure_frames.png')
    _write(profiles_figure(records['two_avs']), folder / 'figure_profiles.png')


def _record(game: str) -> RunRecord:
    request = RunRequest(game=Path(scenarios_directory() / f'{game}.yaml'))
    return run_record_of(run_offline(build_setup(effective_game(request))))


def _write(figure: Figure, path: Path) -> None:
    write_bytes(figure_bytes(figure, 'png', RESOLUTION), path)
    print(path)


def _overview(record: RunRecord, times_s: Sequence[float]) -> Figure:
    """
    Draw a run over the two columns of a page.

    :param record: record of a recording or an offline run.
    :param times_s: times of the frames, since the start of the run [s]
    """
    scene = FrameScene(record.log)
    ks = [scene.k_at(time_s) for time_s in times_s]
    windows = scene.windows([scene.row(k) for k in ks], follows=True, least=LEAST_ROAD)
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
            draw_frame(axes, frame, metre * POINTS, f'{frame.time_s:g} s')
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
            draw_line(axes, log.times_s, np.hypot(*away.T), item.id, scene.styles, i)
    axes.set_xlim(*log.times_s[[0, -1]])


if __name__ == '__main__':
    main()
