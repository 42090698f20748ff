# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Make the pictures of the documentation from offline runs of the project's own games."""

from pathlib import Path

from crgame_ros.analysis.criticality.recorded import measure_log
from crgame_ros.analysis.pictures.critical_moments import critical_moments
from crgame_ros.analysis.pictures.figure_style import figure_bytes
from crgame_ros.analysis.pictures.frames_figure import draw_run, frames_figure, panel_steps
from crgame_ros.analysis.pictures.profiles_figure import profiles_figure
from crgame_ros.analysis.pictures.scene_frame import FrameScene
from crgame_ros.launcher.arguments import RunRequest
from crgame_ros.launcher.run_plan import effective_game
from crgame_ros.paths import scenarios_directory, share_directory
from crgame_ros.recording.run_record import run_record_of, RunRecord
from crgame_ros.simulation.offline import run_offline
from crgame_ros.simulation.setup import build_setup
from crgame_ros.whole_file import write_bytes
from matplotlib.figure import Figure

# Of PNG on a page that is read on a screen [dots per inch].
RESOLUTION = 150
# Games at a glance: times of the frames [s].
GLANCES = {'cut_in': (2.0, 5.0, 8.0, 11.0, 16.0), 'two_avs': (2.0, 5.0, 8.0, 12.0)}


def main() -> None:
    """Draw each game."""
    folder = share_directory() / 'docs' / 'images'
    folder.mkdir(parents=True, exist_ok=True)
    records = {name: _record(name) for name in (*GLANCES, 'occluded_pedestrian')}
    for name, times_s in GLANCES.items():
        _write(draw_run(records[name], times_s), folder / f'{name}.png')
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


if __name__ == '__main__':
    main()
