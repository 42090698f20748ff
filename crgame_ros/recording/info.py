# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Describes the contents of a recording."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from crgame_ros.errors import InputError
from crgame_ros.game.documents import GAME
from crgame_ros.game.game import MAX_VEHICLES
from crgame_ros.recording.metadata import BagTopic
from crgame_ros.recording.reader import BagReader
from crgame_ros.recording.standard_messages import TABLE, TEXT
from crgame_ros.schema.document_marks import Bounded
from crgame_ros.schema.json_documents import JsonDocument
from crgame_ros.timing.cycle_rows import CYCLE_TOPIC
import numpy as np
import numpy.typing as npt

_GAPS_SHOWN = 5
# Integers up to this are exact in a float.
_LARGEST_N = 2 ** 53


@dataclass(frozen=True)
class Gap:
    """Cycles `first_n` to `last_n` of an epoch that were not recorded."""

    epoch: int
    first_n: int
    last_n: int

    @property
    def missing(self) -> int:
        """Return the number of cycles that are missing."""
        return self.last_n - self.first_n + 1


@dataclass(frozen=True)
class CycleInfo:
    """The recorded cycles: their number, and the gaps between the first and the last."""

    recorded: int
    gaps: tuple[Gap, ...]

    @property
    def missing(self) -> int:
        """Return the number of cycles that are missing."""
        return sum(gap.missing for gap in self.gaps)


@dataclass(frozen=True)
class _Human:
    id: str  # noqa: A003
    driver: str


@dataclass(frozen=True)
class _Av:
    id: str  # noqa: A003
    planner: str


@dataclass(frozen=True)
class GameInfo:
    """The part of the game document that other versions of this program write as well."""

    benchmark_id: str
    humans: Annotated[tuple[_Human, ...], Bounded(MAX_VEHICLES)]
    avs: Annotated[tuple[_Av, ...], Bounded(MAX_VEHICLES)]


_GAME: JsonDocument[GameInfo] = JsonDocument(
    GameInfo, GAME.topic, 'game of this program', 'record it again with the present version')


@dataclass(frozen=True)
class BagInfo:
    """
    A recording at a glance; times are log times [ns].

    :param duration_s: the time from the first to the last message [s]
    :param cycles: None if `/timing/cycle` was not recorded.
    :param game: None if `/scenario/game` was not recorded.
    """

    path: Path
    files: tuple[Path, ...]
    storage: str
    size_bytes: int
    start_ns: int
    end_ns: int
    duration_s: float
    complete: bool
    notices: tuple[str, ...]
    topics: tuple[BagTopic, ...]
    message_count: int
    game: GameInfo | None
    cycles: CycleInfo | None

    def rate_hz(self, topic: BagTopic) -> float | None:
        """Return a topic's rate over the whole recording; None for fewer than two messages."""
        several = topic.message_count > 1 and self.duration_s > 0
        return (topic.message_count - 1) / self.duration_s if several else None


def describe(path: Path) -> BagInfo:
    """
    Return a summary of a recording.

    :param path: as for `BagReader`.
    :raises InputError: if it cannot be read, or its game or cycles are malformed.
    """
    with BagReader(path) as reader:
        return BagInfo(
            path, reader.files, reader.storage, sum(file.stat().st_size for file in reader.files),
            reader.start_ns, reader.end_ns, reader.duration_s, reader.complete, reader.notices,
            tuple(reader.topics.values()), reader.message_count, _read_game(reader),
            _read_cycles(reader))


def _read_game(reader: BagReader) -> GameInfo | None:
    if not reader.holds(GAME.topic, TEXT):
        return None
    latched = reader.latched(GAME.topic)
    try:
        return _GAME.read(latched.message.data if latched else '')
    except InputError as error:
        raise InputError(error.what, f'{reader.path}, {error.where}', error.remedy) from error


def _read_cycles(reader: BagReader) -> CycleInfo | None:
    found = list(_cycle_numbers(reader)) if reader.holds(CYCLE_TOPIC, TABLE) else []
    if not found:
        return None
    cycles = np.concatenate(found)
    return CycleInfo(len(cycles), tuple(_find_gaps(cycles)))


