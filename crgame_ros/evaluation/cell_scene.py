# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The scene of a cell: a game with all files that it names, ready for transfer to workers."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
import io
import json
import os
from pathlib import Path
import re
from typing import Any

from crgame_ros.driver.source import parse_source
from crgame_ros.errors import InputError, refusing
from crgame_ros.evaluation.content import Content, ContentStore
from crgame_ros.evaluation.source_digest import code_neighbours, MOST_BYTES, planner_digest
from crgame_ros.game.game import Game, load_game
from crgame_ros.game.variation_spec import Dimension, EXPECT, VARY
from crgame_ros.occupancy.map_file import read_map_file
from crgame_ros.paths import expanded
from crgame_ros.recording.recorded_game import (
    read_recorded_game,
    read_run_events,
    with_recorded_events,
)
from crgame_ros.recording.run_cycles import replay_inputs, ReplayInputs
from crgame_ros.recording.run_folder import BAG, folder_name, participant_folder, recording_in
from crgame_ros.scenario import guard
from crgame_ros.scenario.loading import load_scenario, LoadedScenario
from crgame_ros.schema.writing import write
from crgame_ros.simulation.av_assignment import assign_avs
from crgame_ros.variation.space import space_of
import numpy as np

# Text for people can look like a file's name without being one.
_FOR_PEOPLE = ('title', 'label', 'name')
# Drivers that need no person: without a page, `auto` is an idle driver.
_DRIVES_ALONE = ('idle', 'auto')
_FILE = re.compile(r'([a-z]+:)?(/[^\0]+?)(:[A-Za-z_]\w*)?')
_RELATIVE = re.compile(r'([a-z]+:)?([^\0:]+)(:[A-Za-z_]\w*)?')
INPUTS = 'inputs.npz'
SCENARIO_SUFFIXES, GAME_SUFFIXES = ('.xml',), ('.yaml', '.yml')


@dataclass(frozen=True)
class CellScene:
    """
    A game whose files are in a store.

    :param scenario: benchmark id, with the file's name where two files have that id.
    :param game: name of the game's file; empty where there is none.
    :param human: name of the recorded run whose humans drive; empty where there is none.
    :param participant: label of the study's participant who drove it; empty outside a study.
    :param values: values of the game, as in its file; files are references to contents.
    :param inputs: digest of the recorded humans' inputs; empty without recorded humans.
    :param digests: digests of the code of its AVs' planners.
    :param variants: values of what varies in it; none runs the game as it is.
    """

    scenario: str
    game: str
    human: str
    values: dict[str, object]
    inputs: str
    digests: tuple[str, ...]
    participant: str = ''
    variants: tuple[Mapping[str, object], ...] = ()

    @property
    def label(self) -> str:
        """Return a name for people, unique in an evaluation."""
        return self.human or self.game or self.scenario

    def cells(self) -> Iterator[tuple[str, dict[str, object]]]:
        """Yield each variant as JSON, with the values of its game; one empty if none varies."""
        if not self.variants:
            yield '', {key: value for key, value in self.values.items()
                       if key not in (VARY, EXPECT)}
            return
        space = space_of(self.values, self.label)
        for variant in self.variants:
            yield variant_text(variant), space.game_values(variant)


def scene_of_game(path: Path, store: ContentStore) -> CellScene:
    """
    Build the scene of a game, and copy its files into a store.

    :raises InputError: if the game or one of its files cannot be used.
    """
    game = load_game(path)
    for human in game.humans:
        source = parse_source(human.driver)
        if source.kind not in _DRIVES_ALONE and not source.has_timeline:
            raise InputError(f'driver "{human.driver}" needs a person or a recording',
                             f'{path}: {human.id}', 'use keys:FILE, joy:FILE or idle, or name '
                             'recorded runs under "humans"')
    loaded = load_scenario(game.scenario)
    vary = tuple(replace(entry, values=tuple(_absolute(value, game.base)
                                             for value in entry.values))
                 if isinstance(entry, Dimension) else entry for entry in game.vary)
    return _scene(replace(game, vary=vary), loaded, store, game_name=path.stem)


