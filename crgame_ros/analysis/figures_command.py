# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""`crgame figures`: draw the figures of a paper from recorded runs."""

import argparse
from collections.abc import Iterator, Sequence
import math
from pathlib import Path
import re
import sys
from typing import TYPE_CHECKING

from crgame_ros.errors import InputError

if TYPE_CHECKING:  # A command that draws nothing starts without matplotlib.
    from crgame_ros.analysis.runs.run import Run
    from matplotlib.figure import Figure

DESCRIPTION = """\
Draw the figures and the table of the CommonRoad-Game paper from recorded runs.

  frames    the scene around the most critical moments, or at given times (figures 8, 10, 12)
  profiles  heading, position and velocity of each driven vehicle (figures 9, 11, 13)
  timing    ideal and realized time line, errors (figure 14)
  table     the timing metrics as text, CSV, Markdown and LaTeX (table I)

  crgame figures runs/NAME
  crgame figures runs/NAME --figures frames --at 8:10:0.4 --format pdf --columns 1
  crgame figures runs/A runs/B --label Proposed --label Naive --figures timing,table
  crgame figures runs/NAME --video run.mp4

The same run gives the same files, to the byte. docs/figures.md tells more."""

FIGURES = ('frames', 'profiles', 'timing', 'table')
FOLDER = 'figures'
MOST_PANELS = 60


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of the command."""
    add = parser.add_argument
    add('runs', type=Path, nargs='+', metavar='RUN', help='folder of a run, or its recording')
    add('--out', type=Path, metavar='DIR', help='folder to write to; files of the same names in '
        'it are replaced (default: "figures" in the folder of the first run)')
    add('--figures', default=None, metavar='LIST',
        help=f'which of {",".join(FIGURES)} (default: all)')
    add('--format', default='svg', metavar='LIST', help='which of svg,pdf,png (default: svg)')
    add('--columns', type=int, choices=(1, 2), default=2,
        help='of a two-column page that a figure takes: 1 is 3.5 inches wide, 2 7.16 (default: 2)')
    add('--at', metavar='TIMES', help='times of the frames in seconds since the start of the run, '
        'as 2,5,8 or FROM:TO:STEP (default: around the most critical moments)')
    add('--moments', type=int, default=3, metavar='N',
        help='how many moments have frames, and are marked in profiles (default: 3)')
    add('--panels', type=int, default=6, metavar='N', help='frames of a moment (default: 6)')
    add('--spacing', type=float, default=0.2, metavar='S',
        help='between the frames of a moment (default: 0.2)')
    add('--more', action='store_true', help='profiles of acceleration and steering angle, too')
    add('--label', action='append', default=[], metavar='NAME',
        help='name of a run in timing figure and table; once for each run')
    add('--epoch', type=int, help='which run of a recording that holds several '
        '(resets count them from 0; default: the last)')
    add('--video', type=Path, metavar='FILE', help='write the run as FILE.mp4 (a GIF where there '
        'is no ffmpeg) or FILE.gif, in real time; figures only where --figures names some')
    parser.set_defaults(command=figures)


def figures(values: argparse.Namespace) -> int:
    """Draw the requested figures, and print the files with their contents."""
    from crgame_ros.analysis.pictures.figure_style import FORMATS
    from crgame_ros.analysis.runs.run import Run
    from crgame_ros.recording.progress import on_stderr, Progress
    from crgame_ros.recording.run_folder import recording_in
    wanted = _listed('--figures', values.figures, FIGURES) if values.figures is not None \
        else (() if values.video else FIGURES)
    formats = _listed('--format', values.format, FORMATS)
    times_s = None if values.at is None else _times(values.at)
    _check(values)
    runs = [Run.of_recording(path, values.epoch, name=label, progress=Progress(on_stderr).tell)
            for path, label in zip(
                values.runs, values.label or [''] * len(values.runs), strict=True)]
    for run, path in zip(runs, values.runs, strict=True):
        if not run.vehicles and (values.video or {'frames', 'profiles'} & set(wanted)):
            raise InputError('has no driven vehicle to draw', str(path), 'name another run')
    first = values.runs[0]
    folder = values.out or recording_in(first).parent / FOLDER
    for number, run in enumerate(runs):
        # With several runs, each run's own figures are in a separate folder.
        own = folder / _name(number, runs) if len(runs) > 1 else folder
        if 'frames' in wanted:
            for name, figure, caption in _frames(run, values, times_s):
                _write(figure, own / name, formats, caption)
        if 'profiles' in wanted:
            _write(_profiles(run, values), own / 'profiles', formats, 'heading angle, position '
                   f'and velocity{" and more" if values.more else ""} of {run.name}')
    if 'timing' in wanted or 'table' in wanted:
        _timing(runs, folder, wanted, formats, values.columns, values.figures is not None)
    if values.video:
        _video(runs[0], values.video)
    return 0


def _check(values: argparse.Namespace) -> None:
    """Refuse values from which no figure can be drawn."""
    for name, least, most in (('moments', 1, 100), ('panels', 1, MOST_PANELS)):
        if not least <= getattr(values, name) <= most:
            raise InputError(f'is {getattr(values, name)}', f'--{name}',
                             f'give {least} to {most}')
    if not 0.0 < values.spacing < math.inf:
        raise InputError(f'is {values.spacing}', '--spacing', 'give a positive number of seconds')
    if values.label and len(values.label) != len(values.runs):
        raise InputError(f'given {len(values.label)} times for {len(values.runs)} runs',
                         '--label', 'give one for each run')
    if values.video and len(values.runs) != 1:
        raise InputError(f'{len(values.runs)} runs are given', '--video', 'give one run')


def _listed(option: str, text: str, known: Sequence[str]) -> tuple[str, ...]:
    chosen = tuple(text.replace(',', ' ').split())
    strange = [each for each in chosen if each not in known]
    if strange or not chosen:
        raise InputError(f'is "{text[:60]}"', option, f'choose from {",".join(known)}')
    return chosen


def _times(text: str) -> list[float]:
    """Read 2,5,8 or FROM:TO:STEP."""
    try:
        if ':' in text:
            first, last, step = (float(part) for part in text.split(':'))
            count = math.floor((last - first) / step + 1e-9) + 1
            times = [first + i * step for i in range(min(count, MOST_PANELS + 1))]
        else:
            times = [float(part) for part in text.split(',')]
    except (ValueError, ArithmeticError):
        times = []
    if not 1 <= len(times) <= MOST_PANELS or not all(map(math.isfinite, times)):
        raise InputError(f'is "{text[:60]}"', '--at',
                         f'give 1 to {MOST_PANELS} times as 2,5,8 or FROM:TO:STEP')
    return times


def _frames(run: 'Run', values: argparse.Namespace, times_s: list[float] | None
            ) -> Iterator[tuple[str, 'Figure', str]]:
    """Yield the figures of frames with their names and captions."""
    from crgame_ros.analysis.pictures.frames_figure import frames_figure, panel_steps
    scene = run.scene
    if times_s is not None:
        first_s, last_s = run.times_s[[0, -1]].tolist()
        for time_s in times_s:
            if not first_s - 1e-6 <= time_s <= last_s + 1e-6:
                raise InputError(f'{time_s:g} s is not in it', run.name,
                                 f'it lasts from {first_s:g} to {last_s:g} s')
        yield 'frames', frames_figure(scene, [scene.k_at(each) for each in times_s],
                                      columns=values.columns), f'{run.name} at {values.at} s'
        return
    if not run.moments:
        print(f'note: no driven vehicle came near another object in {run.name}: no frames; '
              '--at names times', file=sys.stderr)
    for number, moment in enumerate(run.moments[:values.moments], 1):
        ks = panel_steps(scene, moment.time_s, values.panels, values.spacing)
        yield (f'frames_{number}',
               frames_figure(scene, ks, moment.vehicles, values.columns),
               f'{run.name} around {moment.time_s:.1f} s: {moment.why}')


def _profiles(run: 'Run', values: argparse.Namespace) -> 'Figure':
    from crgame_ros.analysis.pictures.profiles_figure import (
        ALL_PROFILES,
        profiles_figure,
        USUAL_PROFILES,
    )
    return profiles_figure(run.record, run.moments[:values.moments],
                           ALL_PROFILES if values.more else USUAL_PROFILES, values.columns)


def _timing(runs: Sequence['Run'], folder: Path, wanted: Sequence[str],
            formats: Sequence[str], columns: int, is_required: bool) -> None:
    """
    Draw the timing and write the table of all runs.

    :param is_required: whether it is an error, not a note, that a run has no cycles.
    """
    from crgame_ros.analysis.pictures.timing_figure import timing_figure
    from crgame_ros.analysis.pictures.timing_table import TimingTable
    from crgame_ros.recording.export import prepare_folder
    from crgame_ros.whole_file import write_text
    try:
        timed = [run.timed for run in runs]
    except InputError as error:
        if is_required:
            raise
        print(f'note: no timing: {error}', file=sys.stderr)
        return
    names = ' and '.join(run.name for run in runs)
    if 'timing' in wanted:
        _write(timing_figure(timed, columns), folder / 'timing', formats, f'timing of {names}')
    if 'table' in wanted:
        table = TimingTable(timed)
        prepare_folder(folder)
        for suffix, text in (('txt', table.text()), ('csv', table.csv()),
                             ('md', table.markdown()), ('tex', table.latex())):
            write_text(text, folder / f'timing.{suffix}')
            print(f'{folder / f"timing.{suffix}"}: timing metrics of {names}')
        print(table.text(), end='')


def _write(figure: 'Figure', place: Path, formats: Sequence[str], caption: str) -> None:
    from crgame_ros.analysis.pictures.figure_style import figure_bytes
    from crgame_ros.recording.export import prepare_folder
    from crgame_ros.whole_file import write_bytes
    prepare_folder(place.parent)
    for file_format in formats:
        path = place.with_name(f'{place.name}.{file_format}')
        write_bytes(figure_bytes(figure, file_format), path)
        print(f'{path}: {caption}', flush=True)


def _video(run: 'Run', path: Path) -> None:
    from crgame_ros.analysis.pictures.run_video import video_path, write_video
    from crgame_ros.recording.export import prepare_folder
    from crgame_ros.recording.progress import on_stderr, Progress
    prepare_folder(path.absolute().parent)
    if video_path(path) != path:
        on_stderr('note: ffmpeg is not installed: the video becomes a GIF')
    written = write_video(run.scene, path, Progress(on_stderr, f'drawing {run.name}'))
    print(f'{written}: {run.name} in real time')


def _name(number: int, runs: Sequence['Run']) -> str:
    """Return the name of a run's folder, unique among runs of the same name."""
    names = [re.sub(r'[^\w.-]+', '_', run.name).lstrip('.') or 'run' for run in runs]
    name = names[number]
    before = names[:number].count(name)
    return f'{name}_{before + 1}' if before else name
