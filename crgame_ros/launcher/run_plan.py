# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Building a checked plan of a run from a request: game, vehicles and folder."""

from collections.abc import Callable, Iterator, Mapping
import contextlib
from dataclasses import dataclass, replace
from datetime import datetime
from errno import ENOTDIR
import os
from pathlib import Path
import shutil

from crgame_ros.cockpit.access import check_address
from crgame_ros.cockpit.exposure import check_certificate
from crgame_ros.driver.source import COCKPIT, parse_source
from crgame_ros.errors import InputError
from crgame_ros.game.events import PlannerSwap
from crgame_ros.game.game import AvSpec, Game, HumanSpec, load_game, TimingSpec
from crgame_ros.instruments.extra import require_instruments
from crgame_ros.launcher.arguments import cockpit_host, RunRequest
from crgame_ros.library.stored_index import is_kept
from crgame_ros.paths import check_room, default_game, expanded, numbered
from crgame_ros.planner.registry import create_planner, EXTERNAL
from crgame_ros.policy.policy_file import load_policy
from crgame_ros.recording.recorded_game import (
    read_recorded_game,
    recorded_inputs,
    replay_notices,
    with_replayed_events,
)
from crgame_ros.recording.run_folder import BAG, CLAIM, GAME_FILE, recording_in
from crgame_ros.registry import POLICY
from crgame_ros.scenario import guard
from crgame_ros.scenario.loading import plays_its_humans
from crgame_ros.schema.reading import read
from crgame_ros.simulation.game_check import check_swap
from crgame_ros.simulation.setup import build_setup, Setup


@dataclass(frozen=True)
class RunPlan:
    """
    A run that can be started.

    :param setup: the run, loaded and checked.
    :param folder: of its files; exists.
    """

    request: RunRequest
    setup: Setup
    folder: Path

    @property
    def claim(self) -> Path:
        """Return the file that reserves the folder while the run goes on."""
        return self.folder / CLAIM

    @property
    def game_file(self) -> Path:
        """Return the file of the resolved game, in the run's folder."""
        return self.folder / GAME_FILE

    @property
    def cockpit(self) -> Path:
        """Return the folder of the cockpit's uploads and choices."""
        return self.folder / 'cockpit'

    @property
    def roster(self) -> Path:
        """Return the file of the present game's vehicles, which exists while the game runs."""
        return self.folder / '.roster.json'

    @property
    def private(self) -> Path:
        """Return the folder of links and certificate: private, and only during the run."""
        return self.folder / '.private'

    @property
    def dds_profile(self) -> Path:
        """Return the file of the Fast DDS profile that the run's nodes share."""
        return self.private / 'fastdds.xml'

    @property
    def bag(self) -> Path:
        """Return the path of the recording."""
        return self.folder / BAG


def effective_game(request: RunRequest, game: Game | None = None) -> Game:
    """
    Combine the game file with the command line.

    :param game: instead of the game file's.
    :raises InputError: if a file or name cannot be used.
    """
    if game is not None:
        pass
    elif request.game is not None:
        game = load_game(request.game)
    elif request.scenario is not None:
        # The human of an exported run is a recording in it, so the same drivers take part again.
        alone = request.driver is None and not request.drivers \
            and plays_its_humans(request.scenario)
        game = Game(request.scenario, humans=() if alone else (HumanSpec('hv0'),))
    else:
        game = load_game(default_game())
    if request.game is not None and request.scenario is not None:
        game = replace(game, scenario=request.scenario)
    if request.driver is not None:
        if not game.humans:
            raise InputError('the game has no human', '--driver', 'leave it out')
        first = replace(game.humans[0], driver=_from_here(request.driver))
        game = replace(game, humans=(first, *game.humans[1:]))
    return _with_options(game, request)


