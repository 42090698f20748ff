# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The formats of maps and data sets that can be imported, and how a file's format is found."""

from dataclasses import dataclass
from pathlib import Path
import re

from crgame_ros.errors import InputError
from crgame_ros.scenario import guard

_FIRST_ELEMENT = re.compile(r'<([A-Za-z_][\w.:-]*)[\s/>]')
# Of the header of a table [characters].
_LONGEST_LINE = 10_000
_COMMENT = re.compile(r'<!--.*?-->', re.DOTALL)
_LANELET = re.compile(r'''k=["']type["']\s+v=["']lanelet["']''')  # noqa: Q001


@dataclass(frozen=True)
class WorldKind:
    """
    A format.

    :param name: for `--format`.
    :param label: for people.
    :param root: name of the root element of a map; empty for a data set.
    :param files: patterns of file names, each of which a folder of the data set contains, at any
        depth.
    """

    name: str
    label: str
    root: str = ''
    files: tuple[str, ...] = ()


OPENDRIVE = WorldKind('opendrive', 'OpenDRIVE', 'OpenDRIVE')
LANELET2 = WorldKind('lanelet2', 'Lanelet2', 'osm')
SUMO = WorldKind('sumo', 'SUMO network', 'net')
OSM = WorldKind('osm', 'OpenStreetMap', 'osm')
MAPS = (OPENDRIVE, LANELET2, SUMO, OSM)
# As the converter names them. Of the last four the files have the same names: only the folder's
# name tells which it is.
_LEVELX = ('inD', 'rounD', 'exiD', 'uniD')
_TRACKS = ('*_tracks.csv', '*_tracksMeta.csv', '*_recordingMeta.csv')
_HIGHD = WorldKind('highd', 'highD', files=_TRACKS)
DATA_SETS = (
    WorldKind('interaction', 'INTERACTION', files=('vehicle_tracks_*.csv',)),
    WorldKind('sind', 'SinD', files=('Veh_smoothed_tracks.csv',)),
    WorldKind('mona', 'MONA', files=('trajectories.*',)),
    WorldKind('tumdot', 'TUMdot', files=('Trajectory-Data/*',)),
    _HIGHD, *(WorldKind(label.lower(), label, files=_TRACKS) for label in _LEVELX))


def named_kind(name: str) -> WorldKind:
    """
    Return the format of a name.

    :raises InputError: if there is none.
    """
    for kind in (*MAPS, *DATA_SETS):
        if kind.name == name.lower():
            return kind
    raise InputError(f'{name[:40]!r} is no format', '--format', 'these are '
                     + ', '.join(kind.name for kind in (*MAPS, *DATA_SETS)))


def find_kind(source: Path) -> WorldKind:
    """
    Return the format of a map or of a folder with a data set, by its content.

    :raises InputError: if it is none of those known.
    """
    if source.is_dir():
        return _data_set(source)
    text = guard.read_text(source)
    first = _FIRST_ELEMENT.search(_COMMENT.sub('', text))
    root = '' if first is None else first[1].rpartition(':')[2]
    if root == 'commonRoad':
        raise InputError('is a CommonRoad scenario already', str(source),
                         f'run it: ./run.sh --scenario {source}')
    for kind in MAPS:
        if kind.root == root and (kind is not LANELET2 or _LANELET.search(text)):
            return kind
    raise InputError(f'its root element is <{root[:40]}>' if root else 'is no XML', str(source),
                     'give OpenDRIVE (.xodr), Lanelet2 or OpenStreetMap (.osm), a SUMO network '
                     '(.net.xml), or a folder with a data set')


def _data_set(folder: Path) -> WorldKind:
    fitting = [kind for kind in DATA_SETS
               if all(next(folder.rglob(pattern), None) for pattern in kind.files)]
    if not fitting:
        raise InputError('holds no data set that is known', str(folder),
                         'name the folder of highD, inD, rounD, exiD, uniD, INTERACTION, SinD, '
                         'MONA or TUMdot, or say which it is with --format')
    if fitting[0] is not _HIGHD:
        return fitting[0]
    # highD alone has the lanes in its table of recordings.
    with next(folder.rglob(_TRACKS[-1])).open(encoding='utf-8', errors='replace') as table:
        if 'laneMarkings' in table.readline(_LONGEST_LINE).replace('Lane', 'lane'):
            return _HIGHD
    words = re.findall('[a-z]+', str(folder.resolve()).lower())
    for kind in fitting[1:]:
        if kind.name in words:
            return kind
    raise InputError('is inD, rounD, exiD or uniD, but its name does not say which', str(folder),
                     'say so with --format')
