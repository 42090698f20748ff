# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The files of a study's folder that can be checked, and the check of its journals."""

from collections.abc import Iterator
import json
import math
from pathlib import Path
import re
from typing import Any

from crgame_ros.analysis.tables.data_package import PACKAGE_FILE
from crgame_ros.errors import InputError
from crgame_ros.recording.run_folder import bags_of, run_folders
from crgame_ros.yaml_text import read_text

STUDY_FILE = Path('study', 'study.yaml')
_FILES, _WORDS = 'files', re.compile(r'words\..*\.yaml')
# A line for each thing that happened; answers are long at times [bytes].
_LONGEST_JOURNAL = 200_000_000


def is_study(path: Path) -> bool:
    """Return whether a folder is that of a study that people take part in."""
    return (path / STUDY_FILE).is_file()


def study_parts(path: Path) -> list[Path]:
    """Return what is to be checked: study, questionnaires, journals, games, runs, tables."""
    return list(_parts(path))


def _parts(path: Path) -> Iterator[Path]:
    study = (path / STUDY_FILE).parent
    # What games name may be anything; of that, scenarios can be checked by themselves.
    yield from sorted(file for file in study.rglob('*.yaml') if not _WORDS.fullmatch(file.name)
                      and study / _FILES not in file.parents)
    yield from sorted((study / _FILES).rglob('*.xml'))
    for person in sorted((path / 'participants').glob('*/')):
        yield from sorted(person.glob('*.jsonl'))
        yield from sorted((person / 'games').glob('*.yaml'))
        for session in sorted((person / 'runs').glob('*/')):
            for run in run_folders(session):
                yield from bags_of(run)
                yield from sorted(file for file in run.iterdir() if file.suffix in (
                    '.xml', '.yaml') or file.name.startswith('timing') and file.suffix == '.json')
    yield from sorted(file.parent for file in (path / 'data').rglob(PACKAGE_FILE)
                      if not (file.parent / 'evaluation.json').exists())


def journal_faults(path: Path) -> tuple[int, list[str]]:
    """
    Check a journal: whole lines, each an entry with its time; the first begins the session.

    :return: the number of entries, and what is wrong, one line each.
    :raises InputError: if it cannot be read.
    """
    text = read_text(path, 'journal', max_bytes=_LONGEST_JOURNAL)
    faults, count = [], 0
    lines = text.split('\n')
    if lines.pop():
        faults.append(f'{path}: its last line was cut off; the next start of the session drops it')
    for number, line in enumerate(lines, 1):
        try:
            entry: Any = json.loads(line)
            kind, at = entry['entry'], entry['at']
            if not isinstance(kind, str) or not math.isfinite(at):
                raise ValueError('entry or time')
        except (ValueError, LookupError, TypeError, RecursionError):
            faults.append(f'{path}: line {number} is no entry with its time')
            continue
        count += 1
        if (number == 1) != (kind == 'begun'):
            faults.append(f'{path}: line {number}: a session begins once, in the first line')
    if not count:
        raise InputError('holds no entry', str(path), 'name the journal of a participant')
    return count, faults
