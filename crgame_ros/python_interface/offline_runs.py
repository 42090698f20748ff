# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Runs a game as fast as possible, without ROS."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
import time

from crgame_ros.driver.source import parse_source
from crgame_ros.errors import InputError
from crgame_ros.game.game import Game
from crgame_ros.launcher.arguments import RunRequest
from crgame_ros.launcher.run_plan import effective_setup, with_planners
from crgame_ros.planner.registry import PLANNERS
from crgame_ros.python_interface.finished_run import Run
from crgame_ros.python_interface.games import (
    argument_names,
    as_game,
    as_path,
    FileName,
    name_planners,
    PlannerLike,
)
from crgame_ros.recording.offline_recording import check_run_folder, write_recording
from crgame_ros.recording.progress import Progress
from crgame_ros.recording.recorded_game import (
    inputs_of,
    recorded_inputs,
    RecordedInputs,
    with_recorded_events,
)
from crgame_ros.recording.run_folder import GAME_FILE
from crgame_ros.simulation.contacts import contacts_of
from crgame_ros.simulation.offline import OfflineResult, run_offline
from crgame_ros.simulation.setup import Setup
from crgame_ros.whole_file import write_text
import numpy as np
from numpy.typing import NDArray


def run_summary(result: OfflineResult, wall_s: float) -> dict[str, object]:
    """
    Return the summary of a run in JSON form.

    :param wall_s: its wall time [s]
    """
    simulated_s = (len(result.vehicle_states) - 1) * result.setup.scheduler.dt_s
    return {
        'scenario': result.setup.loaded.benchmark_id, 'simulated_s': round(simulated_s, 6),
        'wall_s': round(wall_s, 3), 'state_hash': result.state_hash,
        'planners': {
            av_id: {'accepted_ratio': round(record.accepted_ratio, 4),
                    'requests': record.counters.requests, 'accepted': record.counters.accepted,
                    'refused': record.counters.refused,
                    'last_refusal': record.counters.last_refusal or None,
                    'fallbacks': record.statistics.fallbacks,
                    'reasons': dict(record.statistics.reasons),
                    **({} if record.tracking is None else {'worst_tracking_errors': {
                        key: round(value, 4) for key, value in {
                            'lane': record.lane_error or 0.0,
                            **record.tracking._asdict()}.items()}})}
            for av_id, record in result.planners.items()},
        'events': [{'name': event.name, 'n': event.n, 'k': event.k, 'by': event.by}
                   for event in result.fired],
        'violations': [{'vehicle': item.vehicle_id, 'n': item.n, 'hit': list(item.hit),
                        'off_road': item.off_road}
                       for item in result.violations if not item.is_valid],
        'stop': None if result.stop is None else {
            'vehicle': result.stop.vehicle_id, 'violation_n': result.stop.n,
            'stop_n': len(result.vehicle_states) - 1},
        'contacts': [item.as_dict() for item in contacts_of(result)],
        'taken_off': result.taken_off}


class OfflineRun(Run):
    """
    A run on a virtual clock.

    :ivar result: states of every simulation step, commands, events and violations.
    :ivar wall_s: its wall time [s]
    """

    result: OfflineResult

    def __init__(self, name: str, result: OfflineResult, wall_s: float) -> None:
        super().__init__(name, result=result)
        self.wall_s = wall_s

    @property
    def state_hash(self) -> str:
        """Return the SHA-256 over all states: equal for equal inputs."""
        return self.result.state_hash

    @property
    def notices(self) -> tuple[str, ...]:
        """Return notices about the game, one line each."""
        return self.result.setup.notices

    def summary(self) -> dict[str, object]:
        """Return the summary of the run, as `crgame offline` does."""
        return run_summary(self.result, self.wall_s)

    def setup_against(self, planner: str) -> Setup:
        """Return the same game with another planner and with events at their original times."""
        setup = self.result.setup
        repeated = replace(setup, game=with_recorded_events(setup.game, self.result.fired))
        return with_planners(repeated, (planner,))

    def recorded_inputs(self) -> RecordedInputs:
        """Return its humans' inputs."""
        return inputs_of(self.result)

    def recorded_traces(self) -> Mapping[str, NDArray[np.float64]]:
        """Return the states (N, 8) of its vehicles at the simulation steps from 0 on."""
        return {name: self.result.states_of(name) for name in self.result.setup.vehicle_ids}

    def save_recording(self, folder: FileName) -> Path:
        """
        Write the run as a recording and `game.yaml` into a folder, as a live run does.

        :return: the folder.
        :raises InputError: if the run has not kept its messages, the folder holds a recording or
            a game, or it cannot be written.
        """
        place = as_path(folder, 'folder')
        check_run_folder(place)
        write_recording(self.result, place)
        write_text(self.result.setup.game.dump(), place / GAME_FILE)
        return place


