# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A run as a CommonRoad 2020a scenario: what happened, on the grid of its time steps."""

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import date
import errno
import os
from pathlib import Path
from typing import Any
from xml.sax.saxutils import quoteattr

from commonroad.scenario.scenario import ScenarioID
from crgame_ros.errors import CrgameError, InputError, one_line
from crgame_ros.paths import check_room
from crgame_ros.recording.export_objects import ObjectWriter
from crgame_ros.recording.export_problems import ProblemWriter
from crgame_ros.recording.run_log import RunLog
from crgame_ros.scenario import guard
from crgame_ros.scenario.export_elements import exact_number
from crgame_ros.scenario.export_ids import IdPool
from crgame_ros.scenario.export_network import schema_errors, used_ids, write_roads
from crgame_ros.scenario.loading import LoadedScenario, parse_scenario
from crgame_ros.scenario.recorded_humans import human_note, SOURCE_MARK, without_human_notes
from crgame_ros.whole_file import write_whole
from lxml import etree

_HEAD_BYTES = 4096
_ERRORS_TOLD = 3


@dataclass(frozen=True)
class ExportedScenario:
    """
    A run as a scenario.

    :param benchmark_id: its benchmark id.
    :param xml_text: the content of the file, valid by CommonRoad's schema.
    :param obstacle_ids: CommonRoad ids of the objects and vehicles in it, by their names.
    :param problem_ids: ids of the planning problems, by vehicle or recorded human; where nobody
        drove, by `problem` and number.
    :param notices: what it could not express, one line each.
    """

    benchmark_id: str
    xml_text: str
    obstacle_ids: dict[str, int]
    problem_ids: dict[str, int]
    notices: tuple[str, ...]


def export_scenario(log: RunLog, *, author: str | None = None, affiliation: str | None = None,
                    source: str | None = None, day: date | None = None) -> ExportedScenario:
    """
    Turn a run into a CommonRoad scenario.

    Time step 0 is the first step of the log. Humans, AVs and moving objects are dynamic obstacles
    whose states hold the pose of the centre; a vehicle's velocity is that of its rear axle, as in
    CommonRoad's KS model. An object that appears later, or again, is a phantom obstacle from then
    on, for the schema lets every dynamic obstacle begin at 0. Each driven vehicle has a planning
    problem: an AV's goal is its own, a human's where the drive ended. Where nobody drives, the
    problems of the scenario stay as they are.

    :param author: header entries; the original's where None, the source with a remark added.
    :param day: date of the run; that of the original where None.
    :raises InputError: if the run has no step, or its scenario cannot be written.
    :raises CrgameError: if the schema refuses the result.
    """
    if len(log.ks) < 2:
        raise InputError('the run has no scenario step', 'the run',
                         'let it last for a time step or more')
    loaded = parse_scenario(log.xml_text, '/scenario/xml')
    shift, notices = int(log.ks[0]), [*log.notices]
    if shift:
        notices.append(f'time step 0 is scenario step {shift} of the original')
    roads = write_roads(loaded, shift, notices)
    ids = IdPool(used_ids(roads.elements), notices)
    objects = ObjectWriter(log, ids, notices)
    writer = ProblemWriter(log, loaded, roads.lanelets, ids, notices)
    objects.write()
    problems = writer.text(objects.vehicle_rows)
    header = _header(log, loaded, len(writer.ids), notices)
    for name, value in (('author', author), ('affiliation', affiliation), ('source', source),
                        ('date', None if day is None else day.isoformat())):
        if value is not None:
            header[name] = value
    humans = {writer.ids[name]: objects.ids[name] for name in writer.humans}
    remark = f'{loaded.benchmark_id} {SOURCE_MARK}{human_note(humans)}'
    earlier = without_human_notes(header['source'])
    header['source'] = f'{earlier}; {remark}' if earlier else remark
    text = _document(header, roads.elements, objects.text() + problems)
    return ExportedScenario(header['benchmarkID'], text, objects.ids, writer.ids,
                            tuple(map(one_line, notices)))


def write_scenario(log: RunLog, out: Path, **header: Any) -> ExportedScenario:
    """
    Write a run as a CommonRoad scenario; the file is there whole or not at all.

    :param out: the file (`*.xml`), or the folder for `<benchmark id>.xml`.
    :param header: keyword arguments of `export_scenario`.
    :raises InputError: as `export_scenario`, and if the file cannot be written.
    :raises CrgameError: as `export_scenario`.
    """
    exported = export_scenario(log, **header)
    write_text(exported.xml_text, scenario_path(out, exported.benchmark_id))
    return exported


