# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The plan of an evaluation, from its file or the command line."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, ClassVar, Literal, TypeVar

from crgame_ros.errors import InputError
from crgame_ros.game.perception_spec import PerceptionSpec
from crgame_ros.game.traffic_spec import TrafficSpec
from crgame_ros.game.variation_spec import MOST_VARIANTS, Sampling
from crgame_ros.paths import expanded
from crgame_ros.schema.declaration import Form
from crgame_ros.schema.marks import Advice, Folder, Listed, Named, Within
from crgame_ros.schema.reading import read
from crgame_ros.simulation.av_assignment import OWN
from crgame_ros.yaml_text import read_yaml

MOST_SEEDS = 1_000_000
T = TypeVar('T')


@dataclass(frozen=True)
class PlannerChoice:
    """
    A planner that drives all AVs.

    :param planner: registered name, `module:Class` or `FILE.py:Class`; `own` leaves each AV the
        planner that its game names.
    :param label: name in tables; the planner's name by default.
    :param options: keyword arguments of the planner.
    """

    FORM: ClassVar[Form] = Form('name a planner', short='planner')

    planner: Annotated[str, Named(), Advice('name a planner')]
    label: str = ''
    options: dict[str, object] = field(default_factory=dict)

    @property
    def name(self) -> str:
        """Return the label, or its default."""
        return self.label or self.planner.rpartition('/')[2]


@dataclass(frozen=True)
class VariantChoice:
    """
    The variants of games with `vary`.

    :param number: of variants of each game; a grid has as many as its levels give.
    :param sampling: how they are chosen.
    :param seed: of the choice.
    """

    FORM: ClassVar[Form] = Form('give number and sampling', short='sampling')

    number: Annotated[int, Within(1, MOST_VARIANTS)] = 64
    sampling: Sampling = 'sobol'
    seed: Annotated[int, Within(0, 2**63 - 1)] = 0


@dataclass(frozen=True)
class EvaluationPlan:
    """
    The plan of an evaluation: each scene is combined with each value of all other keys.

    :param games: game files, or folders of them; their humans are driven by scripts or are idle.
    :param scenarios: CommonRoad files, folders of them, benchmark ids, patterns of ids such as
        `USA_*`; no human takes part.
    :param humans: recorded runs, whose humans drive again as they did, in the recorded game.
    :param take_overs: what becomes of take-overs of AVs in these runs: `replay` repeats their
        commands; `end` repeats a run up to the first one, also one in which nobody else drives.
    :param planners: planners of the AVs.
    :param seeds: number of seeds, from 0 on, or a list of seeds.
    :param perception: perception of the AVs, by label; `own` is that of the games.
    :param traffic: traffic by label; `own` is that of the games.
    :param variants: which variants of games with `vary` are run; by default each game as it is.
    :param duration: simulated duration of each cell [s]; by default that of the game or the
        recording, or 20 s if these have none.
    :param latency: simulation steps between a request and its plan.
    :param commonroad_scores: whether CommonRoad's tools judge each cell, too: goals, validity,
        feasibility and costs, which doubles the time of a short cell.
    :param base: directory against which file names are resolved.
    """

    FORM: ClassVar[Form] = Form('see docs/evaluation.md for the keys')

    games: Annotated[tuple[str, ...], Listed(noun='file')] = ()
    scenarios: Annotated[tuple[str, ...], Listed(noun='file')] = ()
    humans: Annotated[tuple[str, ...], Listed(noun='run')] = ()
    take_overs: Literal['replay', 'end'] = 'replay'
    planners: Annotated[tuple[PlannerChoice, ...], Listed(noun='planner')] = (
        PlannerChoice(OWN),)
    seeds: object = 1
    perception: dict[str, object] = field(default_factory=dict)
    traffic: dict[str, object] = field(default_factory=dict)
    variants: VariantChoice | None = None
    duration: Annotated[float, Within(0.0, 86400.0)] | None = None
    latency: Annotated[int, Within(0, 1_000_000)] = 0
    commonroad_scores: bool = False
    base: Annotated[Path, Folder()] = Path('.')

    def check(self) -> None:
        """Check that the plan is valid."""
        if not (self.games or self.scenarios or self.humans):
            raise InputError('names no games, scenarios or humans', '',
                             'name files or folders of one of them')
        names = [choice.name for choice in self.planners]
        if len(set(names)) < len(names):
            raise InputError('two planners have one label', '', 'give each a "label" of its own')
        self.seed_numbers()

    def seed_numbers(self) -> tuple[int, ...]:
        """Return the seeds."""
        given = self.seeds
        if isinstance(given, int) and not isinstance(given, bool) and 1 <= given <= MOST_SEEDS:
            return tuple(range(given))
        if isinstance(given, list | tuple) and given and len(given) <= MOST_SEEDS and all(
                isinstance(seed, int) and not isinstance(seed, bool) and 0 <= seed < 2**63
                for seed in given) and len(set(given)) == len(given):
            return tuple(given)
        raise InputError('"seeds" is neither a number of seeds nor a list of different ones', '',
                         'give seeds: 5, or seeds: [3, 7]')

    def perceptions(self) -> dict[str, PerceptionSpec | str | None]:
        """Return each perception by its label; OWN is the games' own, None is perfect."""
        return _choices(self.perception, PerceptionSpec, 'perception', self.base)

    def traffics(self) -> dict[str, TrafficSpec | str | None]:
        """Return each kind of traffic by its label; OWN is the games' own, None is none."""
        return _choices(self.traffic, TrafficSpec, 'traffic', self.base)


def _choices(given: Mapping[str, object], kind: type[T], what: str,
             base: Path) -> dict[str, T | str | None]:
    found: dict[str, T | str | None] = {}
    for label, value in (given or {OWN: OWN}).items():
        where = f'{what}: {label}'
        if value is None or value == OWN:
            found[str(label)] = value
        elif isinstance(value, str):
            file = base / expanded(value)
            found[str(label)] = read(kind, read_yaml(file, what), str(file), file.parent)
        else:
            found[str(label)] = read(kind, value, where, base)
    return found


def load_plan(path: Path) -> EvaluationPlan:
    """
    Read a plan's file.

    :raises InputError: naming the file, the key and the remedy.
    """
    return parse_plan(read_yaml(path, 'plan'), str(path), path.parent)


def parse_plan(values: object, where: str, base: Path) -> EvaluationPlan:
    """
    Check the content of a plan's file.

    :param where: file name for messages.
    :param base: directory against which its file names are resolved.
    :raises InputError: naming the key and the remedy.
    """
    # Files are found by their absolute names, and travel to workers.
    plan = read(EvaluationPlan, values, where, base.resolve())
    try:
        plan.perceptions()
        plan.traffics()
    except InputError as error:
        raise InputError(error.what, f'{where}: {error.where}' if where not in error.where
                         else error.where, error.remedy) from error
    return plan