def run(game: Game | FileName | None = None, *,
        planner: PlannerLike | Sequence[PlannerLike] | None = None,
        options: Mapping[str, object] | None = None, driver: str | None = None,
        seed: int | None = None, duration_s: float | None = None, rate_hz: float | None = None,
        latency_steps: int = 0, triggers: Mapping[str, float] | None = None,
        problems: Sequence[int] = (), keep_messages: bool = False) -> OfflineRun:
    """
    Run a game on a virtual clock, planners in lockstep: equal arguments give equal states.

    :param game: the game, its file, or a CommonRoad scenario; None for the cut-in, or, where the
        driver is a recording, for its own game.
    :param planner: for all AVs, or one for each: a name, a class derived from `crgame_ros.Planner`
        or an object of one; None for those of the game.
    :param options: keyword arguments of the planner's constructor, instead of the game's.
    :param driver: of the first human: keys:FILE, joy:FILE, replay:BAG, idle; None: the game's.
    :param seed: of everything random; None: the game's.
    :param duration_s: simulated time; None: the game's, else 20 s [s]
    :param rate_hz: simulation rate; None: the game's [Hz]
    :param latency_steps: simulation steps between a request and its plan.
    :param triggers: events of the game to trigger, with times after the start [s]
    :param problems: planning problems that become AVs, if the game names no AVs.
    :param keep_messages: keep requests and plans, which `save_recording` needs.
    :raises InputError: if an argument cannot be used.
    """
    # With a recorded driver and no game, the recording's game is used.
    repeats = game is None and driver is not None and parse_source(driver).kind == 'replay'
    chosen = None if repeats else as_game(game)
    named = name_planners(planner)
    request = RunRequest(planners=named.names, driver=driver, duration_s=duration_s,
                         rate_hz=rate_hz, problems=tuple(problems))
    if seed is not None:
        chosen = _seeded(chosen, seed)
    with argument_names(), PLANNERS.giving(named.own):
        setup = effective_setup(request, chosen)
        named.check_objects(len(setup.avs))
        if options is not None:
            setup = _with_options(setup, options)
        name = setup.game.title or setup.loaded.benchmark_id
        return drive(name, setup, latency_steps, list((triggers or {}).items()),
                     keep_messages=keep_messages)


def drive(name: str, setup: Setup, latency_steps: int = 0,
          triggers: Sequence[tuple[str, float]] = (),
          say: Callable[[str], object] = lambda _: None,
          keep_messages: bool = False) -> OfflineRun:
    """
    Run a setup, with the recorded inputs of humans whose driver is a recording.

    :param name: displayed name of the run.
    :param latency_steps: simulation steps between a request and its plan.
    :param triggers: names of events, with their times after the start [s]
    :param say: called with each text about failing planners, and about progress.
    :param keep_messages: whether a recording of the run is wanted.
    :raises InputError: as `run_offline`; if the latency is negative, or a trigger has no time or
        names nothing of the game.
    """
    if latency_steps < 0:
        raise InputError(f'is {latency_steps}', 'latency', 'give 0 or more steps')
    known = [*(event.name for event in setup.game.events),
             *(task.name for task in setup.game.tasks)]
    for event, time_s in triggers:
        if event not in known:
            raise InputError(f'there is no event "{event[:40]}"', 'triggers',
                             f'the game has {", ".join(known) or "none"}')
        if not 0.0 <= time_s < 1e9:
            raise InputError(f'is {time_s} s', f'trigger {event}',
                             'give seconds after the start, 0 or more')
    drivers, intervals_s = recorded_inputs(setup)
    steps = [(round(time_s / setup.scheduler.dt_s), event) for event, time_s in triggers]
    began_s = time.perf_counter()
    result = run_offline(setup, latency_steps=latency_steps, drivers=drivers,
                         intervals_s=intervals_s, clock_s=time.perf_counter, triggers=steps,
                         say=say, progress=Progress(say, f'driving {name}'),
                         keep_messages=keep_messages)
    return OfflineRun(name, result, time.perf_counter() - began_s)


def _seeded(game: Game | None, seed: int) -> Game:
    if game is None:
        raise InputError('the game is that of the recording', 'seed', 'name a game')
    if isinstance(seed, bool) or not isinstance(seed, int) or not 0 <= seed < 2**63:
        raise InputError(f'is {seed}', 'seed', 'give a whole number from 0 to 2^63 - 1')
    return replace(game, seed=seed)


def _with_options(setup: Setup, options: Mapping[str, object]) -> Setup:
    avs = tuple(replace(av, spec=replace(av.spec, options=dict(options))) for av in setup.avs)
    return replace(setup, avs=avs, game=replace(setup.game, avs=tuple(av.spec for av in avs)))