def _absolute(value: object, base: Path) -> object:
    """Return a possible value of a key, its file's name absolute."""
    match = _RELATIVE.fullmatch(value) if isinstance(value, str) else None
    if match is None or not (base / match[2]).is_file():
        return value
    return f'{match[1] or ""}{(base / match[2]).resolve()}{match[3] or ""}'


def variant_text(variant: Mapping[str, object]) -> str:
    """Return the values of a variant as JSON."""
    return json.dumps(dict(variant), separators=(', ', ': '), sort_keys=True)


def scene_of_scenario(path: Path, store: ContentStore) -> CellScene:
    """
    Build the scene of a scenario in which only AVs are driven, and copy its file into a store.

    :raises InputError: if it cannot be used.
    """
    game = Game(path.resolve(), humans=())
    return _scene(game, load_scenario(path), store)


def scene_of_run(path: Path, store: ContentStore, until_take_over: bool = False) -> CellScene:
    """
    Build the scene of a recorded run: copy its game and its humans' inputs into a store.

    :param path: folder of the run, or its recording.
    :param until_take_over: whether the run ends where a person took over an AV, if one did;
        nobody else needs to drive then.
    :raises InputError: if the recording cannot be repeated.
    """
    bag = recording_in(path)
    recorded = read_recorded_game(bag, other_planners=True)
    if not recorded.game.humans and not until_take_over:
        raise InputError('no vehicle was driven in it', str(path),
                         'name its game or scenario instead')
    inputs = replay_inputs(bag)
    if until_take_over:
        inputs = before_take_over(inputs, [human.id for human in recorded.game.humans], path)
    game = with_recorded_events(recorded.game, read_run_events(bag).fired)
    humans = tuple(replace(human, driver='idle') for human in game.humans)
    duration_s = len(inputs.dt_eff_s) / game.timing.rate
    stream = io.BytesIO()
    arrays: dict[str, Any] = {f'command_{name}': rows for name, rows in inputs.commands.items()}
    np.savez_compressed(stream, intervals_s=inputs.dt_eff_s, **arrays)
    digest = store.put(Content(INPUTS, {INPUTS: stream.getvalue()}))
    return _scene(replace(game, humans=humans, duration=min(game.duration, duration_s)),
                  recorded.loaded, store, human=folder_name(path), inputs=digest)


def before_take_over(inputs: ReplayInputs, humans: Sequence[str], path: Path) -> ReplayInputs:
    """
    Return the inputs of the humans until a person took over an AV; all of them if nobody did.

    :param humans: ids of the driven vehicles.
    :param path: of the run, for messages.
    :raises InputError: if an AV was driven by a person from the beginning.
    """
    first = len(inputs.dt_eff_s)
    for name, rows in inputs.commands.items():
        if name not in humans:
            first = min(first, int(np.argmax(~np.isnan(rows[:, 0]))))
    if first == 0:
        raise InputError('a person drove the AV from the beginning', str(path), 'leave it out')
    return ReplayInputs({name: rows[:first] for name, rows in inputs.commands.items()
                         if name in humans}, inputs.dt_eff_s[:first])


def participant_labels(runs: Sequence[Path]) -> list[str]:
    """
    Return labels of the participants who drove recorded runs, unique among all studies.

    :param runs: recorded runs; those of no study get an empty label.
    """
    folders = [participant_folder(run) for run in runs]
    studies = [folder.parents[1] for folder in folders if folder is not None]
    common = Path(os.path.commonpath(studies)) if studies else Path()
    return ['' if folder is None else
            (folder.parents[1].relative_to(common) / folder.name).as_posix()
            for folder in folders]


