# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The grid of an evaluation, which yields its cells one by one without storing them."""

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import product
from pathlib import Path
from typing import Any, Self

from crgame_ros.errors import InputError
from crgame_ros.evaluation.cell import Cell, Condition
from crgame_ros.evaluation.cell_scene import (
    CellScene,
    files_of,
    GAME_SUFFIXES,
    participant_labels,
    runs_of,
    SCENARIO_SUFFIXES,
    scene_of_game,
    scene_of_run,
    scene_of_scenario,
    with_contents,
)
from crgame_ros.evaluation.content import ContentStore
from crgame_ros.evaluation.plan import EvaluationPlan, VariantChoice
from crgame_ros.evaluation.source_digest import engine_digest, planner_digest
from crgame_ros.game.variation_spec import VARY
from crgame_ros.library.lookup import find_scenarios
from crgame_ros.planner.registry import create_planner, EXTERNAL
from crgame_ros.schema.writing import write
from crgame_ros.simulation.av_assignment import OWN
from crgame_ros.variation.space import sample, space_of


@dataclass(frozen=True)
class GridPlanner:
    """
    A planner for all AVs.

    :param label: name in tables.
    :param choice: its name and options; None keeps each game's own planners.
    :param digest: digest of its code.
    """

    label: str
    choice: dict[str, object] | None
    digest: str


@dataclass(frozen=True)
class CellGrid:
    """
    All combinations of scenes, planners, perception, traffic and seeds.

    :param scenes: scenes with different labels.
    :param perception: values by label.
    :param traffic: values by label.
    :param duration_s: simulated duration of each cell; None for the games' [s]
    :param latency_steps: simulation steps between a request and its plan.
    :param commonroad_scores: whether CommonRoad's tools score each cell, too.
    :param engine: digest of the engine's code.
    """

    scenes: tuple[CellScene, ...]
    planners: tuple[GridPlanner, ...]
    perception: dict[str, object]
    traffic: dict[str, object]
    seeds: tuple[int, ...]
    duration_s: float | None
    latency_steps: int
    commonroad_scores: bool
    engine: str

    def __len__(self) -> int:
        return sum(max(1, len(scene.variants)) for scene in self.scenes) * len(self.planners) \
            * len(self.perception) * len(self.traffic) * len(self.seeds)

    def __iter__(self) -> Iterator[Cell]:
        """Yield the cells of a scene together, so that its contents are sent once."""
        for scene in self.scenes:
            for variant, values in scene.cells():
                yield from self._cells(scene, variant, values)

    def _cells(self, scene: CellScene, variant: str, values: dict[str, object]) -> Iterator[Cell]:
        for planner, (perception, seen), (traffic, flow) in product(
                self.planners, self.perception.items(), self.traffic.items()):
            code = scene.digests if planner.choice is None else (planner.digest,)
            condition = Condition(
                scene.scenario, scene.game, scene.human, planner.label, perception, traffic,
                values, scene.inputs, planner.choice, seen, flow, self.duration_s,
                self.latency_steps, self.commonroad_scores,
                (self.engine, *code), scene.participant, variant)
            yield from (Cell(condition, seed) for seed in self.seeds)

    @classmethod
    def from_dict(cls, values: dict[str, Any]) -> Self:
        """Build the grid from the dictionary of `dataclasses.asdict`."""
        return cls(**values | {
            'scenes': tuple(CellScene(**scene | {
                name: tuple(scene.get(name, ())) for name in ('digests', 'variants')})
                            for scene in values['scenes']),
            'planners': tuple(GridPlanner(**planner) for planner in values['planners']),
            'seeds': tuple(values['seeds'])})


