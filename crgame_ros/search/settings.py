# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What a search looks for, and with how many runs."""

from dataclasses import asdict, dataclass, field
import json
from pathlib import Path
from typing import Any, Literal, Self

from crgame_ros.errors import InputError
from crgame_ros.evaluation.file_names import SEARCH_FILE
from crgame_ros.whole_file import write_text

Sampler = Literal['tpe', 'cmaes', 'nsga2', 'random']
FORMAT = 1
# Shares of the budget; the rest explores.
BOUNDARY, SMALLEST, PROBABILITY = 0.2, 0.05, 0.25


@dataclass(frozen=True)
class Goal:
    """
    A measure to make as small or as large as possible.

    :param measure: its name, as in expectations.
    :param sign: 1 to minimise it, -1 to maximise it.
    """

    measure: str
    sign: int

    @property
    def told(self) -> str:
        """Return it in words."""
        return f'{"least" if self.sign > 0 else "greatest"} {self.measure}'


@dataclass(frozen=True)
class SearchSettings:
    """
    The settings of a search.

    :param game: path of the game file.
    :param goals: measures to minimise or maximise; several by NSGA-II.
    :param planner: planner of all AVs; empty for the game's own.
    :param options: of this planner.
    :param budget: number of runs.
    :param batch: number of variants that are chosen together.
    :param seed: of the search.
    :param sampler: of Optuna, that explores.
    :param explore_only: whether all runs explore.
    :param unavoidable: whether contacts count of which the AV cannot be blamed.
    """

    game: str
    goals: tuple[Goal, ...]
    planner: str = ''
    options: dict[str, object] = field(default_factory=dict)
    budget: int = 500
    batch: int = 4
    seed: int = 0
    sampler: Sampler = 'tpe'
    explore_only: bool = False
    unavoidable: bool = False

    def share(self, part: float) -> int:
        """Return the number of runs of a part of the search."""
        return 0 if self.explore_only else round(part * self.budget)

    def write(self, folder: Path) -> None:
        """
        Write the settings into the folder of the search.

        :raises InputError: if another search is there, or it cannot be written.
        """
        path = folder / SEARCH_FILE
        if path.exists():
            if self.read(folder) != self:
                raise InputError('another search is in it', str(folder),
                                 f'go on with it: crgame search {folder}; or name another --out')
            return
        write_text(json.dumps({'format': FORMAT, **asdict(self)}, indent=1) + '\n', path)

    @classmethod
    def read(cls, folder: Path) -> Self:
        """
        Read the settings of the search in a folder.

        :raises InputError: if there is none.
        """
        path = folder / SEARCH_FILE
        try:
            values: dict[str, Any] = json.loads(path.read_bytes())
            if values.pop('format') != FORMAT:
                raise InputError('is of another format', str(path),
                                 'use the version that wrote it')
            goals = tuple(Goal(**goal) for goal in values.pop('goals'))
            return cls(goals=goals, **values)
        except OSError as error:
            raise InputError(f'holds no search ({error.strerror})', str(folder),
                             'name a game, or the folder of a search') from error
        except (ValueError, LookupError, TypeError) as error:
            raise InputError('is damaged', str(path), 'search again in another folder') from error
