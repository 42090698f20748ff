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
from crgame_ros.schema.document_marks import Bounded
from crgame_ros.schema.json_documents import JsonDocument
import numpy as np
import numpy.typing as npt

_GAME_TYPE = 'std_msgs/msg/String'
_CYCLE_TOPIC = '/timing/cycle'
_CYCLE_TYPE = 'std_msgs/msg/Float64MultiArray'
_GAPS_SHOWN = 5
# Integers up to this are exact in a float.
_LARGEST_N = 2 ** 53


@dataclass(frozen=True)
class TopicInfo:
    """A topic; `rate_hz` is over the whole recording, None for fewer than two messages."""

    topic: BagTopic
    rate_hz: float | None


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
class GameInfo:
    """The game that was played: vehicle id and what drives it, for humans and for AVs."""

    benchmark_id: str
    humans: tuple[tuple[str, str], ...]
    avs: tuple[tuple[str, str], ...]


@dataclass(frozen=True)
class _Human:
    id: str  # noqa: A003
    driver: str


@dataclass(frozen=True)
class _Av:
    id: str  # noqa: A003
    planner: str


@dataclass(frozen=True)
class _Game:
    """The part of the game document that other versions of this program write as well."""

    benchmark_id: str
    humans: Annotated[tuple[_Human, ...], Bounded(MAX_VEHICLES)]
    avs: Annotated[tuple[_Av, ...], Bounded(MAX_VEHICLES)]


_GAME: JsonDocument[_Game] = JsonDocument(
    _Game, GAME.topic, 'game of this program', 'record it again with the present version')


@dataclass(frozen=True)
class BagInfo:
    """
    A recording at a glance; times are log times [ns].

    :param cycles: None if `/timing/cycle` was not recorded.
    :param game: None if `/scenario/game` was not recorded.
    """

    path: Path
    files: tuple[Path, ...]
    storage: str
    size_bytes: int
    start_ns: int
    end_ns: int
    complete: bool
    notices: tuple[str, ...]
    topics: tuple[TopicInfo, ...]
    game: GameInfo | None
    cycles: CycleInfo | None

    @property
    def duration_s(self) -> float:
        """Return the time from the first to the last message [s]."""
        return (self.end_ns - self.start_ns) / 1e9

    @property
    def message_count(self) -> int:
        """Return the number of messages of all topics."""
        return sum(entry.topic.message_count for entry in self.topics)


def describe(path: Path) -> BagInfo:
    """
    Return a summary of a recording.

    :param path: as for `BagReader`.
    :raises InputError: if it cannot be read, or its game or cycles are malformed.
    """
    with BagReader(path) as reader:
        duration_s = (reader.end_ns - reader.start_ns) / 1e9
        return BagInfo(
            path=path, files=reader.files, storage=reader.storage,
            size_bytes=sum(file.stat().st_size for file in reader.files),
            start_ns=reader.start_ns, end_ns=reader.end_ns,
            complete=reader.complete, notices=reader.notices,
            topics=tuple(TopicInfo(topic, _rate_hz(topic.message_count, duration_s))
                         for topic in reader.topics.values()),
            game=_read_game(reader), cycles=_read_cycles(reader))


def _rate_hz(count: int, duration_s: float) -> float | None:
    return (count - 1) / duration_s if count > 1 and duration_s > 0 else None


def _holds(reader: BagReader, topic: str, type_name: str) -> bool:
    found = reader.topics.get(topic)
    return found is not None and found.message_count > 0 and found.type_name == type_name


def _read_game(reader: BagReader) -> GameInfo | None:
    if not _holds(reader, GAME.topic, _GAME_TYPE):
        return None
    latched = reader.latched(GAME.topic)
    try:
        game = _GAME.read(latched.message.data if latched else '')
    except InputError as error:
        raise InputError(error.what, f'{reader.path}, {error.where}', error.remedy) from error
    return GameInfo(
        game.benchmark_id, tuple((human.id, human.driver) for human in game.humans),
        tuple((av.id, av.planner) for av in game.avs))


def _read_cycles(reader: BagReader) -> CycleInfo | None:
    if not _holds(reader, _CYCLE_TOPIC, _CYCLE_TYPE):
        return None
    found = list(_cycle_numbers(reader))
    if not found:
        return None
    cycles = np.concatenate(found)
    return CycleInfo(len(cycles), tuple(_find_gaps(cycles)))


def _cycle_numbers(reader: BagReader) -> Iterator[npt.NDArray[np.int64]]:
    """Yield arrays of rows (epoch, n), without those of foreign messages."""
    refusal, found = None, False
    for _, _, _, message in reader.readable([_CYCLE_TOPIC]):
        try:
            rows, columns = message.layout.dim
            names = columns.label.split(',')
            table = message.data.reshape(rows.size, len(names))
            picked = table[:, [names.index('epoch'), names.index('n')]]
        except ValueError as error:
            refusal = InputError(f'{_CYCLE_TOPIC} is not as the contract has it ({error})',
                                 str(reader.path),
                                 'its second dimension names the columns, epoch and n among them')
            reader.foreign[_CYCLE_TOPIC] += 1
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
                  f'humans     {_drivers(info.game.humans)}',
                  f'avs        {_drivers(info.game.avs)}']
    if info.cycles is not None:
        lines += _format_cycles(info.cycles)
    return '\n'.join([*lines, '', *_format_topics(info.topics)])


def _drivers(pairs: Iterable[tuple[str, str]]) -> str:
    return ', '.join(f'{vehicle} ({driver})' for vehicle, driver in pairs) or 'none'


def _format_cycles(cycles: CycleInfo) -> list[str]:
    lines = [f'cycles     {cycles.recorded} recorded, {cycles.missing} missing']
    lines += [f'           epoch {gap.epoch}: n = {gap.first_n} to {gap.last_n} missing'
              for gap in cycles.gaps[:_GAPS_SHOWN]]
    if len(cycles.gaps) > _GAPS_SHOWN:
        lines.append(f'           and {len(cycles.gaps) - _GAPS_SHOWN} more gaps')
    return lines


def _format_topics(topics: Iterable[TopicInfo]) -> list[str]:
    table = [('topic', 'type', 'messages', 'Hz', 'QoS')]
    table += [(entry.topic.name, entry.topic.type_name, str(entry.topic.message_count),
               '-' if entry.rate_hz is None else f'{entry.rate_hz:.1f}',
               '; '.join(f'{qos.reliability} {qos.durability} {qos.depth}'
                         for qos in entry.topic.qos) or '-') for entry in topics]
    widths = [max(len(row[column]) for row in table) for column in range(4)]
    return [f'{row[0]:<{widths[0]}}  {row[1]:<{widths[1]}}  {row[2]:>{widths[2]}}  '
            f'{row[3]:>{widths[3]}}  {row[4]}'.rstrip() for row in table]
