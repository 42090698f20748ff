# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Finds one run in a recording: its documents, and the messages that belong to it."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

from crgame_ros.errors import InputError
from crgame_ros.game.documents import GAME, GameDocument, OBJECTS
from crgame_ros.game.objects import driven_and_others, ObjectDescription
from crgame_ros.recording.reader import BagReader
from crgame_ros.scenario.loading import scenario_digest

XML_TOPIC = '/scenario/xml'


class _Text(NamedTuple):
    """A recorded document with its log time [ns]."""

    log_time_ns: int
    text: str


@dataclass(frozen=True)
class Epoch:
    """
    One run of a recording, from one reset to the next.

    Every reset gets a later clock offset, so stamps distinguish the runs. Only where a restarted
    simulation began its clock anew, log times decide.

    :param game: its game.
    :param xml_text: its scenario.
    :param descriptions: all vehicles and objects that could appear in it, those driven first.
    :param from_log_ns: messages logged earlier belong to the run before, None if stamps decide.
    :param until_stamp_ns: clock offset of the next run, None without one or if log times decide.
    :param until_log_ns: messages logged from then on belong to the next run, None as above.
    """

    game: GameDocument
    xml_text: str
    descriptions: tuple[ObjectDescription, ...]
    from_log_ns: int | None
    until_stamp_ns: int | None
    until_log_ns: int | None

    @property
    def vehicle_ids(self) -> list[str]:
        """Return the ids of the driven vehicles."""
        return [item.id for item in self.game.vehicles]

    @property
    def object_ids(self) -> list[str]:
        """Return the ids of all other objects."""
        return [item.id for item in self.descriptions[len(self.game.vehicles):]]

    def holds(self, stamp_ns: int, log_time_ns: int) -> bool:
        """Return whether a message belongs to this run."""
        return (stamp_ns >= self.game.scheduler.clock_offset_ns
                and (self.from_log_ns is None or log_time_ns >= self.from_log_ns)
                and (self.until_stamp_ns is None or stamp_ns < self.until_stamp_ns)
                and (self.until_log_ns is None or log_time_ns < self.until_log_ns))


def epoch_numbers(reader: BagReader) -> tuple[int, ...]:
    """
    Return the epochs of a recording, in the order of the runs.

    :raises InputError: if a document is missing.
    """
    games = _games(_documents(reader)[GAME.topic], reader)
    return tuple(dict.fromkeys(game.epoch for _, game in games))


def read_epoch(reader: BagReader, number: int | None = None) -> Epoch:
    """
    Find the documents of one run in a recording.

    :param number: its epoch, None for the last run.
    :raises InputError: if a document or the epoch is not in the recording.
    """
    texts = _documents(reader)
    games = _games(texts[GAME.topic], reader)
    chosen = [index for index, (_, game) in enumerate(games)
              if number is None or game.epoch == number]
    if not chosen:
        known = ', '.join(str(game.epoch) for _, game in games)
        raise InputError(f'no epoch {number} in it', str(reader.path), f'it has {known}')
    index = chosen[-1]
    log_ns, game = games[index]
    before = games[index - 1] if index else None
    after = games[index + 1] if index + 1 < len(games) else None
    began_anew = before is not None and _offset(before[1]) >= _offset(game)
    clock_goes_on = after is not None and _offset(after[1]) > _offset(game)
    return Epoch(
        game, _scenario_of(game, texts[XML_TOPIC], reader),
        _objects_of(game, texts[OBJECTS.topic], log_ns, reader),
        log_ns if began_anew else None,
        _offset(after[1]) if after is not None and clock_goes_on else None,
        after[0] if after is not None and not clock_goes_on else None)


def _games(texts: Sequence[_Text], reader: BagReader) -> list[tuple[int, GameDocument]]:
    """Read the games with their log times; skip malformed ones."""
    found, refusal = [], None
    for log_ns, text in texts:
        try:
            found.append((log_ns, GAME.read(text)))
        except InputError as error:
            reader.foreign[GAME.topic] += 1
            refusal = error
    if refusal is not None and not found:
        raise InputError(refusal.what, f'{reader.path}, {refusal.where}',
                         'the recording is damaged; record again') from refusal
    return found


def _offset(game: GameDocument) -> int:
    return game.scheduler.clock_offset_ns


def _documents(reader: BagReader) -> dict[str, list[_Text]]:
    """Read every version of the documents, without immediate repetitions."""
    texts: dict[str, list[_Text]] = {GAME.topic: [], XML_TOPIC: [], OBJECTS.topic: []}
    for topic, _, log_time_ns, message in reader.readable(texts):
        texts[topic].append(_Text(log_time_ns, str(message.data)))
    for topic, found in texts.items():
        if not found:
            raise InputError(f'no {topic} in it', str(reader.path),
                             'record all topics, from before the start of the run')
        found[1:] = [later for earlier, later in pairwise(found) if later.text != earlier.text]
    return texts


def _scenario_of(game: GameDocument, texts: Sequence[_Text], reader: BagReader) -> str:
    for _, text in reversed(texts):
        if scenario_digest(text) == game.scenario_sha256:
            return text
    raise InputError(f'{XML_TOPIC} is that of another run', str(reader.path),
                     'record from before the start of the run')


def _objects_of(game: GameDocument, texts: Sequence[_Text], log_ns: int,
                reader: BagReader) -> tuple[ObjectDescription, ...]:
    """Return the object list that names the game's vehicles and was logged nearest to the game."""
    vehicles = [item.id for item in game.vehicles]
    for _, text in sorted(texts, key=lambda found: abs(found.log_time_ns - log_ns)):
        try:
            descriptions = OBJECTS.read(text)
        except InputError:
            reader.foreign[OBJECTS.topic] += 1
            continue
        driven, others = driven_and_others(descriptions)
        if [item.id for item in driven] == vehicles:
            return (*driven, *others)
    raise InputError(f'{OBJECTS.topic} is that of another run', str(reader.path),
                     'record from before the start of the run')
