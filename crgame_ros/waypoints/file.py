# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Tables of way-points as CSV files; docs/roads.md documents the columns."""

from collections.abc import Mapping
import csv
from dataclasses import dataclass, field
import io
import math
from pathlib import Path
from typing import Any

from crgame_ros.errors import InputError, short
from crgame_ros.whole_file import write_text
import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

MAX_BYTES = 32 << 20
MAX_ROWS = 1_000_000
_NUMBERS = ('x', 'y', 'width', 'speed_limit')
_LISTS = ('successors', 'predecessors')
_SINGLE = ('left', 'right', 'oncoming_left', 'oncoming_right')
_MAX_ID = 2**63 - 1


@dataclass(frozen=True)
class LaneRows:
    """
    One lane of a table.

    :param line: line number of its first row.
    :param points: (W, 4) x [m], y [m], width [m], speed limit [m/s]
    :param links: successors, predecessors, left, … as in `LaneLinks`.
    """

    line: int
    points: FloatArray
    links: dict[str, Any] = field(default_factory=dict)


def read_lane_rows(path: Path) -> dict[int, LaneRows]:
    """
    Read a table of way-points, lane by lane.

    :raises InputError: naming the file, the line and the remedy.
    """
    try:
        if path.stat().st_size > MAX_BYTES:
            raise InputError(f'is larger than {MAX_BYTES >> 20} MiB', str(path),
                             'thin out the way-points, or split the map')
        with path.open(encoding='utf-8-sig', newline='') as file:
            return _parse(csv.reader(file, strict=True), str(path))
    except OSError as error:
        raise InputError(f'cannot read the way-points ({error.strerror})', str(path),
                         'check the name') from error
    except (UnicodeDecodeError, csv.Error) as error:
        raise InputError(f'is no CSV ({error})', str(path), 'save it as CSV in UTF-8') from error


def _parse(reader: Any, path: str) -> dict[int, LaneRows]:
    columns = _header(next(reader, []), path)
    points: dict[int, list[list[float]]] = {}
    first: dict[int, int] = {}
    links: dict[int, dict[str, Any]] = {}
    current = None
    for count, row in enumerate(row for row in reader if any(cell.strip() for cell in row)):
        where = f'{path}, line {reader.line_num}'
        if count >= MAX_ROWS:
            raise InputError(f'there are more than {MAX_ROWS} way-points', where, 'thin them out')
        if len(row) != len(columns):
            raise InputError(f'there are {len(row)} values', where,
                             f'give {len(columns)}, one for each column')
        cells = {name: cell.strip() for name, cell in zip(columns, row, strict=True)}
        lane = _id(cells['lane'], where)
        if lane != current and lane in points:
            raise InputError(f'lane {lane} goes on after another lane', where,
                             'put the way-points of one lane below each other')
        current = lane
        points.setdefault(lane, []).append([_number(cells, name, where) for name in _NUMBERS])
        if lane not in first:
            first[lane], links[lane] = reader.line_num, _links(cells, where)
        elif any(cells.get(name) for name in _LISTS + _SINGLE):
            raise InputError(f'links of lane {lane} stand at another row than its first', where,
                             'give them at the first way-point of the lane')
    if not points:
        raise InputError('there are no way-points', path, 'give two for each lane at least')
    for lane, entries in points.items():
        if len(entries) < 2:
            raise InputError(f'lane {lane} has one way-point', f'{path}, line {first[lane]}',
                             'give two at least')
    return {lane: LaneRows(first[lane], np.array(entries), links[lane])
            for lane, entries in points.items()}


def _header(row: list[str], path: str) -> list[str]:
    columns = [cell.strip() for cell in row]
    where = f'{path}, line 1'
    for name in ('lane', *_NUMBERS):
        if name not in columns:
            raise InputError(f'there is no column "{name}"', where,
                             'the first line is lane,x,y,width,speed_limit')
    for name in columns:
        if name not in ('lane', *_NUMBERS, *_LISTS, *_SINGLE):
            raise InputError(f'the column {short(name)} is unknown', where,
                             'known are lane, ' + ', '.join(_NUMBERS + _LISTS + _SINGLE))
        if columns.count(name) > 1:
            raise InputError(f'there are two columns "{name}"', where, 'leave one out')
    return columns


def _number(cells: Mapping[str, str], name: str, where: str) -> float:
    text = cells[name]
    if name == 'speed_limit' and not text:
        return math.inf
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise InputError(f'"{name}" is {short(text)}', where, 'give a finite number')
    if name == 'width' and value < 0.0 or name == 'speed_limit' and value <= 0.0:
        raise InputError(f'"{name}" is {short(text)}', where, 'give a positive number')
    return value


def _id(text: str, where: str) -> int:
    if not (text.isascii() and text.isdigit() and len(text) < 20 and int(text) <= _MAX_ID):
        raise InputError(f'{short(text)} is no lane', where, 'give a whole number from 0 on')
    return int(text)


def _links(cells: Mapping[str, str], where: str) -> dict[str, object]:
    links: dict[str, object] = {
        name: tuple(_id(item, where) for item in cells.get(name, '').split()) for name in _LISTS}
    for name in _SINGLE:
        text = cells.get(name, '')
        links[name] = _id(text, where) if text else None
    return links


def write_lane_rows(path: Path, lanes: Mapping[int, LaneRows]) -> None:
    """
    Write a table of way-points that `read_lane_rows` can read; numbers keep every bit.

    :raises InputError: if the file cannot be written.
    """
    text = io.StringIO()
    writer = csv.writer(text, lineterminator='\n')
    writer.writerow(('lane', *_NUMBERS, *_LISTS, *_SINGLE))
    for lane, entry in lanes.items():
        links = [' '.join(map(str, entry.links[name])) for name in _LISTS]
        links += ['' if entry.links[name] is None else str(entry.links[name])
                  for name in _SINGLE]
        for row in entry.points.tolist():
            limit = row[3] if math.isfinite(row[3]) else ''
            writer.writerow((lane, *row[:3], limit, *links))
            links = [''] * len(links)
    write_text(text.getvalue(), path)
