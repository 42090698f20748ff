# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The recordings of a data set: found at any depth of a folder, and checked before the converter.

The converter expects one layout of folders for each data set and reads files in the order in which
the file system lists them. Each recording is therefore given to it alone, under the names that it
expects.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
import re

from crgame_ros.errors import InputError, refusing
from crgame_ros.worlds.kinds import HIGHD, INTERACTION, MONA, SIND, TUMDOT, WorldKind

_HIGHD_TRACKS = ('frame id x y width height xVelocity yVelocity xAcceleration yAcceleration',
                 'id width height class drivingDirection',
                 'id locationId speedLimit upperLaneMarkings lowerLaneMarkings')
_LEVELX_TRACKS = ('trackId frame xCenter yCenter heading lonVelocity lonAcceleration',
                  'trackId width length class', 'recordingId locationId frameRate')
_INTERACTION = 'track_id frame_id agent_type x y vx vy psi_rad length width'
_SIND = ('track_id frame_id agent_type x y yaw_rad v_lon length width',
         'track_id frame_id agent_type x y vx vy')
_MONA = 'track_id frame_id agent_type x y v psi_rad yaw_rate length width'
_TUMDOT = ('timestamp track_id category translation_x translation_y rotation_z dimension_x '
           'dimension_y velocity_x velocity_y acceleration_x acceleration_y')
_TRAJECTORY_DATA = 'Trajectory-Data'
# Those whose maps the converter has, and where it looks for their recordings.
_INTERACTION_FOLDERS = {
    **{f'DR_{name}': 'INTERACTION-Dataset-DR-v1_0' for name in (
        'CHN_Merging_ZS', 'CHN_Roundabout_LN', 'DEU_Merging_MT', 'DEU_Roundabout_OF',
        'USA_Intersection_EP0', 'USA_Intersection_EP1', 'USA_Intersection_GL',
        'USA_Intersection_MA', 'USA_Roundabout_EP', 'USA_Roundabout_FT', 'USA_Roundabout_SR')},
    'TC_BGR_Intersection_VA': 'INTERACTION-Dataset-TC-v1_0'}
# The converter takes 0.04 s; the recordings have 10 Hz.
_INTERACTION_STEP_S = 0.1
_MONA_FOLDER = re.compile('(east|west|merge)[_-](00[0-4])[_-]([0-9]{3})')
_SIND_CITIES = ('Changchun', 'Chongqing', 'Xian')
# Of SinD; nobody may be on foot.
_PEOPLE, _LIGHTS = 'Ped_smoothed_tracks.csv', 'TrafficLight_*.csv'
_TOLD = 4


@dataclass(frozen=True)
class Recording:
    """
    A recording.

    :param name: for people.
    :param number: of the recording, from 0 on.
    :param files: its files, and their names as the converter expects them.
    :param words: options for the converter.
    :param time_step_s: of its frames, if the converter does not know it [s]
    """

    name: str
    number: int
    files: tuple[tuple[Path, str], ...]
    words: tuple[str, ...] = ()
    time_step_s: float | None = None


def find_recordings(source: Path, kind: WorldKind,
                    say: Callable[[str], object]) -> list[Recording]:
    """
    Return the recordings of a data set, in the order of their names.

    :param source: a folder that contains them, or the file with the tracks of one.
    :param say: called with a remark on each that is left out, as it is empty or has no map.
    :raises InputError: if a file is missing or lacks a column, or no recording is left.
    """
    folder = source if source.is_dir() else source.parent
    find = {HIGHD: _highd, INTERACTION: _interaction, SIND: _sind, MONA: _mona,
            TUMDOT: _tumdot}.get(kind, _levelx)
    found = [each for each in find(folder.resolve(), say)
             if source.is_dir() or any(path == source.resolve() for path, _ in each[0].files)]
    recordings = []
    for recording, columns in found:
        filled = [_is_filled(path, needed) or path.name == _PEOPLE
                  for (path, _), needed in zip(recording.files, columns, strict=False)]
        if all(filled):
            recordings.append(recording)
        else:
            say(f'note: recording {recording.name} is empty and left out')
    if not recordings:
        raise InputError(f'holds no recording of {kind.label}' if not found else
                         'all its recordings are empty', str(source),
                         'name the folder as it was unpacked')
    return recordings


# A recording, and the columns that its first files need.
_Found = Iterable[tuple[Recording, tuple[str, ...]]]


def _highd(folder: Path, say: Callable[[str], object]) -> _Found:
    return _tracks(folder, _HIGHD_TRACKS)


