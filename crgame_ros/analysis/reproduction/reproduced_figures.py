# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The paper's figures 8 to 14, drawn from our runs."""

from collections.abc import Sequence
from pathlib import Path

from crgame_ros.analysis.counterfactual import Alternative
from crgame_ros.analysis.pictures.critical_moments import critical_moments, Touch
from crgame_ros.analysis.pictures.figure_style import figure_bytes
from crgame_ros.analysis.pictures.frames_figure import frames_figure, panel_steps
from crgame_ros.analysis.pictures.profiles_figure import profiles_figure
from crgame_ros.analysis.pictures.scene_frame import FrameScene
from crgame_ros.analysis.pictures.timing_figure import timing_figure
from crgame_ros.analysis.reproduction.synchronization import Synchronization
from crgame_ros.recording.export import write_bytes, write_text
from crgame_ros.recording.run_record import RunRecord
from crgame_ros.timing.cycle_rows import COMMAND_COLUMNS
from matplotlib.figure import Figure
import numpy as np

# Between the panels of the close view, as in the paper; the other view shows the whole run [s].
PANELS, SPACING_S = 12, 0.2


def write_run_figures(run: Alternative, numbers: tuple[int, int], name: str, folder: Path,
                      formats: Sequence[str]) -> tuple[Path, ...]:
    """
    Draw frames and profiles of a run.

    :param numbers: of the paper's figures of frames and of profiles.
    :param name: of the run, for the files' names.
    :return: the files.
    :raises InputError: if a file cannot be written.
    """
    log = run.log
    record = RunRecord(log, np.empty(0, dtype=np.int64),
                       np.empty((0, len(log.vehicles), len(COMMAND_COLUMNS))), ())
    moments = critical_moments(record, run.criticality, tuple(map(Touch.of, run.contacts or ())))
    scene = FrameScene(log)
    frames, profiles = numbers
    written: list[Path] = []
    if moments:
        ks = panel_steps(scene, moments[0].time_s, PANELS, SPACING_S)
        written += _write(frames_figure(scene, ks, moments[0].vehicles),
                          folder / f'figure_{frames:02}_{name}_frames', formats)
    written += _write(frames_figure(scene, _whole(scene)),
                      folder / f'figure_{frames:02}_{name}_whole', formats)
    written += _write(profiles_figure(record, moments[:1]),
                      folder / f'figure_{profiles:02}_{name}_profiles', formats)
    return tuple(written)


def write_timing_figure(found: Synchronization, folder: Path,
                        formats: Sequence[str]) -> tuple[Path, ...]:
    """Draw figure 14 and write table I; give the files."""
    written = list(_write(timing_figure((found.proposed, found.naive)),
                          folder / 'figure_14_timing', formats))
    table = found.table
    for suffix, text in (('txt', table.text()), ('csv', table.csv()), ('md', table.markdown())):
        path = folder / f'table_1.{suffix}'
        write_text(text, path)
        written.append(path)
    return tuple(written)


def _whole(scene: FrameScene) -> tuple[int, ...]:
    """Choose scenario steps over the whole run, equally far apart."""
    first, last = int(scene.log.ks[0]), int(scene.log.ks[-1])
    stride = max(1, (last - first) // (PANELS - 1))
    return tuple(range(first, last + 1, stride))[:PANELS]


def _write(figure: Figure, place: Path, formats: Sequence[str]) -> tuple[Path, ...]:
    paths = []
    for file_format in formats:
        path = place.with_name(f'{place.name}.{file_format}')
        write_bytes(figure_bytes(figure, file_format), path)
        paths.append(path)
    return tuple(paths)