def _cycle_numbers(reader: BagReader) -> Iterator[npt.NDArray[np.int64]]:
    """Yield arrays of rows (epoch, n), without those of foreign messages."""
    refusal, found = None, False
    for _, _, _, message in reader.readable([CYCLE_TOPIC]):
        try:
            rows, columns = message.layout.dim
            names = columns.label.split(',')
            table = message.data.reshape(rows.size, len(names))
            picked = table[:, [names.index('epoch'), names.index('n')]]
        except ValueError as error:
            refusal = InputError(f'{CYCLE_TOPIC} is not as the contract has it ({error})',
                                 str(reader.path),
                                 'its second dimension names the columns, epoch and n among them')
            reader.foreign[CYCLE_TOPIC] += 1
            continue
        found = True
        yield picked[(np.abs(picked) < _LARGEST_N).all(axis=1)].astype(np.int64)
    if refusal is not None and not found:
        raise refusal


def _find_gaps(cycles: npt.NDArray[np.int64]) -> Iterator[Gap]:
    """Yield the gaps between the first and the last n of each epoch."""
    for epoch in np.unique(cycles[:, 0]):
        numbers = np.unique(cycles[cycles[:, 0] == epoch, 1])
        for index in np.flatnonzero(np.diff(numbers) > 1):
            yield Gap(int(epoch), int(numbers[index]) + 1, int(numbers[index + 1]) - 1)


def format_info(info: BagInfo) -> str:
    """Return the description of a recording as text of several lines."""
    lines = [
        f'recording  {info.path}',
        f'files      {", ".join(file.name for file in info.files)} ({info.storage}, '
        f'{info.size_bytes / 1e6:.1f} MB)',
        f'duration   {info.duration_s:.2f} s, from {info.start_ns / 1e9:.3f} s '
        f'to {info.end_ns / 1e9:.3f} s',
        f'messages   {info.message_count}',
        f'complete   {"yes" if info.complete else "no"}',
        *(f'           {notice}' for notice in info.notices)]
    if info.game is not None:
        lines += [f'scenario   {info.game.benchmark_id}',
                  f'humans     {_drivers((item.id, item.driver) for item in info.game.humans)}',
                  f'avs        {_drivers((item.id, item.planner) for item in info.game.avs)}']
    if info.cycles is not None:
        lines += _format_cycles(info.cycles)
    return '\n'.join([*lines, '', *_format_topics(info)])


def _drivers(pairs: Iterable[tuple[str, str]]) -> str:
    return ', '.join(f'{vehicle} ({driver})' for vehicle, driver in pairs) or 'none'


def _format_cycles(cycles: CycleInfo) -> list[str]:
    lines = [f'cycles     {cycles.recorded} recorded, {cycles.missing} missing']
    lines += [f'           epoch {gap.epoch}: n = {gap.first_n} to {gap.last_n} missing'
              for gap in cycles.gaps[:_GAPS_SHOWN]]
    if len(cycles.gaps) > _GAPS_SHOWN:
        lines.append(f'           and {len(cycles.gaps) - _GAPS_SHOWN} more gaps')
    return lines


def _format_topics(info: BagInfo) -> list[str]:
    table = [('topic', 'type', 'messages', 'Hz', 'QoS')]
    table += [(topic.name, topic.type_name, str(topic.message_count),
               '-' if (rate_hz := info.rate_hz(topic)) is None else f'{rate_hz:.1f}',
               '; '.join(f'{qos.reliability} {qos.durability} {qos.depth}'
                         for qos in topic.qos) or '-') for topic in info.topics]
    widths = [max(len(row[column]) for row in table) for column in range(4)]
    return [f'{row[0]:<{widths[0]}}  {row[1]:<{widths[1]}}  {row[2]:>{widths[2]}}  '
            f'{row[3]:>{widths[3]}}  {row[4]}'.rstrip() for row in table]
