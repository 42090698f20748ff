# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""One run of an evaluation, with a key over everything that it depends on."""

from collections.abc import Mapping
from dataclasses import dataclass, fields
from functools import cached_property
import hashlib
import json
from typing import Any, NamedTuple

from crgame_ros.evaluation.content import digests_in
from crgame_ros.evaluation.results.cell_rows import FACTORS

KEY_DIGITS = 32
_LATER = ('participant', 'variant')


@dataclass(frozen=True)
class Condition:
    """
    All that cells of different seeds share: with its contents, nothing but a seed is needed.

    :param scenario: benchmark id.
    :param game: name of the game's file, or empty.
    :param human: name of the recorded run whose humans drive, or empty.
    :param planner: label of the AVs' planner.
    :param perception: label of the AVs' perception.
    :param traffic: label of the traffic.
    :param values: values of the game; files are references to contents.
    :param inputs: digest of the recorded humans' inputs, or empty.
    :param planner_choice: `planner` and `options` of all AVs; None keeps the game's.
    :param perception_values: perception of all AVs, as in a game; None is perfect, `own` keeps
        the game's.
    :param traffic_values: likewise for traffic.
    :param duration_s: simulated duration; None for the game's [s]
    :param latency_steps: simulation steps between a request and its plan.
    :param commonroad_scores: whether CommonRoad's tools score it, too.
    :param code: digests of the engine's and the planners' code.
    :param participant: label of the study's participant who drove the recorded run, or empty.
    :param variant: the values that vary in the game, as JSON, or empty.
    """

    scenario: str
    game: str
    human: str
    planner: str
    perception: str
    traffic: str
    values: Mapping[str, object]
    inputs: str
    planner_choice: Mapping[str, object] | None
    perception_values: object
    traffic_values: object
    duration_s: float | None
    latency_steps: int
    commonroad_scores: bool
    code: tuple[str, ...]
    participant: str = ''
    variant: str = ''

    @cached_property
    def text(self) -> str:
        """Return the condition as JSON, the same for equal conditions."""
        return ','.join(self.around_seed)

    @cached_property
    def around_seed(self) -> tuple[str, str]:
        """Return what comes before and after the seed in a cell's JSON, with sorted keys."""
        # Without a value, the keys are those of evaluations that did not know the factor.
        known = sorted(item.name for item in fields(self)
                       if item.name not in _LATER or getattr(self, item.name))
        names = [[name for name in known if (name > 'seed') is after] for after in (False, True)]
        before, after = (json.dumps({name: getattr(self, name) for name in part}, sort_keys=True,
                                    separators=(',', ':'), allow_nan=True) for part in names)
        return before[:-1], after[1:]

    @cached_property
    def contents(self) -> frozenset[str]:
        """Return the digests of the contents that it needs."""
        return frozenset(digests_in(self.text) | ({self.inputs} if self.inputs else set()))

    @cached_property
    def begun_hash(self) -> 'hashlib._Hash':
        """Return the hash of the part of a cell's text that comes before its seed."""
        return hashlib.sha256(self.around_seed[0].encode())


class Cell(NamedTuple):
    """
    The complete description of a run to compute.

    :param condition: all but the seed.
    :param seed: seed of all random values.
    """

    condition: Condition
    seed: int

    @property
    def text(self) -> str:
        """Return the cell as JSON, the same for equal cells."""
        return self.condition.around_seed[0] + self._end

    @property
    def key(self) -> str:
        """Return the key: a hash over the text, everything that the results depend on."""
        total = self.condition.begun_hash.copy()
        total.update(self._end.encode())
        return total.hexdigest()[:KEY_DIGITS]

    @property
    def _end(self) -> str:
        return f',"seed":{self.seed},{self.condition.around_seed[1]}'

    @property
    def factors(self) -> dict[str, object]:
        """Return the values of the columns that identify it."""
        return {name: getattr(self if name == 'seed' else self.condition, name)
                for name in FACTORS}

    @property
    def label(self) -> str:
        """Return a name for people."""
        given = self.condition
        place = given.human or given.game or given.scenario
        more = [text for text in (given.perception, given.traffic, given.variant)
                if text not in ('own', '')]
        return ' · '.join((place, given.planner, *more, f'seed {self.seed}'))


def condition_of(values: Mapping[str, Any]) -> Condition:
    """Build the condition from the values of its JSON."""
    return Condition(**{**values, 'code': tuple(values['code'])})


def cell_of(text: str) -> Cell:
    """Build the cell from its JSON."""
    values = json.loads(text)
    seed = values.pop('seed')
    return Cell(condition_of(values), seed)
