# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Checks whether files are valid, each kind in the way in which the program itself checks it."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
import json
from pathlib import Path
import re

from crgame_ros.errors import CrgameError, InputError, one_line
from crgame_ros.game.game import Game
from crgame_ros.recording.epochs import epoch_numbers
from crgame_ros.recording.exceptions import RunTooShortError
from crgame_ros.recording.info import describe
from crgame_ros.recording.metadata import METADATA_FILE
from crgame_ros.recording.reader import BagReader
from crgame_ros.recording.run_folder import (
    bags_of,
    PACKAGE_FILE,
    PARTICIPANTS,
    recording_in,
    run_folders,
    STUDY_FILE,
)
from crgame_ros.recording.run_trajectories import read_trajectories
from crgame_ros.recording.timing_report import REPORT_KEYS
from crgame_ros.scenario import guard
from crgame_ros.scenario.export_network import schema_errors, solution_schema_errors
from crgame_ros.scenario.loading import parse_scenario
from crgame_ros.schema.declaration import known_keys
from crgame_ros.schema.file_kinds import FILE_KINDS, FileKind
from crgame_ros.schema.reading import faults_of
from crgame_ros.schema.writing import write
from crgame_ros.simulation.setup import build_setup
from crgame_ros.timing.late_steps import LATE_KEYS
from crgame_ros.variation.space import space_of
from crgame_ros.yaml_text import read_text, read_yaml

Progress = Callable[[float], object]
# Folder of a run's tables, within that of the run.
TABLES = 'tables'
_RECORDINGS = ('.mcap', '.db3')
_SHOWN = 20
# The root element of an XML file is searched for in so many characters.
_HEAD = 10_000
_SOLUTION = re.compile('<CommonRoadSolution[ >]')
_FILES, _WORDS = 'files', re.compile(r'words\..*\.yaml')
# A journal has a line for each entry, and answers can be long [bytes].
_LONGEST_JOURNAL = 200_000_000


@dataclass(frozen=True)
class FileVerdict:
    """
    The result of checking a file.

    :param kind: kind of the file, in a few words.
    :param faults: one line each; empty for a valid file.
    :param remarks: notes on a valid file, one line each.
    """

    kind: str
    faults: tuple[str, ...] = ()
    remarks: tuple[str, ...] = ()


_Check = Callable[[Path, Progress | None], FileVerdict]


def validate(path: Path, progress: Progress | None = None) -> FileVerdict:
    """
    Check a file, or the folder of a recording, a run or tables.

    :param progress: called with the share read so far, 0 to 1, where reading takes long.
    :raises InputError: if there is no such file, or its kind is unknown.
    """
    if not path.exists():
        raise InputError('no such file or folder', str(path), 'check the name')
    name, check = _check_of(path)
    try:
        return check(path, progress)
    except CrgameError as error:
        return FileVerdict(name, (str(error),))


def parts_of(path: Path) -> list[Path]:
    """Return the files to check at a path: for the folder of a run or study, all its files."""
    if (path / STUDY_FILE).is_file():
        return list(_parts_of_study(path))
    if not path.is_dir() or recording_in(path) == path:
        return [path]
    tables = [path / TABLES] if (path / TABLES / PACKAGE_FILE).exists() else []
    return [recording_in(path), *tables, *_files_of_run(path)]


def _parts_of_study(path: Path) -> Iterator[Path]:
    """Yield study, questionnaires, journals, games, runs and tables."""
    study = (path / STUDY_FILE).parent
    # Games may refer to any file; only scenarios among these can be checked by themselves.
    yield from sorted(file for file in study.rglob('*.yaml') if not _WORDS.fullmatch(file.name)
                      and study / _FILES not in file.parents)
    yield from sorted((study / _FILES).rglob('*.xml'))
    for person in sorted((path / PARTICIPANTS).glob('*/')):
        yield from sorted(person.glob('*.jsonl'))
        yield from sorted((person / 'games').glob('*.yaml'))
        for session in sorted((person / 'runs').glob('*/')):
            for run in run_folders(session):
                yield from bags_of(run)
                yield from _files_of_run(run)
    yield from sorted(file.parent for file in (path / 'data').rglob(PACKAGE_FILE)
                      if not (file.parent / 'evaluation.json').exists())


