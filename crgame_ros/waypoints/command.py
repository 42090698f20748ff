# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The command `crgame roads`."""

import argparse
import math
from pathlib import Path
import sys
from typing import Literal

from crgame_ros.errors import InputError, refusing

DESCRIPTION = """\
Turn way-point roads (CSV) into a CommonRoad scenario to drive on, or back.

  crgame roads roads.csv town.xml     lanes become lanelets; a game takes town.xml as its scenario
  crgame roads town.xml roads.csv     lanelets become lanes

The CSV has the columns lane,x,y,width,speed_limit [m, m/s], and successors, left and so on if
lanes are linked; docs/roads.md tells more. A lane is cut into lanelets where its limit changes.
With --start and --goal the scenario has a planning problem, that is, an AV can drive there:

  crgame roads roads.csv town.xml --start 7:10:8.3 --goal 9"""
# Greatest number of lanes whose cuts are printed.
_TOLD = 10


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of the command."""
    add = parser.add_argument
    add('source', metavar='IN', type=Path, help='way-points (.csv) or scenario (.xml)')
    add('out', metavar='OUT', type=Path, help='scenario (.xml) or way-points (.csv)')
    add('--type', choices=('urban', 'highway'), help='lanelet type of all lanes (default: urban)')
    add('--start', metavar='LANE:S:SPEED', help='where an AV starts: lane, station of its centre '
        '[m], speed [m/s]; needs --goal')
    add('--goal', metavar='LANE', help='lane that the AV shall reach; needs --start')
    add('--all', action='store_true', help='of a scenario, write sidewalks, crosswalks and other '
        'lanelets that are not for cars as well')
    add('--force', action='store_true', help='replace OUT if it is there')
    parser.set_defaults(command=run)


def run(values: argparse.Namespace) -> int:
    """
    Convert way-points to a scenario or a scenario to way-points, and print a summary.

    :return: exit code.
    :raises InputError: naming file, lane and station, or option.
    """
    ways = {('.csv', '.xml'): _to_scenario, ('.xml', '.csv'): _to_table}
    way = ways.get((values.source.suffix.lower(), values.out.suffix.lower()))
    if way is None:
        raise InputError(f'cannot turn {values.source.name} into {values.out.name}',
                         'crgame roads', 'name way-points (.csv) and a scenario (.xml), '
                         'in either order')
    # Check before the work.
    _check_target(values.out, values.force)
    way(values)
    return 0


def _to_scenario(values: argparse.Namespace) -> None:
    # Imported here, so that other commands do not load these libraries.
    from crgame_ros.waypoints.export import Drive, export_roads
    from crgame_ros.waypoints.roads import WaypointRoads
    from crgame_ros.whole_file import write_text
    if values.all:
        raise InputError('only lanelets can be left out', '--all', 'leave the option out')
    if (values.start is None) != (values.goal is None):
        given, missing = ('--start', '--goal') if values.goal is None else ('--goal', '--start')
        raise InputError(f'there is no {missing}', given, 'a planning problem has both')
    drive = None
    if values.start is not None:
        drive = Drive(*_start(values.start), _lane(values.goal, '--goal', 'give a lane'))
    kind: Literal['urban', 'highway'] = values.type or 'urban'
    roads = WaypointRoads.from_csv(values.source)
    made = export_roads(roads, values.out.stem, kind, drive,
                        str(values.source))
    _make_folder(values.out)
    write_text(made.xml_text, values.out)
    renamed = {lane: made.lanelets(lane) for lane in roads.lane_ids
               if made.lanelets(lane) != (lane,)}
    for lane, lanelets in list(renamed.items())[:_TOLD]:
        _note(f'lane {lane} is lanelet ' + ', then '.join(map(str, lanelets)))
    if len(renamed) > _TOLD:
        _note(f'{len(renamed) - _TOLD} more lanes are several lanelets')
    if drive is None:
        _note('it has no planning problem, so games on it have no AV (see --start and --goal); '
              "only CommonRoad's own schema asks for one")
    length = sum(roads.lane(lane).length for lane in roads.lane_ids)
    print(f'{values.out}: {_count(len(made.pieces), "lanelet")} of '
          f'{_count(len(roads.lane_ids), "lane")}, {length:.0f} m of lane, '
          f'{_count(int(drive is not None), "planning problem")}')


def _to_table(values: argparse.Namespace) -> None:
    from crgame_ros.roads.network import RoadNetwork
    from crgame_ros.scenario.loading import load_scenario
    from crgame_ros.waypoints.roads import WaypointRoads
    for name in ('type', 'start', 'goal'):
        if getattr(values, name) is not None:
            raise InputError('way-points have none', f'--{name}',
                             'give it when you turn way-points into a scenario')
    loaded = load_scenario(values.source)
    network = RoadNetwork(loaded.scenario.lanelet_network)
    roads = WaypointRoads.from_lanelets(network)
    kept = [lane for lane in roads.lane_ids if values.all or network.is_drivable(lane)]
    if not kept:
        raise InputError('no lanelet is for cars or bicycles', str(values.source), 'add --all')
    if len(kept) < len(roads.lane_ids):
        _note(f'{_count(len(roads.lane_ids) - len(kept), "lanelet")} not for cars left out; '
              'add --all to write them')
        roads = roads.only(kept)
    _make_folder(values.out)
    roads.to_csv(values.out)
    print(f'{values.out}: {_count(sum(len(roads.lane(lane).s) for lane in kept), "way-point")} '
          f'of {_count(len(kept), "lane")}')


def _start(text: str) -> tuple[int, float, float]:
    remedy = 'give LANE:S:SPEED, for example 7:10:8.3'
    parts = text.split(':')
    try:
        station, speed = (float(part) for part in parts[1:])
    except ValueError:
        station = speed = math.nan
    if not math.isfinite(station + speed):
        raise InputError(f'is "{text[:60]}"', '--start', remedy)
    return _lane(parts[0], '--start', remedy), station, speed


def _lane(text: str, option: str, remedy: str) -> int:
    if not (text.isascii() and text.isdigit() and len(text) < 20):
        raise InputError(f'{text[:60]!r} is no lane', option, remedy)
    return int(text)


def _check_target(path: Path, force: bool) -> None:
    """Refuse to overwrite an existing file, unless forced."""
    if not (path.exists() or path.is_symlink()):
        return
    if not path.is_file() or path.is_symlink():
        raise InputError('is no plain file', str(path), 'name another')
    if not force:
        raise InputError('is there already', str(path), 'add --force to replace it')


def _make_folder(path: Path) -> None:
    with refusing('cannot make its folder', path, 'choose another place'):
        path.parent.mkdir(parents=True, exist_ok=True)


def _note(text: str) -> None:
    print(f'note: {text}', file=sys.stderr)


def _count(number: int, name: str) -> str:
    return f'{number or "no"} {name}{"" if number == 1 else "s"}'
