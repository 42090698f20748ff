# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Marks and finds the planning problems of humans in an exported run.

An exported file has a planning problem for every driven vehicle. The attribute `source` states
which of them a human drove, and which obstacle has the recorded drive. The schema accepts any text
there, and commonroad-io preserves it on reading and writing, unlike comments.
"""

from collections.abc import Mapping
from pathlib import Path
import re

from crgame_ros.scenario import guard

# Text in the source of every exported file, which identifies such files.
SOURCE_MARK = 'driven in crgame_ros'
_NOTE = re.compile(r' \(humans?: ([^()]*)\)')
_HUMAN = re.compile(r'planning problem (\d{1,18}) is obstacle (\d{1,18})')


def human_note(humans: Mapping[int, int]) -> str:
    """
    Return the text that follows `SOURCE_MARK`; empty without humans.

    :param humans: obstacle ids by planning problem.
    """
    if not humans:
        return ''
    told = ', '.join(f'planning problem {number} is obstacle {obstacle}'
                     for number, obstacle in humans.items())
    return f' ({"human" if len(humans) == 1 else "humans"}: {told})'


def without_human_notes(source: str) -> str:
    """Return a source without the notes of earlier runs, which hold for their own files only."""
    return _NOTE.sub('', source)


def read_human_note(source: str) -> dict[int, int]:
    """
    Return the humans in a note of `human_note`.

    :param source: attribute of the file.
    :return: obstacle ids by planning problem.
    """
    mark = source.rfind(SOURCE_MARK)
    note = _NOTE.match(source, mark + len(SOURCE_MARK)) if mark >= 0 else None
    return {} if note is None else {
        int(problem): int(obstacle) for problem, obstacle in _HUMAN.findall(note[1])}


def plays_its_humans(path: Path) -> bool:
    """
    Return whether a file is an exported run whose humans play back while its AVs drive.

    :raises InputError: if it cannot be read.
    """
    root = guard.parse_hardened(guard.read_text(path), str(path))
    humans = read_human_note(root.get('source', ''))
    problems = {problem.get('id') for problem in root.iterchildren('planningProblem')}
    return bool(humans) and not problems <= {str(number) for number in humans}