def _files_of_run(folder: Path) -> list[Path]:
    """Return a run's files that have a kind: scenarios, its game, timing reports."""
    return sorted(file for file in folder.iterdir() if file.suffix in ('.xml', '.yaml')
                  or file.match('timing*.json'))


def _check_of(path: Path) -> tuple[str, _Check]:
    """Return the name of a file's kind, and how it is checked."""
    if path.is_dir():
        if (path / PACKAGE_FILE).exists():
            return 'tables', _tables
        bag = recording_in(path)
        if (bag / METADATA_FILE).exists() or any(
                file.suffix in _RECORDINGS for file in bag.iterdir()):
            return 'recording', _recording
        raise InputError('holds neither a recording nor tables', str(path),
                         'name a file, or the folder of a run, of a recording or of tables')
    known: dict[str, tuple[str, _Check]] = {
        '.xml': ('XML file', _scenario), '.json': ('JSON file', _timing),
        '.yaml': ('YAML file', _yaml), '.yml': ('YAML file', _yaml),
        '.jsonl': ('journal of a session', _journal),
        **dict.fromkeys(_RECORDINGS, ('recording', _recording))}
    if path.suffix.lower() not in known:
        raise InputError(f'no kind of file is known by "{path.suffix}"', str(path),
                         'name one of .xml, .yaml, .json, .jsonl, .mcap or .db3')
    return known[path.suffix.lower()]


def _scenario(path: Path, _progress: Progress | None) -> FileVerdict:
    """Check a scenario by the schema of its version, if that is known, and by reading it."""
    source = str(path)
    text = guard.read_text(path)
    if _SOLUTION.search(text[:_HEAD]) is not None:
        return _solution(path, _progress)
    root = guard.parse_hardened(text, source)
    version = root.get('commonRoadVersion') or 'unknown'
    kind = f'CommonRoad scenario of version {version}'
    errors = schema_errors(root) if version == '2020a' else []
    faults = [f'{source}: {one_line(each)}' for each in errors[:_SHOWN]]
    if len(errors) > _SHOWN:
        faults.append(f'{source}: {len(errors) - _SHOWN} more by the schema')
    remarks = [] if version == '2020a' else [
        f'only the schema of 2020a is at hand: read, and not checked by that of {version}']
    try:
        remarks += parse_scenario(text, source).notices
    except InputError as error:
        faults.append(str(error))
    return FileVerdict(kind, tuple(faults), tuple(remarks))


def _solution(path: Path, _progress: Progress | None) -> FileVerdict:
    """Check a solution by its schema, and by reading it."""
    # Imported here because it reads the files of four vehicles.
    from crgame_ros.analysis.scores.solution_file import read_solution, ROOT
    source = str(path)
    root = guard.parse_hardened(guard.read_text(path), source, ROOT)
    faults = [f'{source}: {one_line(each)}' for each in solution_schema_errors(root)[:_SHOWN]]
    try:
        solved = len(read_solution(path).planning_problem_solutions)
    except InputError as error:
        return FileVerdict('CommonRoad solution', (*faults, str(error)))
    return FileVerdict(f'CommonRoad solution of {solved} planning problems', tuple(faults))


def _tables(path: Path, _progress: Progress | None) -> FileVerdict:
    """Check exported tables by their dictionary."""
    from crgame_ros.analysis.tables.data_package import table_faults
    count, faults = table_faults(path)
    return FileVerdict(f'{count} tables', tuple(faults[:_SHOWN]))


def _journal(path: Path, _progress: Progress | None) -> FileVerdict:
    """Check that each whole line is an entry, as a session reads it; the first begins it."""
    from crgame_ros.study.session_journal import read_entry, SessionEvent
    text = read_text(path, 'journal', max_bytes=_LONGEST_JOURNAL)
    faults, count = [], 0
    lines = text.split('\n')
    if lines.pop():
        faults.append(f'{path}: its last line was cut off; the next start of the session drops it')
    for number, line in enumerate(lines, 1):
        try:
            entry = read_entry(line)
        except ValueError as error:
            faults.append(f'{path}: line {number} cannot be read as an entry ({error})')
            continue
        count += 1
        if (number == 1) != (entry['entry'] == SessionEvent.BEGUN):
            faults.append(f'{path}: line {number}: a session begins once, in the first line')
    if not count:
        raise InputError('holds no entry', str(path), 'name the journal of a participant')
    return FileVerdict(f'journal of a session of {count} entries', tuple(faults[:_SHOWN]))


