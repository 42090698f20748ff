# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Jobs that read scenarios for the page, in a process of their own (`job_process`)."""

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import replace
import json
from pathlib import Path

from crgame_ros.cockpit.job_process import serve_jobs
from crgame_ros.cockpit.scene import scene_document
from crgame_ros.cockpit.shown_paths import without_paths
from crgame_ros.driver.source import COCKPIT
from crgame_ros.errors import InputError
from crgame_ros.finite_json import finite
from crgame_ros.game.game import AvSpec, Game, HumanSpec, load_game
from crgame_ros.planner.registry import PLANNERS
from crgame_ros.scenario import guard
from crgame_ros.scenario.loading import LoadedScenario, parse_scenario
from crgame_ros.schema.model_options import options_of
from crgame_ros.simulation.run_texts import describe_game
from crgame_ros.simulation.setup import build_setup, Setup
from crgame_ros.yaml_text import parse_yaml

UPLOAD = 'upload'


def check(path: Path) -> dict[str, object]:
    """
    Check an uploaded file.

    :return: its `title`.
    :raises InputError: if it is not a scenario; the error calls the file 'upload'.
    """
    return {'title': _scenario(path, UPLOAD).benchmark_id}


def preview(path: Path, kind: str) -> dict[str, object]:
    """
    Return the preview of a game or scenario.

    :param kind: game, scenario or upload.
    :return: the answer of /api/preview.
    :raises InputError: if it cannot be used.
    """
    setup = _setup(path, kind)
    document = describe_game(setup)
    states = setup.obstacles.states_at(setup.scheduler.k0)
    vehicles = [[*vehicle.state, *[None] * 4] for vehicle in setup.vehicles]
    objects = [[*pose, *velocity] for pose, velocity in zip(
        states.poses.tolist(), states.velocities.tolist(), strict=True)]
    return {
        'scene': scene_document(setup.loaded, setup.descriptions, document),
        'states': {'vehicles': finite(vehicles), 'objects': finite(objects)},
        'humans': [{'id': human.id, 'driver': human.driver} for human in setup.humans],
        'avs': [{'id': av.id, 'planner': av.spec.planner,
                 'planning_problem': av.planning_problem.planning_problem_id,
                 'options': {key: _typed(value) for key, value in av.spec.options.items()}}
                for av in setup.avs],
        'notices': list(setup.notices)}


def planner_options(planner: str) -> dict[str, object]:
    """
    Return the options that a planner declares.

    :return: them as `options`, in order.
    :raises InputError: if its package is not installed.
    """
    return {'options': [option._asdict() for option in options_of(PLANNERS, planner)]}


def compose(path: Path, kind: str, drivers: Mapping[str, str], planners: Mapping[str, str],
            options: Mapping[str, Mapping[str, str]], allowed_drivers: list[str],
            allowed_planners: list[str]) -> dict[str, object]:
    """
    Return the text of the chosen game.

    :param kind: game, scenario or upload.
    :param drivers: of humans, as `planners` are of AVs; who is left out keeps the game's.
    :param options: options of planners by AV, as typed; AVs that are left out keep the game's,
        with the game's planner.
    :param allowed_drivers: choices besides the game's own, like `allowed_planners`.
    :return: the game file as `text`.
    :raises InputError: if the choice is not allowed, or the game cannot be used.
    """
    setup = _setup(path, kind)
    humans = [replace(human, driver=_choice(
        drivers, human.id, human.driver, allowed_drivers, 'driver'))
        for human in setup.game.humans]
    avs = []
    for spec in (av.spec for av in setup.avs):
        planner = _choice(planners, spec.id, spec.planner, allowed_planners, 'planner')
        chosen = options.get(spec.id)
        if planner != spec.planner or chosen is not None:
            # The options of another planner do not apply.
            spec = replace(spec, planner=planner, options={
                key: parse_yaml(text, f'{spec.id}: {key}', 'give a value as in a game file')
                for key, text in (chosen or {}).items()})
            PLANNERS.create(planner, spec.options, spec.id)
        avs.append(spec)
    _refuse_strangers(drivers, humans)
    _refuse_strangers(planners, avs)
    _refuse_strangers(options, avs)
    game = replace(setup.game, humans=tuple(humans), avs=tuple(avs),
                   title=setup.game.title or setup.loaded.benchmark_id)
    build_setup(game, setup.loaded)
    return {'text': game.dump()}


def main() -> None:
    """Answer jobs until the standard input ends."""
    serve_jobs({'check': check, 'preview': preview, 'compose': compose,
                'planner_options': planner_options}, 'scenario')


def _scenario(path: Path, source: str) -> LoadedScenario:
    try:
        text = guard.read_text(path)
    except InputError as error:
        raise InputError(error.what, source, error.remedy) from error
    return parse_scenario(text, source)


def _setup(path: Path, kind: str) -> Setup:
    if kind == 'game':
        return build_setup(load_game(path))
    # The sender of an uploaded file drives it from the cockpit page.
    human = HumanSpec('hv0', driver=COCKPIT if kind == UPLOAD else HumanSpec.driver)
    game = Game(path, humans=(human,))
    return build_setup(game, _scenario(path, UPLOAD if kind == UPLOAD else path.name))


def _typed(value: object) -> str:
    """Return the text that gives an option's value when it is typed."""
    if isinstance(value, str):
        with suppress(InputError):
            if parse_yaml(value, '') == value:
                return value
    return json.dumps(value)


def _choice(chosen: Mapping[str, str], vehicle: str, own: str, allowed: list[str],
            what: str) -> str:
    value = chosen.get(vehicle, own)
    if value == without_paths(own):
        # The id as the page knows it.
        return own
    if value != own and value not in allowed:
        raise InputError(f'that {what} cannot be chosen here', vehicle,
                         f'choose {", ".join(allowed)} or leave it as it is')
    return value


def _refuse_strangers(chosen: Mapping[str, object], specs: list[HumanSpec] | list[AvSpec]) -> None:
    if not chosen.keys() <= {spec.id for spec in specs}:
        raise InputError('names a vehicle that the game does not have', 'choice',
                         'load the page again')


if __name__ == '__main__':
    main()
