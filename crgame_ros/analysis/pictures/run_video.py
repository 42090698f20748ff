# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A run as a video from above, in real time: MP4 by ffmpeg, or GIF by Pillow."""

from collections.abc import Callable, Sequence
from dataclasses import replace
import math
from pathlib import Path
from subprocess import CalledProcessError
from typing import Any

from crgame_ros.analysis.pictures.figure_style import new_figure, paper_style, POINTS
from crgame_ros.analysis.pictures.frame_axes import draw_frame
from crgame_ros.analysis.pictures.frame_window import FrameWindow
from crgame_ros.analysis.pictures.scene_frame import FrameScene
from crgame_ros.errors import InputError
from crgame_ros.whole_file import whole_file
from matplotlib.animation import AbstractMovieWriter, FFMpegWriter, PillowWriter
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
import numpy as np
from PIL import Image

# Width of the picture [px], and limits of its height in widths.
WIDTHS_PX = {'.mp4': 1280, '.gif': 720}
_FLATTEST, _HIGHEST = 0.3, 0.6
# Greatest frame rate; a higher one is not visible [1/s].
MOST_RATE = 30.0
# Distance shown around the vehicle in focus [m].
VIDEO_REACH = 60.0
_INCH_PX = 160


def write_video(scene: FrameScene, path: Path,
                progress: Callable[[float], object] = lambda _: None) -> Path:
    """
    Write a video with the run's duration; the file is written completely or not at all.

    :param path: path of the file, *.mp4 or *.gif.
    :param progress: called with the share drawn so far, 0 to 1.
    :return: the file, a GIF where there is no ffmpeg for MP4.
    :raises InputError: if the name has another suffix, or the file cannot be written.
    """
    if path.suffix not in WIDTHS_PX:
        raise InputError('is no *.mp4 or *.gif', str(path), 'name the video so')
    path = video_path(path)
    step_s = scene.log.game.scheduler.time_step_s
    stride = max(1, math.ceil(1.0 / (MOST_RATE * step_s) - 1e-9))
    rows = range(0, len(scene.log.ks), stride)
    figure, windows = _prepared(path.suffix, scene.windows(
        rows, follows=True, reach=VIDEO_REACH))
    writer = _writer(path.suffix, 1.0 / (stride * step_s))
    try:
        with paper_style(), whole_file(path, f'.part{path.suffix}') as part, \
                writer.saving(figure, str(part), _INCH_PX):
            axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
            for number, (row, window) in enumerate(zip(rows, windows, strict=True)):
                # Creating axes is slow, so they are reused.
                for artist in (*axes.patches, *axes.lines, *axes.collections, *axes.texts):
                    artist.remove()
                frame = scene.at(int(scene.log.ks[row]), window)
                draw_frame(axes, frame, figure.get_figwidth() * POINTS / window.length,
                           f'{frame.time_s:.1f} s')
                writer.grab_frame()
                progress((number + 1) / len(rows))
    except CalledProcessError as error:
        raise InputError('ffmpeg could not write it', str(path),
                         'see that it has libx264, or name a *.gif') from error
    except OSError as error:
        raise InputError(f'cannot be written ({error.strerror or error})', str(path),
                         'choose a folder that can be written') from error
    return path


def video_path(path: Path) -> Path:
    """Return the path of a file that can be written here: a GIF without ffmpeg."""
    lacks = path.suffix == '.mp4' and not FFMpegWriter.isAvailable()
    return path.with_suffix('.gif') if lacks else path


def _prepared(suffix: str, windows: Sequence[FrameWindow]
              ) -> tuple[Figure, list[FrameWindow]]:
    """Return an empty picture, and the windows extended to fill it."""
    length, height = windows[0].length, windows[0].height
    width = WIDTHS_PX[suffix]
    # Video codecs require even numbers of pixels.
    lines = 2 * round(0.5 * width * min(max(height / length, _FLATTEST), _HIGHEST))
    length = max(length, height * width / lines)
    figure = new_figure(1, 1.0)
    figure.set_layout_engine('none')
    figure.set_dpi(_INCH_PX)
    figure.set_size_inches(width / _INCH_PX, lines / _INCH_PX)
    return figure, [replace(window, length=length, height=length * lines / width)
                    for window in windows]


def _writer(suffix: str, rate: Any) -> AbstractMovieWriter:
    """Return the writer for a kind of file, at a frame rate that may be fractional."""
    if suffix == '.mp4':
        return FFMpegWriter(fps=rate, codec='libx264', metadata={'encoder': 'crgame_ros'},
                            extra_args=['-pix_fmt', 'yuv420p', '-crf', '23'])
    return _GifWriter(fps=rate)


class _GifWriter(PillowWriter):
    """
    A writer of GIF that stores one byte per pixel, a quarter of the usual memory.

    Durations in a GIF are hundredths of a second. Rounding alternates between longer and shorter
    durations, so that the video as a whole keeps the time.
    """

    def __init__(self, fps: Any) -> None:
        super().__init__(fps=fps)
        self._taken: list[Image.Image] = []

    def grab_frame(self, **savefig_kwargs: object) -> None:
        """Add the current picture."""
        canvas = self.fig.canvas
        assert isinstance(canvas, FigureCanvasAgg)
        canvas.draw()
        picture = Image.fromarray(np.asarray(canvas.buffer_rgba())).convert('RGB')
        self._taken.append(picture.quantize(128))

    def finish(self) -> None:
        """Write the file."""
        ends = np.round(100.0 / self.fps * np.arange(len(self._taken) + 1)).astype(int)
        self._taken[0].save(self.outfile, save_all=True, append_images=self._taken[1:], loop=0,
                            duration=(10 * np.diff(ends)).tolist())
