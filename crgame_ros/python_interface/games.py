# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Reads games from files, and names the argument in refusals instead of the option."""

from collections.abc import Iterator
import contextlib
from os import fspath, PathLike
from pathlib import Path
from typing import TypeAlias

from crgame_ros.errors import InputError, short
from crgame_ros.game.game import Game
from crgame_ros.launcher.arguments import RunRequest
from crgame_ros.launcher.run_plan import effective_game
from crgame_ros.paths import default_game

_NAMES = {'--planner': 'planner', '--driver': 'driver', '--problem': 'problems',
          '--rate': 'rate_hz', '--duration': 'duration_s'}


@contextlib.contextmanager
def argument_names() -> Iterator[None]:
    """Rewrite errors to name the argument instead of the option."""
    try:
        yield
    except InputError as error:
        if error.where not in _NAMES:
            raise
        raise InputError(error.what, _NAMES[error.where], error.remedy) from error


FileName: TypeAlias = str | PathLike[str]


def load_game(path: FileName) -> Game:
    """
    Read a game file (YAML), or build a game from a CommonRoad scenario (XML) as `--scenario` does.

    The games of this package have names, such as `cut_in`. Use `dataclasses.replace` to change
    one.

    :raises InputError: naming the file, the key and the remedy.
    """
    return effective_game(RunRequest(game=as_path(path, 'game')))


def as_game(game: Game | FileName | None) -> Game:
    """
    Return a game, or read one from a file; None is the cut-in.

    :raises InputError: as `load_game`.
    """
    if isinstance(game, Game):
        return game
    return load_game(default_game() if game is None else game)


def as_path(path: object, where: str) -> Path:
    """
    Return a path.

    :param where: name of the argument.
    :raises InputError: if it is not a path.
    """
    if isinstance(path, str | PathLike) and isinstance(text := fspath(path), str) and text:
        return Path(text).expanduser()
    raise InputError(f'is {short(path)}', where, 'give the name of a file or folder')
