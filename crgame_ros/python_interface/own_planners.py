# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Planners given by name, as classes, or as objects."""

from collections.abc import Sequence
import inspect
from typing import Any, NamedTuple, TypeAlias

from crgame_ros.errors import InputError, short
from crgame_ros.planner.interface import Planner

PlannerLike: TypeAlias = str | type[Planner] | Planner


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