def scenario_path(out: Path, benchmark_id: str) -> Path:
    """
    Choose the file to write; an earlier export may be replaced, nothing else.

    :param out: as for `write_scenario`.
    :raises InputError: if a file that is no export has that name.
    """
    path = out if out.suffix == '.xml' else out / f'{benchmark_id}.xml'
    try:
        with path.open('rb') as stream:
            replaceable = SOURCE_MARK.encode() in stream.read(_HEAD_BYTES)
    except FileNotFoundError:
        return path
    except OSError as error:
        raise InputError(f'cannot be written ({error.strerror})', str(path),
                         'name another file or folder') from error
    if not replaceable:
        raise InputError('a file that is no exported run is there already', str(path),
                         'name another file or folder')
    return path


def prepare_folder(out: Path) -> None:
    """
    Make the folder of a file that is to be written later, and see that it can be written there.

    :param out: as for `write_scenario`.
    :raises InputError: if it can't.
    """
    folder = out.parent if out.suffix == '.xml' else out
    if out.suffix == '.xml' and out.exists():
        # Now, not after the run.
        scenario_path(out, '')
    try:
        folder.mkdir(parents=True, exist_ok=True)
        if not os.access(folder, os.W_OK | os.X_OK):
            raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))
        check_room(folder)
    except OSError as error:
        raise InputError(f'cannot be written to ({error.strerror})', str(folder),
                         'choose another folder') from error


def write_text(text: str, path: Path) -> None:
    """
    Write a file that is there whole or not at all.

    :raises InputError: if it cannot be written.
    """
    write_bytes(text.encode(), path)


def write_bytes(content: bytes, path: Path) -> None:
    """Write a file as `write_text` does."""
    try:
        write_whole(content, path)
    except OSError as error:
        raise InputError(f'cannot be written ({error.strerror})', str(path),
                         'choose a folder that can be written') from error


def _header(log: RunLog, loaded: LoadedScenario, problems: int,
            notices: list[str]) -> dict[str, str]:
    """Return the attributes of the file, as far as they follow from run and original."""
    original = guard.parse_hardened(log.xml_text, loaded.source)
    found: ScenarioID = loaded.scenario.scenario_id
    # The same map and configuration with one prediction; `C-` marks several planning problems.
    benchmark_id = str(ScenarioID(problems > 1, found.country_id, found.map_name, found.map_id,
                                  found.configuration_id or 1, 'T', 1))
    given = original.get('benchmarkID', '')
    if given != loaded.benchmark_id:
        notices.append(f'the malformed benchmark id {given[:60]!r} became {benchmark_id}')
    day = original.get('date', '')
    return {
        'timeStepSize': exact_number(log.game.scheduler.time_step_s),
        'commonRoadVersion': '2020a', 'author': original.get('author', ''),
        'affiliation': original.get('affiliation', ''), 'source': original.get('source', ''),
        'benchmarkID': benchmark_id, 'date': day if _is_date(day) else '1970-01-01'}


def _is_date(text: str) -> bool:
    try:
        return date.fromisoformat(text).isoformat() == text
    except ValueError:
        return False


def _document(header: dict[str, str], network: Sequence[etree._Element], rest: str) -> str:
    """
    Put the file together.

    :raises CrgameError: if the schema does not accept it.
    """
    attributes = ' '.join(f'{name}={quoteattr(value)}' for name, value in header.items())
    roads = ''.join(etree.tostring(element, encoding='unicode').rstrip() + '\n'
                    for element in network)
    text = (f"<?xml version='1.0' encoding='UTF-8'?>\n<commonRoad {attributes}>\n"
            f'{roads}{rest}</commonRoad>\n')
    try:
        errors = schema_errors(etree.fromstring(text.encode('utf-8'),
                                                etree.XMLParser(huge_tree=True)))
    except etree.XMLSyntaxError as error:
        errors = [str(error)]
    if errors:
        raise CrgameError('the exported scenario would break the CommonRoad schema: '
                          + '; '.join(errors[:_ERRORS_TOLD]))
    return text
