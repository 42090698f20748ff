# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The scenes of an environment: one game, or a folder of them with a train and a test split."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from hashlib import sha256
from pathlib import Path

from crgame_ros.errors import InputError, refusing
from crgame_ros.game.game import Game, HumanSpec, load_game
from crgame_ros.gym.episode_options import game_at
from crgame_ros.gym.episode_setups import EpisodeSetups, StartVariation
from crgame_ros.library.lookup import find_scenario
from crgame_ros.library.stored_index import id_in_file
from crgame_ros.paths import expanded, scenarios_directory
import numpy as np

SPLITS = ('train', 'test', 'all')
TEST_SHARE = 0.2
# Scenes whose roads, routes and traffic stay in memory.
_KEPT = 8


@dataclass(frozen=True)
class Scenes:
    """
    The scenes of an environment.

    :param names: sorted names.
    :param load: returns the game of a name.
    """

    names: tuple[str, ...]
    load: Callable[[str], Game]

    def pick(self, seed: int) -> str:
        """Return the scene of an episode; equal seeds give equal scenes."""
        if len(self.names) == 1:
            return self.names[0]
        return self.names[int(np.random.Generator(np.random.PCG64((seed, 1))).integers(
            len(self.names)))]

    def check(self, name: str) -> None:
        """
        Check that there is a scene of this name.

        :raises InputError: if there is none.
        """
        if name not in self.names:
            shown = ', '.join(self.names[:5]) + (', …' if len(self.names) > 5 else '')
            raise InputError(f'there is no scene "{name}"', 'options of reset', f'use {shown}')


def is_for_test(name: str, test_share: float) -> bool:
    """
    Return whether a scene belongs to the test split.

    This depends on the scene's name alone: SHA-256 makes a number in [0, 1) of it. Therefore no
    scene changes sides if others are added or removed, and a larger share keeps the scenes of a
    smaller one.
    """
    number = int.from_bytes(sha256(name.encode()).digest()[:8], 'big') / 2.0 ** 64
    return number < test_share


def one_scene(game: Game | Path | str | None, scenario: Path | str | None,
              seats: Sequence[str]) -> Scenes:
    """
    Return the only scene of an environment.

    :param game: a game, its file, or the name of a shipped one, such as `cut_in`.
    :param scenario: a CommonRoad file, or a benchmark id, instead.
    :raises InputError: if the file cannot be read.
    """
    if scenario is not None:
        chosen = scenario_game(find_scenario(expanded(scenario)), seats)
    elif isinstance(game, Game):
        chosen = game
    else:
        assert game is not None
        path = _file(game)
        chosen = load_game(path)
        return Scenes((path.name,), lambda _: chosen)
    return Scenes((Path(chosen.scenario).name,), lambda _: chosen)


def folder_scenes(folder: Path | str, split: str, test_share: float,
                  seats: Sequence[str]) -> Scenes:
    """
    Return the scenes of a folder.

    These are its game files (*.yaml; not those with a second ending, such as timelines) and its
    CommonRoad files (*.xml) that none of the game files names.

    :param split: `train`, `test` or `all`.
    :param test_share: share of the scenes in the test split, about.
    :raises InputError: if there are no scenes, or a file is neither.
    """
    if split not in SPLITS:
        raise InputError(f'"split" is {split!r}', 'environment', 'use one of ' + ', '.join(SPLITS))
    if not 0.0 <= test_share <= 1.0:
        raise InputError(f'"test_share" is {test_share!r}', 'environment',
                         'give a share from 0 to 1')
    folder = expanded(folder)
    if not folder.is_dir():
        raise InputError('there is no such folder', str(folder), 'name a folder of scenes')
    games = {path.name: load_game(path) for path in sorted(folder.iterdir())
             if path.suffix in ('.yaml', '.yml') and '.' not in path.stem}
    used = {game.scenario.resolve() for game in games.values()}
    alone = [path for path in sorted(folder.glob('*.xml')) if path.resolve() not in used]
    for path in alone:
        _check_head(path)
    every = (*games, *(path.name for path in alone))
    names = sorted(name for name in every
                   if split == 'all' or is_for_test(name, test_share) == (split == 'test'))
    if not names:
        raise InputError(f'has {len(every)} scenes, none of them in the split "{split}"'
                         if every else 'has no scenes', str(folder),
                         'change the split or "test_share"' if every else
                         'put game files (.yaml) or CommonRoad files (.xml) into it')

    def load(name: str) -> Game:
        return games[name] if name in games else scenario_game(folder / name, seats)

    return Scenes(tuple(names), load)


