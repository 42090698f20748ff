# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""`crgame scenarios`: the folders and archives in which scenarios are found by their ids."""

import argparse
from fnmatch import fnmatchcase
from pathlib import Path

from crgame_ros.errors import InputError
from crgame_ros.library.lookup import (
    all_ids,
    all_places,
    checked_place,
    drop_place,
    index_of,
    scenario_of,
    store_place,
    user_places,
    VARIABLE,
    variable_places,
)
from crgame_ros.library.stored_index import drop_index

DESCRIPTION = f"""\
Name folders and archives of CommonRoad scenarios once, and use benchmark ids instead of files.

  crgame scenarios add DIR                   a folder, with all inside it, or .zip, .tar, .tar.gz
  crgame scenarios                           the places, with the number of scenarios in each
  crgame scenarios list 'USA_US101-*'        the ids that fit
  crgame scenarios path USA_US101-4_1_T-1    the file of one
  crgame scenarios remove DIR                forget a place; its files stay
  ./run.sh --scenario USA_US101-4_1_T-1

The first place that has an id wins. Those of the environment variable {VARIABLE}, separated by
colons, go before those that were added."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of the command."""
    parser.set_defaults(command=_tell_places)
    actions = parser.add_subparsers(title='actions', metavar='ACTION')
    add = actions.add_parser('add', help='look for scenarios there, too')
    add.add_argument('place', type=Path, metavar='DIR|ARCHIVE')
    add.set_defaults(command=_add)
    remove = actions.add_parser('remove', help='look there no longer')
    remove.add_argument('place', type=Path, metavar='DIR|ARCHIVE')
    remove.set_defaults(command=_remove)
    listed = actions.add_parser('list', help='print ids')
    listed.add_argument('pattern', nargs='?', default='*', metavar='PATTERN',
                        help='with * and ? (default: all)')
    listed.set_defaults(command=_list)
    path = actions.add_parser('path', help='print the file of a scenario')
    path.add_argument('id', metavar='ID')
    path.set_defaults(command=_tell_path)


def _tell_places(_: argparse.Namespace) -> int:
    before, added = variable_places(), user_places()
    for place in all_places():
        origin = f'  ({VARIABLE})' if place in before else \
            '' if place in added else '  (of this package)'
        print(f'{_count(place):>16}  {place}{origin}')
    if not before and not added:
        print('add your own: crgame scenarios add DIR')
    return 0


def _count(place: Path) -> str:
    if not place.exists():
        return 'not there'
    number = len(index_of(place).entries(trusting=False))
    return f'{number} scenario{"" if number == 1 else "s"}'


def _add(values: argparse.Namespace) -> int:
    place = checked_place(values.place)
    number = len(index_of(place).entries(trusting=False))
    if not number:
        raise InputError('holds no CommonRoad scenario', str(place),
                         'name the folder or archive with the XML files')
    is_new = store_place(place)
    print(f'{place}: {number} scenario{"" if number == 1 else "s"}'
          + ('' if is_new else ', added before'))
    return 0


def _remove(values: argparse.Namespace) -> int:
    place = drop_place(values.place)
    drop_index(place)
    print(f'{place}: removed')
    return 0


def _list(values: argparse.Namespace) -> int:
    found = [name for name in all_ids() if fnmatchcase(name, values.pattern)]
    if not found:
        raise InputError('no scenario has an id like this', values.pattern,
                         'see crgame scenarios for the places')
    print('\n'.join(found))
    return 0


def _tell_path(values: argparse.Namespace) -> int:
    print(scenario_of(values.id))
    return 0
