# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The command `crgame import`: maps and data sets of other formats."""

import argparse
from pathlib import Path
import sys
from typing import TYPE_CHECKING

from crgame_ros.errors import InputError
from crgame_ros.paths import make_folder

if TYPE_CHECKING:
    from crgame_ros.worlds.kinds import WorldKind

DESCRIPTION = """\
Turn a map or a data set of another format into CommonRoad scenarios to drive in.

  crgame import town.xodr                     OpenDRIVE (.xodr)
  crgame import lanelet2_map.osm              Lanelet2, also Autoware's
  crgame import town.net.xml                  a network of SUMO
  crgame import town.osm                      an extract of OpenStreetMap
  crgame import highD/data --limit 20         highD, inD, rounD, exiD, uniD, INTERACTION, SinD,
                                              MONA or TUMdot
  ./run.sh --scenario worlds/town.xml         drive there

The converters are those of the CommonRoad project, and SUMO's netconvert. Each is installed once,
when it is needed first, into an environment of its own. What they lose or break is mended or told.
A map counts as imported when an AV has driven on it in dense traffic."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of the command."""
    add = parser.add_argument
    add('source', metavar='FILE|FOLDER', type=Path,
        help='a map, the folder of a data set, or the tracks of one recording')
    add('--out', type=Path, metavar='DIR', default=Path('worlds'),
        help='folder of the scenarios (default: worlds)')
    add('--format', metavar='NAME', help='format of the source (default: by its content)')
    add('--limit', type=int, metavar='N', default=10,
        help='scenarios of a data set at most (default: %(default)d)')
    add('--steps', type=int, metavar='N', default=150,
        help='time steps of each (default: %(default)d)')
    add('--downsample', type=int, metavar='N', default=1,
        help='take each N-th frame of a data set only (default: %(default)d)')
    add('--timeout', type=float, metavar='S', default=900.0,
        help='that a converter may take (default: %(default)g)')
    add('--no-drive', action='store_true', help='leave the trial drive out')
    add('--force', action='store_true', help='replace a file that is there')
    parser.set_defaults(command=run)


def run(values: argparse.Namespace) -> int:
    """
    Import a map or a data set, and print what was written.

    :return: exit code.
    :raises InputError: if it cannot be read or converted.
    :raises CrgameError: if a converter cannot be installed.
    """
    from crgame_ros.worlds.kinds import find_kind, MAPS, named_kind
    source = values.source
    if not source.exists():
        raise InputError('does not exist', str(source), 'name a file or a folder')
    kind = named_kind(values.format) if values.format else find_kind(source)
    if source.is_dir() and kind in MAPS:
        raise InputError('is no file', str(source), f'{kind.label} is one')
    if kind in MAPS:
        _import_map(values, kind)
    else:
        _import_data(values, kind)
    return 0


def _say(line: str) -> None:
    print(line, file=sys.stderr, flush=True)


def _import_map(values: argparse.Namespace, kind: 'WorldKind') -> None:
    from crgame_ros.recording.progress import Progress
    from crgame_ros.scenario.loading import parse_scenario
    from crgame_ros.whole_file import write_text
    from crgame_ros.worlds.conversion import convert_map
    from crgame_ros.worlds.trial_drive import trial_drive
    out = values.out / f'{values.source.name.split(".")[0]}.xml'
    if out.exists() and not values.force:
        raise InputError('is there already', str(out), 'add --force to replace it')
    made = convert_map(values.source, kind, values.timeout, _say)
    for remark in made.remarks:
        _say(f'note: {remark}')
    told = ''
    if not values.no_drive:
        drive = trial_drive(parse_scenario(made.xml_text, str(out)), made.length,
                            Progress(_say, 'trial drive'))
        told = f'\n{drive.told()}'
    make_folder(values.out, 'choose another place with --out')
    write_text(made.xml_text, out)
    print(f'{out}: {made.lanelets} lanelets, {made.length:.0f} m of lane{told}\n'
          f'./run.sh --scenario {out}')


def _import_data(values: argparse.Namespace, kind: 'WorldKind') -> None:
    from crgame_ros.worlds.data_sets import convert_data, DataSetImport
    for name, least in (('limit', 1), ('steps', 10), ('downsample', 1)):
        if getattr(values, name) < least:
            raise InputError('is too small', f'--{name}', f'give {least} or more')
    order = DataSetImport(values.source, kind, values.out, values.limit, values.steps,
                          values.downsample, values.timeout, values.force)
    first = None
    for path in convert_data(order, _say):
        print(path, flush=True)
        first = first or path
    print(f'./run.sh --scenario {first}')
