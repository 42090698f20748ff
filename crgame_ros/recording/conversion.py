# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Converts a recording to a file of another format: CommonRoad or OpenSCENARIO."""

from collections.abc import Callable
from dataclasses import replace
from datetime import date, datetime, UTC
import os
from pathlib import Path

from crgame_ros.errors import InputError
from crgame_ros.recording.epochs import epoch_numbers, XML_TOPIC
from crgame_ros.recording.exceptions import RunTooShortError
from crgame_ros.recording.export import ExportedScenario, scenario_path, write_scenario
from crgame_ros.recording.reader import BagReader
from crgame_ros.recording.run_formats import OPENSCENARIO, require_openscenario
from crgame_ros.recording.run_trajectories import read_trajectories, RunTrajectories
from crgame_ros.scenario.loading import parse_scenario
from crgame_ros.whole_file import write_text


def convert(bag: Path, out: Path | None = None, epoch: int | None = None,
            progress: Callable[[float], object] | None = None) -> tuple[Path, ExportedScenario]:
    """
    Write the scenario of a recorded run.

    :param bag: a recording of ours or of `ros2 bag record`, finished or cut off.
    :param out: the file (`*.xml`) or the folder for `<benchmark id>.xml`; None puts it beside the
        recording.
    :param epoch: which run, where the recording holds several; None for the last that began.
    :param progress: as for `read_trajectories`.
    :return: the file, and what is in it; its notices also name what is missing of the run.
    :raises RunTooShortError: if the run ended before its second scenario step.
    :raises InputError: if there is no run in it, or a file that is no export has the name.
    :raises CrgameError: if the result violates the schema; nothing is written then.
    """
    log = (read_last_run(bag, progress) if epoch is None
           else read_trajectories(bag, epoch, progress))
    return convert_log(log, bag, out)


def convert_log(log: RunTrajectories, bag: Path,
                out: Path | None = None) -> tuple[Path, ExportedScenario]:
    """
    Write the scenario of a run that has been read; parameters and errors as for `convert`.

    :param log: the run.
    """
    return write_scenario(log, bag.resolve().parent if out is None else out, day=day_of(bag))


def convert_to_openscenario(bag: Path, out: Path | None = None, epoch: int | None = None,
                            progress: Callable[[float], object] | None = None,
                            road: Path | None = None) -> tuple[Path, tuple[str, ...]]:
    """
    Write a recorded run as OpenSCENARIO; parameters and errors as for `convert`.

    :param out: the file (`*.xosc`) or the folder for `<benchmark id>.xosc`, as above.
    :param road: an OpenDRIVE file of its roads.
    :return: the file, and the parts that it does not express, one line each.
    :raises InputError: also if the library for it is not installed.
    """
    _check_road(road)
    require_openscenario()
    log = (read_last_run(bag, progress) if epoch is None
           else read_trajectories(bag, epoch, progress))
    return write_openscenario(log, bag.resolve().parent if out is None else out,
                              day=day_of(bag), road=road)


def write_openscenario(log: RunTrajectories, out: Path, *, day: date | None = None,
                       road: Path | None = None) -> tuple[Path, tuple[str, ...]]:
    """
    Write a run as OpenSCENARIO, completely or not at all.

    :param out: the file (`*.xosc`) or the folder for `<benchmark id>.xosc`.
    :param day: date of the run; that of the original if None.
    :param road: an OpenDRIVE file of its roads, which the file names relative to its own folder.
    :return: the file, and the parts that it does not express, one line each.
    :raises InputError: if the library for it is not installed, the run has no step, or the file
        cannot be written.
    :raises CrgameError: if the result violates the schema; nothing is written then.
    """
    _check_road(road)
    require_openscenario()
    from crgame_ros.recording.openscenario import export_openscenario
    name = log.game.benchmark_id or parse_scenario(log.xml_text, XML_TOPIC).benchmark_id
    path = scenario_path(out, name, OPENSCENARIO)
    text, notices = export_openscenario(log, name, day=day, road=None if road is None else Path(
        os.path.relpath(road.resolve(), path.parent.resolve())).as_posix())
    write_text(text, path)
    return path, notices


def read_last_run(bag: Path, progress: Callable[[float], object] | None = None) -> RunTrajectories:
    """
    Read the last run of a recording that has begun; a notice names those that have not.

    :param progress: as for `read_trajectories`.
    :raises RunTooShortError: if none has.
    :raises InputError: as `read_trajectories`.
    """
    with BagReader(bag, parts=True) as reader:
        epochs = epoch_numbers(reader)
    told: list[str] = []
    for epoch in reversed(epochs):
        try:
            log = read_trajectories(bag, epoch, progress)
        except RunTooShortError as error:
            told.append(error.what)
            refusal = error
            continue
        others = ', '.join(str(other) for other in epochs[:epochs.index(epoch)])
        if others:
            told.append(f'this is epoch {epoch}; the recording holds {others} as well (--epoch)')
        return replace(log, notices=(*told, *log.notices))
    raise refusal


def _check_road(road: Path | None) -> None:
    if road is not None and not road.is_file():
        raise InputError('there is no such file', str(road), 'name an OpenDRIVE file')


def day_of(bag: Path) -> date | None:
    """Return the day on which a recording began, in UTC; None for that of an offline run."""
    with BagReader(bag, parts=True) as reader:
        return None if reader.has_virtual_clock else datetime.fromtimestamp(
            reader.start_ns * 1e-9, UTC).date()