def make_grid(plan: EvaluationPlan, store: ContentStore,
              progress: Callable[[float], object] = lambda _: None) -> CellGrid:
    """
    Load and check everything that a plan names, and copy its files into a store.

    :param progress: called with the share done so far, 0 to 1.
    :raises InputError: if anything cannot be used.
    """
    planners = tuple(_planner(choice.planner, choice.name, choice.options, store)
                     for choice in plan.planners)
    perception = {label: value if value in (None, OWN) else with_contents(write(value), store)
                  for label, value in plan.perceptions().items()}
    traffic = {label: value if value in (None, OWN) else with_contents(write(value), store)
               for label, value in plan.traffics().items()}
    places: list[tuple[Callable[[Path, ContentStore], CellScene], Path]] = [
        *((scene_of_game, path) for path in files_of(
            plan.games, plan.base, GAME_SUFFIXES, 'game file')),
        *((scene_of_scenario, path) for path in files_of(
            find_scenarios(plan.scenarios, plan.base), plan.base, SCENARIO_SUFFIXES,
            'CommonRoad file')),
        *((partial(scene_of_run, until_take_over=plan.take_overs == 'end'), path)
          for path in runs_of(plan.humans, plan.base))]
    scenes: list[CellScene] = []
    for number, (make, path) in enumerate(places):
        scene = make(path, store)
        if not scene.digests:
            raise InputError('no AV takes part', str(path), 'leave it out, or name AVs in a game')
        scenes.append(with_variants(scene, plan.variants, path))
        progress((number + 1) / len(places))
    paths = [path for _, path in places]
    scenes = [replace(scene, participant=label) if scene.human else scene
              for scene, label in zip(scenes, participant_labels(paths), strict=True)]
    return CellGrid(_unique_names(scenes, paths), planners, perception, traffic,
                    plan.seed_numbers(), plan.duration, plan.latency, plan.commonroad_scores,
                    engine_digest())


def with_variants(scene: CellScene, wanted: VariantChoice | None, path: Path) -> CellScene:
    """
    Return a scene with its variants sampled; unchanged if none are wanted or nothing varies.

    :param path: path of its file.
    :raises InputError: if what varies cannot be used.
    """
    if wanted is None or not scene.values.get(VARY):
        return scene
    space = space_of(scene.values, str(path))
    return replace(scene, variants=tuple(
        sample(space, wanted.sampling, wanted.number, wanted.seed, str(path))))


def _unique_names(scenes: Sequence[CellScene], paths: Sequence[Path]) -> tuple[CellScene, ...]:
    """
    Return scenes with unique names.

    Equal names are extended: by the file's name for scenarios, by parent folders for runs.

    :raises InputError: if names are still equal.
    """
    labels = Counter(scene.label for scene in scenes)
    named = tuple(
        scene if labels[scene.label] == 1 else
        replace(scene, human=_longer_name(path, paths)) if scene.human else
        replace(scene, scenario=f'{scene.scenario} ({path.stem})')
        if scene.label == scene.scenario else scene
        for scene, path in zip(scenes, paths, strict=True))
    known: set[str] = set()
    for scene, path in zip(named, paths, strict=True):
        if scene.label in known:
            raise InputError(f'another one is called {scene.label}, too', str(path),
                             'rename one of them, or evaluate them apart')
        known.add(scene.label)
    return named


def _longer_name(path: Path, paths: Sequence[Path]) -> str:
    """Return a run's name that starts with the folder shared by the runs of equal names."""
    whole = path.resolve()
    alike = {other.resolve() for other in paths} - {whole}
    for count in range(2, len(whole.parts)):
        tail = whole.parts[-count:]
        if all(other.parts[-count:] != tail for other in alike):
            return '/'.join(tail)
    return str(whole)


def _planner(name: str, label: str, options: dict[str, object],
             store: ContentStore) -> GridPlanner:
    if name == OWN:
        return GridPlanner(label, None, '')
    if name == EXTERNAL:
        raise InputError('an external planner works in live runs only', 'planners',
                         'name another planner')
    create_planner(name, options)
    return GridPlanner(label, with_contents({'planner': name, 'options': options}, store),
                       planner_digest(name))
