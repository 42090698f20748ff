# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The formats of maps and data sets that can be imported, and how a file's format is found."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
import re

from crgame_ros.errors import InputError
from crgame_ros.scenario import guard

_FIRST_ELEMENT = re.compile(r'<([A-Za-z_][\w.:-]*)[\s/>]')
# Files with the tracks of a recording.
_TABLES = ('.csv', '.parquet')
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
# As the converter names them. Of the last four the files have the same names: only the name of a
# folder tells which it is.
_TRACKS = ('[0-9]*_tracks.csv',)
INTERACTION = WorldKind('interaction', 'INTERACTION', files=('vehicle_tracks_*.csv',))
SIND = WorldKind('sind', 'SinD', files=('Veh_smoothed_tracks.csv',))
MONA = WorldKind('mona', 'MONA', files=('trajectories.*',))
TUMDOT = WorldKind('tumdot', 'TUMdot', files=('Trajectory-Data/*',))
HIGHD = WorldKind('highd', 'highD', files=_TRACKS)
_LEVELX = tuple(WorldKind(label.lower(), label, files=_TRACKS)
                for label in ('inD', 'rounD', 'exiD', 'uniD'))
DATA_SETS = (INTERACTION, SIND, MONA, TUMDOT, HIGHD, *_LEVELX)


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
    Return the format of a map, of a folder with a data set or of a recording's tracks.

    :raises InputError: if it is none of those known.
    """
    if source.is_dir():
        return _data_set(source)
    if source.suffix.lower() in _TABLES:
        return _data_set(source.parent)
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
    # The folder itself may be the one of a pattern.
    fitting = [kind for kind in DATA_SETS if kind.files is not _TRACKS
               and all(next(_matching(folder, pattern), None) for pattern in kind.files)]
    # Tables may be missing; who reads them says so.
    fitting += {_levelx(path) for path in _matching(folder, _TRACKS[0])}
    if not fitting:
        raise InputError('holds no data set that is known', str(folder),
                         'name the folder of highD, inD, rounD, exiD, uniD, INTERACTION, SinD, '
                         'MONA or TUMdot, or say which it is with --format')
    if len(fitting) > 1:
        raise InputError('holds ' + ' and '.join(sorted(kind.label for kind in fitting)),
                         str(folder), 'name the folder of one of them, or give --format')
    return fitting[0]


def _matching(folder: Path, pattern: str) -> Iterator[Path]:
    whole = folder.resolve()
    yield from whole.rglob(pattern)
    if '/' in pattern and whole.name == pattern.partition('/')[0]:
        yield from whole.iterdir()


def _levelx(tracks: Path) -> WorldKind:
    """Return the data set of a recording by highD's columns, or else by the folder's name."""
    with tracks.open(encoding='utf-8', errors='replace') as table:
        if re.search(r'\bxVelocity\b', header := table.readline(_LONGEST_LINE)) \
                and not re.search(r'\bxCenter\b', header):
            return HIGHD
    for folder in tracks.parents:
        words = re.findall('[a-z]+', folder.name.lower())
        for kind in (*_LEVELX, HIGHD):
            if kind.name in words:
                return kind
    raise InputError('is inD, rounD, exiD or uniD, but no folder of that name', str(tracks),
                     'say which it is with --format')
