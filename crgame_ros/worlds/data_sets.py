# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Converts data sets of recorded traffic to CommonRoad scenarios."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
import re
import subprocess
import tempfile
from threading import Timer

from crgame_ros.errors import CrgameError, InputError, one_line
from crgame_ros.paths import config_directory
from crgame_ros.recording.export import prepare_folder
from crgame_ros.recording.progress import Progress
from crgame_ros.scenario.loading import parse_scenario
from crgame_ros.whole_file import write_text
from crgame_ros.worlds.environments import converter_variables, DATA_SET_CONVERTER
from crgame_ros.worlds.kinds import WorldKind
from crgame_ros.worlds.recorded_scenario import recorded_scenario
from crgame_ros.worlds.recordings import find_recordings, Recording

_TIME_STEP = re.compile('timeStepSize="[^"]*"')
# A recording has fewer scenarios than this, so that its number and theirs make one.
_PER_RECORDING = 10_000
# Lines of the converter that say why it made nothing.
_REASON = re.compile(r'(Error|Exception)\b.*:')
_LAST_WORDS = 300


@dataclass(frozen=True)
class DataSetImport:
    """
    What to convert.

    :param source: the folder of a data set, or the file with the tracks of one recording.
    :param out: folder of the scenarios.
    :param limit: greatest number of scenarios.
    :param steps: time steps of each.
    :param downsample: take each n-th frame only.
    :param timeout_s: that a recording may take [s]
    :param force: replace scenarios that are there.
    """

    source: Path
    kind: WorldKind
    out: Path
    limit: int
    steps: int
    downsample: int = 1
    timeout_s: float = 900.0
    force: bool = False


def convert_data(order: DataSetImport, say: Callable[[str], object]) -> Iterator[Path]:
    """
    Convert a data set, and yield each scenario once it is written.

    The recordings are taken in the order of their names, each from its beginning: the same order
    gives the same scenarios. Each has a planning problem, which a recorded car solved.

    :param say: called with each line of progress.
    :raises InputError: if the data are not as published, the folder cannot be written to, the
        converter fails, a scenario is there already, or there is none.
    :raises CrgameError: if the converter cannot be installed.
    """
    recordings = find_recordings(order.source, order.kind, say)
    prepare_folder(order.out)
    program = DATA_SET_CONVERTER.program('python', say)
    count = skipped = 0
    progress = Progress(say)
    for place, recording in enumerate(recordings, 1):
        say(f'reading {order.kind.label}, recording {recording.name}: {place} of '
            f'{len(recordings)}')
        with tempfile.TemporaryDirectory(prefix='crgame-import-') as name, \
                _windows(program, recording, order, Path(name)) as made:
            for window, path in enumerate(made, 1):
                written = _finish(path, recording, window, order)
                path.unlink()
                if written is None:
                    skipped += 1
                    continue
                yield written
                count += 1
                progress.tell(f'{count} of {order.limit} scenarios', count / order.limit)
                if count == order.limit:
                    return
    if skipped:
        say(f'note: left out, as no car drives in it from the beginning on: {skipped} of '
            f'{skipped + count}')
    if not count:
        raise InputError('no scenario was made of it', str(order.source),
                         'give other --steps, or another recording')


def _finish(path: Path, recording: Recording, window: int,
            order: DataSetImport) -> Path | None:
    """Complete and write a scenario of the converter; None if there is nothing to drive."""
    text = path.read_text(encoding='utf-8')
    if recording.time_step_s is not None:
        step = recording.time_step_s * order.downsample
        text = _TIME_STEP.sub(f'timeStepSize="{step:g}"', text, 1)
    what = f'{order.kind.label}, recording {recording.name}'
    loaded = parse_scenario(text, what)
    last = loaded.scenario.scenario_id.prediction_id
    made = recorded_scenario(
        loaded, _PER_RECORDING * recording.number + window,
        f'{what}, up to frame {last}, by {DATA_SET_CONVERTER.title} and crgame import')
    if made is None:
        return None
    out = order.out / f'{made.benchmark_id}.xml'
    if out.exists() and not order.force:
        raise InputError('is there already', str(out), 'add --force to replace it')
    write_text(made.xml_text, out)
    return out


@contextmanager
def _windows(program: Path, recording: Recording, order: DataSetImport,
             folder: Path) -> Iterator[Iterator[Path]]:
    """
    Run the converter on a recording, in a folder of its own.

    :return: yields the scenarios while it makes them; at the end of the block it is ended.
    :raises InputError: if it fails.
    """
    given, made, log = folder / 'given', folder / 'made', folder / 'log'
    for path, name in recording.files:
        (given / name).parent.mkdir(parents=True, exist_ok=True)
        (given / name).symlink_to(path)
    words = [str(program), str(config_directory() / 'converters' / 'data_set_windows.py'),
             '--num-planning-problems', '0', '--routability-check', 'nocheck',
             '--num-time-steps', str(order.steps * order.downsample),
             '--downsample', str(order.downsample), '--obstacles-start-at-zero',
             str(given), str(made), order.kind.name, *recording.words]
    with log.open('wb') as errors:
        try:
            # The order of sets, and so of some elements, follows from the hashes.
            process = subprocess.Popen(
                words, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=errors,
                text=True, cwd=folder, env=converter_variables() | {
                    'PYTHONHASHSEED': '0', '_TYPER_STANDARD_TRACEBACK': '1'})
        except OSError as error:
            raise CrgameError(f'{DATA_SET_CONVERTER.title} cannot be run '
                              f'({error.strerror})') from error
    late: list[bool] = []

    def expire() -> None:
        late.append(True)
        process.kill()

    timer = Timer(order.timeout_s, expire)
    timer.start()
    try:
        yield _made(process, made, log, recording, late, order.timeout_s)
    finally:
        timer.cancel()
        process.kill()
        process.wait()
        if process.stdout is not None:
            process.stdout.close()


def _made(process: 'subprocess.Popen[str]', made: Path, log: Path, recording: Recording,
          late: list[bool], timeout_s: float) -> Iterator[Path]:
    count = 0
    for line in process.stdout or ():
        count += 1
        yield made / line.strip()
    what = f'recording {recording.name}: {DATA_SET_CONVERTER.title}'
    if late:
        raise InputError(f'took longer than {timeout_s:.0f} s', what,
                         'give fewer --steps, or more time with --timeout')
    lines = [line.strip() for line in log.read_text(errors='replace').splitlines()]
    reasons = [line for line in lines if _REASON.search(line)]
    if process.wait() or (reasons and not count):
        said = (reasons or [line for line in lines if line] or ['it wrote nothing'])[-1]
        raise InputError(one_line(said)[-_LAST_WORDS:], what)