def _with_drivers(game: Game, drivers: Mapping[str, str]) -> Game:
    """Return the game with these drivers of its humans."""
    known = {human.id for human in game.humans}
    unknown = sorted(drivers.keys() - known)
    if unknown:
        raise InputError(f'the game has no {unknown[0]}', '--driver', 'it has '
                         + (', '.join(sorted(known)) or 'no human'))
    return replace(game, humans=tuple(
        replace(human, driver=_from_here(drivers[human.id])) if human.id in drivers else human
        for human in game.humans))


def _with_options(game: Game, request: RunRequest) -> Game:
    """Return the game with the request's planning problems, named drivers, duration and rate."""
    if request.problems:
        if game.avs is not None:
            raise InputError('the game names its AVs', '--problem', 'leave it out')
        game = replace(game, avs=tuple(AvSpec(f'av{index}', planning_problem=number)
                                       for index, number in enumerate(request.problems)))
    if request.drivers:
        game = _with_drivers(game, dict(request.drivers))
    if request.duration_s is not None:
        game = replace(game, duration=request.duration_s)
    if request.rate_hz is not None:
        timing = read(TimingSpec, {**vars(game.timing), 'rate': request.rate_hz}, '--rate')
        game = replace(game, timing=timing)
    return game


def effective_setup(request: RunRequest, game: Game | None = None) -> Setup:
    """
    Load and set up the requested run, with its planners and the recordings that it repeats.

    With `--driver replay:BAG` and no game, use the game of the recording.

    :param game: used instead of the one that the request names.
    :raises InputError: if a file or name cannot be used, or game and recording don't belong
        together.
    """
    bag = None if game is not None else _own_recording(request)
    with naming(request):
        if bag is None:
            setup = build_setup(effective_game(request, game))
        else:
            recorded = read_recorded_game(bag, other_planners=bool(request.planners))
            setup = build_setup(_with_options(recorded.game, request), recorded.loaded)
        setup = with_replayed_events(with_planners(
            setup, request.planners, dict(request.options)))
    notices = [*setup.notices, *replay_notices(setup)]
    if bag is not None:
        notices.append(f'{bag}: this is the game of the recording')
    return replace(setup, notices=tuple(notices))


@contextlib.contextmanager
def naming(request: RunRequest) -> Iterator[None]:
    """Add the game's file to errors that name no file."""
    file = _own_recording(request) or request.game
    try:
        yield
    except InputError as error:
        if file is None or '/' in error.where or file.name in str(error) \
                or error.where.startswith('--'):
            raise
        place = f'{file}: {error.where}' if error.where else str(file)
        raise InputError(error.what, place, error.remedy) from error


def _own_recording(request: RunRequest) -> Path | None:
    """Return the recording whose own game is requested, None if there is another game."""
    if request.driver is None or request.game is not None or request.scenario is not None:
        return None
    source = parse_source(request.driver)
    return recording_in(expanded(source.argument)) if source.kind == 'replay' else None


def _from_here(driver: str) -> str:
    """Resolve a file named on the command line against the working directory."""
    kind, colon, argument = driver.partition(':')
    if not colon or kind == 'evdev':
        return driver
    return f'{kind}:{expanded(argument).resolve()}'


def plan_run(request: RunRequest, now: Callable[[], datetime] = datetime.now) -> RunPlan:
    """
    Load and check everything before any process starts, and create the run's folder.

    :param now: wall clock for the folder's name.
    :raises InputError: if anything cannot be used.
    """
    setup = effective_setup(request)
    with naming(request):
        _check_run(request, setup)
    folder = _make_folder(request.out, setup.loaded.benchmark_id, now())
    try:
        check_room(folder)
        return _plan_in(folder, request, setup)
    except OSError as error:
        with contextlib.suppress(OSError):
            (folder / CLAIM).unlink()
            # This succeeds only if the folder is empty.
            folder.rmdir()
        raise InputError(f'cannot be written to ({error.strerror})', str(folder),
                         'free some space, or choose another folder with --out') from error


