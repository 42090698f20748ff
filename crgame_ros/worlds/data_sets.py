# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Converts data sets of recorded traffic to CommonRoad scenarios."""

from collections.abc import Callable
from pathlib import Path
import tempfile

from crgame_ros.errors import InputError
from crgame_ros.scenario.loading import load_scenario
from crgame_ros.whole_file import write_text
from crgame_ros.worlds.environments import DATA_SET_CONVERTER, run_converter
from crgame_ros.worlds.kinds import WorldKind


def convert_data(source: Path, kind: WorldKind, out: Path, limit: int, steps: int,
                 timeout_s: float, say: Callable[[str], object]) -> list[Path]:
    """
    Convert a data set; each scenario has a planning problem, which a recorded vehicle solved.

    :param out: folder of the scenarios.
    :param limit: greatest number of scenarios.
    :param steps: time steps of each.
    :param timeout_s: that the converter may take [s]
    :param say: called with each line of progress.
    :return: the files, at least one.
    :raises InputError: if the converter fails, or no scenario can be loaded.
    """
    program = DATA_SET_CONVERTER.program('crconvert', say)
    written = []
    with tempfile.TemporaryDirectory(prefix='crgame-import-') as name:
        folder = Path(name)
        say(f'converting {source}, {kind.label}')
        run_converter([str(program), str(source.resolve()), str(folder), '--max-scenarios',
                       str(limit), '--num-time-steps', str(steps), '--obstacles-start-at-zero',
                       kind.name], folder, f'{source}: {DATA_SET_CONVERTER.title}', timeout_s)
        for path in sorted(folder.rglob('*.xml')):
            try:
                loaded = load_scenario(path)
            except InputError as error:
                say(f'note: left out: {error}')
                continue
            write_text(loaded.xml_text, out / path.name)
            written.append(out / path.name)
    if not written:
        raise InputError('no scenario was made of it', str(source),
                         'give fewer --steps, or another recording')
    return written
