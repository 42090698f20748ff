# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Predetermined trajectories of objects, from CSV files and from lists."""

from collections.abc import Sequence
import csv
import math
from pathlib import Path
from typing import Any

from crgame_ros.errors import InputError, short

# Time since the start of the object [s], centre x [m], y [m], yaw [rad].
TrajectoryRow = tuple[float, float, float, float]
MAX_BYTES = 1 << 20
MAX_ROWS = 5000
MAX_SPEED = 100.0
MAX_COORDINATE = 1e7
_MAX_TIME = 1e6
_COLUMNS = ('t', 'x', 'y', 'yaw')


def read_trajectory(name: str, base: Path, where: str) -> tuple[TrajectoryRow, ...]:
    """
    Read a CSV file with the columns t,x,y or t,x,y,yaw.

    :param name: of the file, relative to `base`, in which it must be.
    :param where: for messages that are about the name.
    :raises InputError: naming the file, the line and the remedy.
    """
    try:
        root = base.resolve()
        path = (root / name).resolve()
        if not path.is_relative_to(root):
            raise InputError(f'the trajectory {short(name)} is outside {root}', where,
                             'put it beside the game file')
        if path.stat().st_size > MAX_BYTES:
            raise InputError('is larger than 1 MiB', str(path), 'thin out the trajectory')
        with path.open(encoding='utf-8-sig', newline='') as file:
            return _parse(csv.reader(file, strict=True), str(path))
    except (OSError, ValueError, RuntimeError) as error:
        reason = getattr(error, 'strerror', None) or str(error)
        raise InputError(f'cannot read the trajectory {short(name)} ({reason})', where,
                         'name a CSV file') from error
    except csv.Error as error:
        raise InputError(f'is no CSV ({error})', str(path), 'save it as CSV in UTF-8') from error


def _parse(reader: Any, path: str) -> tuple[TrajectoryRow, ...]:
    header = tuple(cell.strip() for cell in next(reader, []))
    if header not in (_COLUMNS, _COLUMNS[:3]):
        raise InputError(f'its first line is {short(",".join(header))}', path,
                         'begin with t,x,y or t,x,y,yaw')
    rows: list[list[Any]] = []
    places = []
    for row in reader:
        if any(cell.strip() for cell in row):
            rows.append([_as_number(cell) for cell in row])
            places.append(f'{path}, line {reader.line_num}')
        if len(rows) > MAX_ROWS:
            break
    return checked_trajectory(rows, path, places)


def _as_number(text: str) -> float | str:
    try:
        return float(text)
    except ValueError:
        return text


def checked_trajectory(rows: Any, where: str,
                       places: Sequence[str] = ()) -> tuple[TrajectoryRow, ...]:
    """
    Check the rows of a trajectory; where none has a yaw it is the direction of motion.

    :param rows: lists of t [s], x [m], y [m] and perhaps yaw [rad].
    :param where: for messages.
    :param places: where each row stands, if not in a list.
    :raises InputError: naming the row and the remedy.
    """
    if not isinstance(rows, list | tuple) or not 2 <= len(rows) <= MAX_ROWS:
        count = f'has {len(rows)} rows' if isinstance(rows, list | tuple) else 'is no list'
        raise InputError(f'the trajectory {count}', where, f'give 2 to {MAX_ROWS} rows')
    checked: list[tuple[float, ...]] = []
    for index, row in enumerate(rows):
        place = places[index] if places else f'{where}[{index}]'
        if not isinstance(row, list | tuple) or len(row) not in (3, 4) \
                or len(row) != len(rows[0]):
            raise InputError(f'{short(row)} is no row', place, 't,x,y or t,x,y,yaw in every row')
        for value, bound in zip(row, (_MAX_TIME, MAX_COORDINATE, MAX_COORDINATE, 1e3),
                                strict=False):
            if isinstance(value, bool) or not isinstance(value, int | float) \
                    or not abs(value) <= bound:
                raise InputError(f'{short(value)} is no number that can be used', place,
                                 'give finite seconds, metres and radians')
        checked.append(tuple(float(value) for value in row))
        if index:
            _check_step(checked[-2], checked[-1], place)
    return _with_headings(checked)


def _check_step(before: tuple[float, ...], row: tuple[float, ...], place: str) -> None:
    duration = row[0] - before[0]
    if not duration > 0.0:
        raise InputError(f't = {row[0]:g} s comes after {before[0]:g} s', place,
                         'let the time increase')
    distance = math.dist(row[1:3], before[1:3])
    if distance > MAX_SPEED * duration:
        raise InputError(f'it moves by {distance:.4g} m in {duration:.4g} s', place,
                         f'stay below {MAX_SPEED:g} m/s')


def _with_headings(rows: Sequence[tuple[float, ...]]) -> tuple[TrajectoryRow, ...]:
    """Fill in missing headings: where it goes next, and at rest where it went last."""
    if len(rows[0]) == 4:
        return tuple((row[0], row[1], row[2], row[3]) for row in rows)
    headings: list[float | None] = []
    for row, after in zip(rows, rows[1:], strict=False):
        moved = math.dist(row[1:3], after[1:3]) > 1e-3
        headings.append(math.atan2(after[2] - row[2], after[1] - row[1]) if moved
                        else headings[-1] if headings else None)
    known = next((heading for heading in headings if heading is not None), 0.0)
    headings.append(headings[-1])
    return tuple((row[0], row[1], row[2], known if heading is None else heading)
                 for row, heading in zip(rows, headings, strict=True))