def _yaml(path: Path, _progress: Progress | None) -> FileVerdict:
    """Check a file that users write; check a game together with its scenario, as before a run."""
    values = read_yaml(path, 'file')
    file_kind, wrong = _yaml_kind(values, path)
    faults = [str(error) for error in wrong]
    remarks: tuple[str, ...] = ()
    if file_kind.declared is Game and not faults:
        from crgame_ros.game.game import parse_game
        try:
            game = parse_game(values, str(path), path.parent)
            if game.expect:
                from crgame_ros.evaluation.judging import check_expectations
                check_expectations(game, str(path))
            remarks = build_setup(game).notices
            if game.vary:
                space_of(write(game, game.base), str(path)).check(game.base, str(path))
        except InputError as error:
            faults.append(str(error))
    return FileVerdict(file_kind.title.lower(), tuple(faults[:_SHOWN]), remarks)


def _yaml_kind(values: object, path: Path) -> tuple[FileKind, tuple[InputError, ...]]:
    """Choose the kind of file that declares most of the keys and has the fewest faults."""
    given = values.keys() if isinstance(values, dict) else set()
    shares = {name: len(given & set(known_keys(kind.declared)))
              for name, kind in FILE_KINDS.items()}
    most = max(shares.values())
    if not most:
        raise InputError('has no keys of a game or of any other kind of file', str(path),
                         'see `crgame schema --help` for the kinds')
    found = [(kind, faults_of(kind.declared, values, str(path), path.parent))
             for name, kind in FILE_KINDS.items() if shares[name] == most]
    return min(found, key=lambda each: len(each[1]))


def _timing(path: Path, _progress: Progress | None) -> FileVerdict:
    """Check a timing report for the keys that every report has."""
    try:
        content = json.loads(read_text(path, 'JSON file'))
    except (ValueError, RecursionError) as error:
        raise InputError(f'is no JSON ({error})', str(path)) from error
    missing = sorted(REPORT_KEYS - content.keys()) if isinstance(content, dict) else ['everything']
    if isinstance(content, dict) and (late := content.get('late_steps')) is not None:
        # Earlier versions did not write these keys.
        missing += [f'late_steps.{key}' for key in sorted(
            LATE_KEYS - late.keys() if isinstance(late, dict) else LATE_KEYS)]
    return FileVerdict('timing report', tuple(
        [f'{path}: lacks {", ".join(missing)}'] if missing else ()))


def _recording(path: Path, progress: Progress | None) -> FileVerdict:
    """Check that a recording is finished, describes itself and lacks nothing."""
    bag = recording_in(path)
    info = describe(bag)
    kind = f'recording of {info.duration_s:.1f} s in {info.storage}'
    faults, remarks = [], list(info.notices)
    if not info.complete:
        faults.append(f'{bag}: was cut off; `crgame recover` finishes it')
    if info.game is None:
        faults.append(f'{bag}: no /scenario/game in it: record from before the start of the run')
        return FileVerdict(kind, tuple(faults), tuple(remarks))
    if info.cycles is not None and info.cycles.missing:
        faults.append(f'{bag}: {info.cycles.missing} cycles are missing: it cannot be repeated to '
                      'the last bit')
    with BagReader(bag, parts=True) as reader:
        epochs = epoch_numbers(reader)
    for number, epoch in enumerate(epochs):
        try:
            log = read_trajectories(bag, epoch, progress)
            remarks += [f'run {number + 1}: {notice}' for notice in log.notices]
        except RunTooShortError as error:
            remarks.append(str(error))
        except InputError as error:
            faults.append(f'run {number + 1}: {error}')
    return FileVerdict(kind, tuple(faults), tuple(dict.fromkeys(remarks)))