def _scene(game: Game, loaded: LoadedScenario, store: ContentStore, *, game_name: str = '',
           human: str = '', inputs: str = '') -> CellScene:
    parts, _ = assign_avs(game, loaded)
    game = replace(game, avs=tuple(spec for spec, _ in parts))
    digests = tuple(planner_digest(spec.planner) for spec in game.avs or ())
    return CellScene(loaded.benchmark_id, game_name, human, values_of_game(game, store, loaded),
                     inputs, digests)


def values_of_game(game: Game, store: ContentStore,
                   loaded: LoadedScenario | None = None) -> dict[str, object]:
    """
    Copy the files of a game into a store.

    :param loaded: its scenario, if it has been loaded already.
    :return: the values of the game's file, with references instead of file names.
    :raises InputError: if a file cannot be read.
    """
    values = write(game, game.base)
    loaded = load_scenario(game.scenario) if loaded is None else loaded
    scenario = Content('scenario.xml', {'scenario.xml': guard.encode(loaded.xml_text)})
    store.put(scenario)
    values['scenario'] = scenario.reference
    return with_contents(values, store)


def with_contents(value: object, store: ContentStore, key: str = '') -> Any:
    """
    Copy the files that values name into a store.

    :param value: mappings, lists and texts, their file names absolute.
    :return: the same, with references instead of names of files.
    :raises InputError: if a file cannot be read.
    """
    if isinstance(value, dict):
        return {name: with_contents(item, store, str(name)) for name, item in value.items()}
    if isinstance(value, list):
        return [with_contents(item, store, key) for item in value]
    if not isinstance(value, str) or key in _FOR_PEOPLE and '.py:' not in value:
        return value
    match = _FILE.fullmatch(value)
    if match is None or not Path(match[2]).is_file():
        return value
    file = Path(match[2])
    content = Content(file.name, dict(_files(file, key)))
    store.put(content)
    return f'{match[1] or ""}{content.reference}{match[3] or ""}'


def _files(file: Path, key: str) -> Iterator[tuple[str, bytes]]:
    """Yield a file, and the files of its folder that it names or imports, by their paths there."""
    files = [file]
    if key == 'occupancy':
        image = read_map_file(file).image
        if image.resolve().parent != file.resolve().parent:
            raise InputError('its image is in another folder', str(file),
                             'put it beside the map, so that both can travel')
        files.append(file.parent / image.name)
    files += code_neighbours(file)
    if sum(each.stat().st_size for each in files) > MOST_BYTES:
        raise InputError(f'has more than {MOST_BYTES // 2**20} MiB, with the files it imports',
                         str(file), 'install the planner where the workers are, and name it '
                         'module:Class')
    for each in files:
        with refusing('cannot be read', each, 'check the path'):
            yield each.relative_to(file.parent).as_posix(), each.read_bytes()


def files_of(names: tuple[str, ...], base: Path, suffixes: tuple[str, ...],
             what: str) -> list[Path]:
    """
    Find the files that a plan names.

    :param names: names of files, or of folders: these stand for all their files with such a
        suffix, in alphabetical order.
    :raises InputError: if there is none.
    """
    found: list[Path] = []
    for name in names:
        path = base / expanded(name)
        if path.is_dir():
            inside = sorted(item for item in path.iterdir() if item.suffix in suffixes)
            if not inside:
                raise InputError(f'there is no {what} in it', str(path), 'name another folder')
            found += inside
        elif path.exists():
            found.append(path)
        else:
            raise InputError('there is no such file or folder', str(path), 'check the path')
    return list(dict.fromkeys(found))


def runs_of(names: tuple[str, ...], base: Path) -> list[Path]:
    """
    Find the recorded runs that a plan names.

    :param names: names of runs' folders or recordings, or of folders of runs.
    :raises InputError: if there is none.
    """
    found: list[Path] = []
    for name in names:
        path = base / expanded(name)
        inside = sorted(item.parent for item in path.glob(f'*/{BAG}'))
        if not path.exists():
            raise InputError('there is no such file or folder', str(path), 'check the path')
        found += inside if inside and not (path / BAG).exists() else [path]
    return list(dict.fromkeys(found))