def scenario_game(path: Path, seats: Sequence[str]) -> Game:
    """Return the game of a CommonRoad file alone: the only humans are agents."""
    return Game(path, humans=tuple(
        HumanSpec(seat, 'idle') for seat in seats if seat.startswith('hv')))


def adapted(game: Game, drivers: Mapping[str, str], planners: Mapping[str, str],
            duration: float | None) -> Game:
    """
    Return a game with replacements.

    :param drivers: driver sources that replace the game's, by human.
    :param planners: planners that replace the game's, by AV.
    :param duration: time until an episode is truncated, instead of the game's [s]
    :raises InputError: if the game has no such vehicle.
    """
    game = replace(game, humans=tuple(
        replace(human, driver=drivers.get(human.id, human.driver)) for human in game.humans))
    if planners:
        if game.avs is None:
            raise InputError('the game does not list its AVs', 'planners',
                             'list them in a game file')
        game = replace(game, avs=tuple(
            replace(av, planner=planners[av.id], options={}) if av.id in planners else av
            for av in game.avs))
    known = {human.id for human in game.humans} | {av.id for av in game.avs or ()}
    for name in (*drivers, *planners):
        if name not in known:
            raise InputError(f'there is no "{name}" in the game', 'drivers or planners',
                             'use ' + ', '.join(sorted(known)))
    return game if duration is None else replace(game, duration=float(duration))


def _file(game: Path | str) -> Path:
    """Return the file of a game; a shipped one is found by its name."""
    shipped = scenarios_directory() / f'{game}.yaml'
    if isinstance(game, str) and '/' not in game and shipped.is_file():
        return shipped
    return expanded(game)


def _check_head(path: Path) -> None:
    with refusing('cannot be read', path, 'check the file'):
        found = id_in_file(path)
    if found is None:
        raise InputError('is no CommonRoad scenario', str(path), 'move it out of the folder')


class SceneSetups:
    """
    A store of the setups of an environment's scenes, which its games share.

    The scenes used last stay in memory.

    :param worlds: as for `EpisodeSetups`.
    """

    def __init__(self, scenes: Scenes, vary: StartVariation, worlds: int | None) -> None:
        self.scenes = scenes
        self._vary, self._worlds = vary, worlds
        self._plain = lru_cache(_KEPT)(self._make_plain)
        self._thinned = lru_cache(_KEPT)(self._at)

    def of(self, name: str, difficulty: float | None, seed: int) -> EpisodeSetups:
        """
        Return the setups of a scene at a difficulty.

        :param seed: of the episode, for what the game's `vary:` lists.
        :raises InputError: naming the file, if it cannot be used.
        """
        plain = self._plain(name)
        if difficulty is None:
            return plain
        # Of what `vary:` lists, each seed has a variant of its own.
        return self._at(name, difficulty, seed) if plain.base.game.vary \
            else self._thinned(name, difficulty)

    def _make_plain(self, name: str) -> EpisodeSetups:
        return EpisodeSetups(self.scenes.load(name), self._vary, self._worlds)

    def _at(self, name: str, difficulty: float, seed: int = 0) -> EpisodeSetups:
        plain = self._plain(name)
        given = plain.base.game
        game = game_at(given, difficulty, seed)
        if game == given:
            return plain
        loaded = plain.base.loaded if game.scenario == given.scenario else None
        return EpisodeSetups(game, self._vary, self._worlds, loaded)
