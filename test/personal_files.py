# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The files that docs/personal_data.md lists, compared with those of a study."""

from fnmatch import fnmatchcase
from pathlib import Path
import re

PAGE = Path(__file__).resolve().parents[1] / 'docs' / 'personal_data.md'


def listed_files() -> list[str]:
    """Return the patterns of the table."""
    rows = PAGE.read_text('utf-8').partition('## Where it lies')[2].partition('## How')[0]
    return [pattern for row in rows.splitlines() if row.startswith('| `')
            for pattern in re.findall('`([^`]+)`', row.split('|')[1])]


def unlisted_files(study: Path) -> list[str]:
    """Return the files of a study that the page does not list."""
    patterns = listed_files()
    names = [path.relative_to(study).as_posix() for path in study.rglob('*') if path.is_file()]
    assert names and patterns
    return [name for name in names if not any(fnmatchcase(name, each) for each in patterns)]
