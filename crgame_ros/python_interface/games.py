# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Games from files, and planners by name, class or object; refusals name the argument."""

from collections.abc import Iterator, Sequence
import contextlib
import inspect
from os import fspath, PathLike
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias

from crgame_ros.errors import InputError, short
from crgame_ros.game.game import Game
from crgame_ros.launcher.arguments import RunRequest
from crgame_ros.launcher.run_plan import effective_game
from crgame_ros.paths import default_game, expanded
from crgame_ros.planner.interface import Planner

_NAMES = {'--planner': 'planner', '--driver': 'driver', '--problem': 'problems',
          '--rate': 'rate_hz', '--duration': 'duration_s'}
PlannerLike: TypeAlias = str | type[Planner] | Planner


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
        return expanded(text)
    raise InputError(f'is {short(path)}', where, 'give the name of a file or folder')


class NamedPlanners(NamedTuple):
    """
    Planners under names for a game.

    :param names: one for all AVs, or one for each; empty for those of the game.
    :param own: the planners by those names that are not in the registry.
    """

    names: tuple[str, ...]
    own: dict[str, type[Planner] | Planner]

    def check_objects(self, avs: int) -> None:
        """
        Refuse one object for several AVs: its state for one is wrong for another.

        :param avs: their number.
        """
        for name in self.names:
            self.check_object(name, avs if len(self.names) == 1 else self.names.count(name))

    def check_object(self, name: str, avs: int) -> None:
        """
        Refuse a planner object for several AVs.

        :param avs: their number.
        """
        if avs > 1 and not inspect.isclass(self.own.get(name, type)):
            raise InputError(f'is one object for {avs} AVs', f'planner {name}',
                             'give its class, or an object for each')


def name_planners(planners: PlannerLike | Sequence[PlannerLike] | None) -> NamedPlanners:
    """
    Return names for planners: `module:Class` for a class, as in a game file; likewise for objects.

    :raises InputError: if something is not a planner.
    """
    if planners is None:
        return NamedPlanners((), {})
    several: Sequence[Any] = planners if isinstance(planners, list | tuple) else [planners]
    names: list[str] = []
    own: dict[str, type[Planner] | Planner] = {}
    for planner in several:
        if isinstance(planner, str):
            names.append(planner)
            continue
        kind = planner if inspect.isclass(planner) else type(planner)
        if not issubclass(kind, Planner):
            raise InputError(f'is {short(planner)}', 'planner', 'give a name, or a class derived '
                             'from crgame_ros.Planner, or an object of one')
        whole = wanted = f'{kind.__module__}:{kind.__qualname__}'
        number = 1
        while own.get(whole, planner) is not planner:
            number += 1
            whole = f'{wanted}#{number}'
        own[whole] = planner
        names.append(whole)
    return NamedPlanners(tuple(names), own)
