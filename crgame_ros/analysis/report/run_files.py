# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The files of an offline run that people look at: report, recording, scenario, game."""

from pathlib import Path

from crgame_ros.analysis.report.command import REPORT_FILE
from crgame_ros.analysis.report.file import write_report
from crgame_ros.analysis.runs.run import Run
from crgame_ros.game.game import Game
from crgame_ros.recording.export import write_scenario
from crgame_ros.recording.offline_recording import write_recording
from crgame_ros.recording.run_folder import GAME_FILE
from crgame_ros.simulation.offline import OfflineResult
from crgame_ros.whole_file import write_text


def write_run_files(run: Run, result: OfflineResult, game: Game, folder: Path) -> None:
    """
    Write the report, the recording and the CommonRoad scenario of a run, and its game.

    :param result: the run, with its messages.
    :param game: that is written, with which it is run again.
    :param folder: that exists; earlier files of these names are replaced.
    :raises InputError: if they cannot be written.
    """
    write_report([run], folder / REPORT_FILE)
    write_recording(result, folder, replace=True)
    write_scenario(run.log, folder)
    write_text(game.dump(), folder / GAME_FILE)