def _check_run(request: RunRequest, setup: Setup) -> None:
    recorded_inputs(setup)
    if setup.game.instruments is not None:
        require_instruments(setup.game.instruments)
    if request.headless and any(human.driver == COCKPIT for human in setup.humans):
        raise InputError('there is no page in which to take a seat', '--headless',
                         'leave it out, or name another driver')
    for av in setup.avs:
        _check_planner(av.spec)
    for human in setup.humans:
        if human.driver.startswith(POLICY):
            load_policy(human.driver.removeprefix(POLICY), human.id).check_pedals(human.id)
    _check_swaps(setup)
    if not request.headless:
        check_certificate(request.certificate, request.key)
        check_address(cockpit_host(request), request.port)


def _plan_in(folder: Path, request: RunRequest, setup: Setup) -> RunPlan:
    """Write the files that the nodes read into the run's folder."""
    if _own_recording(request) is not None or is_kept(setup.game.scenario):
        # The nodes read files: this run's folder gets the scenario that the recording carries, or
        # the one out of an archive, whose copy in the cache may be gone when the run is repeated.
        scenario = folder / 'scenario.xml'
        scenario.write_bytes(guard.encode(setup.loaded.xml_text))
        setup = replace(setup, game=replace(setup.game, scenario=scenario))
    plan = RunPlan(request, setup, folder)
    # Left by a killed launcher; its links are no longer valid.
    shutil.rmtree(plan.private, ignore_errors=True)
    plan.private.mkdir(mode=0o700)
    plan.game_file.write_text(setup.game.dump(), encoding='utf-8')
    return plan


def _check_planner(spec: AvSpec) -> None:
    if spec.planner != EXTERNAL:
        create_planner(spec.planner, spec.options)
    elif spec.options:
        raise InputError('an external planner takes no options from the game', spec.id,
                         'give them to the external planner itself')


def _check_swaps(setup: Setup) -> None:
    """Create every planner that an event brings in, as its node will."""
    specs = [av.spec for av in setup.avs]
    for event in setup.game.events:
        if isinstance(event.action, PlannerSwap):
            check_swap(event, f'event {event.name}', specs)
            create_planner(event.action.planner, event.action.options)


def with_planners(setup: Setup, planners: tuple[str, ...],
                  options: Mapping[str, object] | None = None) -> Setup:
    """
    Return the setup with its resolved AVs in the game, with the requested planners.

    :param planners: one for each AV, one for all, or none: those of the game.
    :param options: of all planners, before those of the game.
    """
    if len(planners) > 1 and len(planners) != len(setup.avs):
        raise InputError(f'{len(planners)} planners for {len(setup.avs)} AVs', '--planner',
                         'give one for all, or one for each')
    avs = []
    for index, av in enumerate(setup.avs):
        spec: AvSpec = av.spec
        if planners:
            name = planners[index if len(planners) > 1 else 0]
            spec = replace(spec, planner=name,
                           options=spec.options if name == spec.planner else {})
        if options:
            spec = replace(spec, options={**spec.options, **options})
        avs.append(replace(av, spec=spec))
    game = replace(setup.game, avs=tuple(av.spec for av in avs))
    return replace(setup, game=game, avs=tuple(avs))


def _make_folder(out: Path | None, benchmark_id: str, now: datetime) -> Path:
    """Create a separate folder for the run; existing files stay as they are."""
    wanted = out if out is not None else Path('runs') / f'{now:%Y%m%d-%H%M%S}_{benchmark_id}'
    folder = wanted
    try:
        wanted.parent.mkdir(parents=True, exist_ok=True)
        for folder in numbered(wanted):
            with contextlib.suppress(FileExistsError):
                folder.mkdir()
            if not folder.is_dir():
                raise NotADirectoryError(ENOTDIR, os.strerror(ENOTDIR))
            with contextlib.suppress(FileExistsError):
                if not (folder / BAG).exists():
                    # Several launchers may start at once: the one that creates this file has the
                    # folder.
                    (folder / CLAIM).touch(exist_ok=False)
                    break
    except OSError as error:
        raise InputError(f'cannot be made ({error.strerror})', str(folder),
                         'choose another folder with --out') from error
    return folder.resolve()