def _levelx(folder: Path, say: Callable[[str], object]) -> _Found:
    return _tracks(folder, _LEVELX_TRACKS)


def _tracks(folder: Path, columns: tuple[str, ...]) -> _Found:
    for path in sorted(folder.rglob('[0-9]*_tracks.csv')):
        name = path.name.removesuffix('_tracks.csv')
        paths = [path, *(_there(path.with_name(f'{name}_{table}Meta.csv'), path)
                         for table in ('tracks', 'recording'))]
        yield Recording(name, _number(name, path), tuple((each, each.name) for each in paths)), \
            columns


def _interaction(folder: Path, say: Callable[[str], object]) -> _Found:
    unknown = set()
    for path in sorted(folder.rglob('vehicle_tracks_*.csv')):
        place = path.parent.name
        if place not in _INTERACTION_FOLDERS:
            unknown.add(place)
            continue
        name = path.stem.removeprefix('vehicle_tracks_')
        yield Recording(
            f'{place} {name}', _number(name, path),
            ((path, f'{_INTERACTION_FOLDERS[place]}/recorded_trackfiles/{place}/{path.name}'),),
            time_step_s=_INTERACTION_STEP_S), (_INTERACTION,)
    if unknown:
        say('note: the converter has no map of '
            + ', '.join(sorted(unknown)[:_TOLD]) + (' …' if len(unknown) > _TOLD else ''))


def _sind(folder: Path, say: Callable[[str], object]) -> _Found:
    for path in sorted(folder.rglob('Veh_smoothed_tracks.csv')):
        name = path.parent.name
        # The converter takes the folder's name for a number, and its parts for that of the lights.
        parts = re.findall('[0-9]+', name)
        parts += ['1'] * (2 - len(parts))
        plain = str(path.parent).lower().replace("'", '')
        city = next((each for each in _SIND_CITIES if each.lower() in plain), 'Tianjin')
        files = [(path, path.name), (_there(path.with_name(_PEOPLE), path), _PEOPLE)]
        lights = sorted(path.parent.glob(_LIGHTS))
        if lights and city == 'Tianjin':
            number = '_'.join((parts[0], f'{int(parts[1]):02d}', *parts[2:]))
            files.append((lights[0], f'TrafficLight_{number}.csv'))
        yield Recording(
            name, int(''.join(parts)),
            tuple((each, f'{"_".join(parts)}/{given}') for each, given in files),
            ('--location', city)), _SIND


def _mona(folder: Path, say: Callable[[str], object]) -> _Found:
    for path in sorted(folder.rglob('trajectories.*')):
        place = _MONA_FOLDER.fullmatch(path.parent.name)
        if place is None or path.suffix not in ('.csv', '.parquet'):
            say(f'note: {path} is left out: its folder is not named as in east_001_002')
            continue
        yield Recording(path.parent.name, int(place[2] + place[3]),
                        ((path, f'{path.parent.name}/{path.name}'),)), (_MONA,)


def _tumdot(folder: Path, say: Callable[[str], object]) -> _Found:
    folders = [folder] if folder.name == _TRAJECTORY_DATA else \
        sorted(folder.rglob(_TRAJECTORY_DATA))
    for path in (each for parent in folders for each in sorted(parent.iterdir())
                 if each.is_file() and not each.name.startswith('.')):
        # The converter takes what follows the last underscore for a number.
        number = int((re.findall('[0-9]+', path.stem) or ['1'])[-1])
        yield Recording(path.name, number, ((path, f'{_TRAJECTORY_DATA}/recording_{number}'),)), \
            (_TUMDOT,)


def _there(path: Path, tracks: Path) -> Path:
    if not path.is_file():
        raise InputError('is missing', str(path), f'{tracks.name} is of no use without it')
    return path


def _number(name: str, path: Path) -> int:
    if not name.isdecimal():
        raise InputError('has no number in its name', str(path), 'name it as the data set does')
    return int(name)


def _is_filled(path: Path, columns: str) -> bool:
    """
    Return whether a table has rows.

    :param columns: that it needs.
    :raises InputError: if it lacks one of them, or cannot be read.
    """
    if path.suffix == '.parquet':
        return True
    with refusing('cannot be read', path):
        with path.open(encoding='utf-8-sig', errors='replace') as table:
            header, first = [*islice(table, 2), '', ''][:2]
    if header.strip():
        names = {name.strip().strip('"') for name in header.split(',')}
        missing = [name for name in columns.split() if name not in names]
        if missing:
            raise InputError(f'has no column {", ".join(missing[:_TOLD])}', str(path),
                             'give the file as it was published')
    return bool(first.strip())
