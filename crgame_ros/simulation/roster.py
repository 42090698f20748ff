# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The participants of a game that decide which processes a run needs."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

from crgame_ros.simulation.setup import Setup


@dataclass(frozen=True)
class Participants:
    """
    The parts of a game that need processes besides the simulation.

    :param humans: driver source by human.
    :param avs: planner by AV.
    :param perceiving: AVs with perception.
    :param traffic: whether there are agents.
    :param occupancy: whether there is a map of permanent obstacles.
    :param instruments: whether there are streams or triggers.
    :param code: class names in the game from the user's own modules and files.
    """

    humans: dict[str, str]
    avs: dict[str, str]
    perceiving: tuple[str, ...] = ()
    traffic: bool = False
    occupancy: bool = False
    instruments: bool = False
    code: tuple[str, ...] = ()

    @classmethod
    def from_setup(cls, setup: Setup) -> 'Participants':
        """Read the participants from a setup."""
        return cls({human.id: human.driver for human in setup.humans},
                   {av.id: av.spec.planner for av in setup.avs},
                   tuple(av.id for av in setup.avs if av.spec.perception is not None),
                   setup.traffic is not None, setup.game.occupancy is not None,
                   setup.game.instruments is not None,
                   tuple(sorted(_code(asdict(setup.game)))))

    @classmethod
    def read(cls, content: dict[str, Any]) -> 'Participants':
        """Read the participants from the output of `dataclasses.asdict`, by way of JSON."""
        return cls(**content | {'perceiving': tuple(content['perceiving']),
                                'code': tuple(content['code'])})


def _code(value: object) -> set[str]:
    """Collect all class names anywhere in a game."""
    if isinstance(value, str):
        return {value} if ':' in value else set()
    if isinstance(value, Mapping):
        value = value.values()
    elif not isinstance(value, list | tuple):
        return set()
    return {name for item in value for name in _code(item)}
