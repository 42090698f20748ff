# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A recorded human: a game driven once, live or offline, and its repetition with any planner."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
import sys
import time

from crgame_ros.analysis.counterfactual import Alternative, drive_against
from crgame_ros.errors import CrgameError
from crgame_ros.launcher.arguments import RunRequest
from crgame_ros.launcher.interruption import run_to_its_end
from crgame_ros.launcher.run_plan import effective_setup
from crgame_ros.recording.recorded_game import inputs_of, RecordedInputs
from crgame_ros.recording.run_folder import recording_in
from crgame_ros.recording.run_trajectories import (
    read_trajectories,
    RunTrajectories,
    trajectories_of,
)
from crgame_ros.simulation.offline import run_offline
from crgame_ros.simulation.setup import Setup


@dataclass(frozen=True)
class RecordedHuman:
    """
    A recorded run of a game, whose human can be repeated.

    :param name: name of the game.
    :param log: the run.
    :param setup_for: returns the same game with the recorded human and the planner of a name.
    :param inputs: inputs of the human; None where the setup names the recording with them.
    :param live: the run itself, if it was live.
    """

    name: str
    log: RunTrajectories
    setup_for: Callable[[str], Setup]
    inputs: RecordedInputs | None
    live: Alternative | None = None

    @property
    def duration_s(self) -> float:
        """Return the duration on the scenario's time line [s]."""
        return (len(self.log.ks) - 1) * self.log.game.scheduler.time_step_s

    def against(self, planner: str) -> Alternative:
        """
        Repeat the human, with a planner that drives all AVs.

        :raises InputError: if there is no such planner.
        """
        return drive_against(planner, self.setup_for(planner), self.log, inputs=self.inputs)


def record_offline(game: Path, planner: str, duration_s: float | None = None) -> RecordedHuman:
    """
    Run a game with its scripted driver on a virtual clock.

    :param duration_s: None for the game's own [s]
    :raises InputError: if game or planner cannot be used.
    """
    def setup_for(name: str) -> Setup:
        return effective_setup(RunRequest(game=game, planners=(name,)))

    result = run_offline(setup_for(planner), duration_s=duration_s, clock_s=time.perf_counter)
    return RecordedHuman(game.stem, trajectories_of(result), setup_for, inputs_of(result))


def read_recorded(name: str, planner: str, folder: Path) -> RecordedHuman:
    """
    Read a live run.

    :param name: name of its game.
    :param planner: planner that drove the AVs.
    :param folder: folder of the run.
    :raises InputError: if its recording cannot be used.
    """
    bag = recording_in(folder)

    def setup_for(other: str) -> Setup:
        return effective_setup(RunRequest(driver=f'replay:{bag}', planners=(other,)))

    log = read_trajectories(bag)
    return RecordedHuman(name, log, setup_for, None, Alternative.of_live(planner, folder, log))


def run_live(game: Path, planner: str, folder: Path, duration_s: float | None = None) -> None:
    """
    Run a game with its scripted driver in real time, without the page.

    :param folder: folder of the run; must not exist.
    :param duration_s: None for the game's own [s]
    :raises InputError: if game, planner or folder cannot be used.
    :raises CrgameError: if the run failed; its messages are on the terminal.
    """
    # Checked before any process starts, so that an error is reported in one line.
    effective_setup(RunRequest(game=game, planners=(planner,)))
    code = run_to_its_end([
        sys.executable, '-m', 'crgame_ros.launcher.main', str(game), '--headless',
        '--planner', planner, '--out', str(folder),
        *([] if duration_s is None else ['--duration', repr(duration_s)])])
    if code:
        raise CrgameError(f'the live run of {game.name} ended with {code}; what it '
                          f'said is above, its files are in {folder}; --offline needs no ROS')
