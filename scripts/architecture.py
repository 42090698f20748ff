#!/usr/bin/env python3
# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Draw the package's folders and their imports into docs/architecture.md and its picture.

FOLDERS is the order: a folder imports from those above it in the list only. A test checks it;
the sentence beside each folder is its own docstring.
"""

import ast
from collections import Counter
from functools import cache
from pathlib import Path
import sys

from written import between, main_of

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = ROOT / 'crgame_ros'
DOCUMENT = ROOT / 'docs' / 'architecture.md'
PICTURE = ROOT / 'docs' / 'images' / 'architecture.svg'
# Files of the package's own folder that all folders may import, and those that use all folders.
LOWEST, HIGHEST = 'errors, paths, …', 'cli, doctor'
AT_THE_TOP = {'cli', 'doctor', 'models_command', 'new_command', 'replay_command',
              'schema_command'}
FOLDERS = (
    LOWEST, 'schema', 'library', 'geometry', 'vehicle', 'game', 'roads', 'scenario', 'waypoints',
    'variation', 'occupancy', 'scripted', 'messages', 'driver', 'timing', 'drivability', 'control',
    'planner', 'perception', 'policy', 'traffic/compiling', 'traffic/lanes', 'traffic/fleet',
    'traffic/motion', 'traffic/following', 'traffic/crossing', 'traffic/changing', 'traffic',
    'instruments', 'simulation', 'recording', 'worlds', 'analysis/criticality',
    'analysis/behaviour', 'analysis/rules', 'analysis/blame', 'analysis/scores',
    'analysis/pictures', 'analysis/runs', 'analysis/tables', 'analysis/report', 'analysis',
    'evaluation/results', 'evaluation/summary', 'evaluation', 'study', 'study/analysis',
    'study/data', 'cockpit', 'cockpit/runs', 'study/desk', 'gym', 'ros', 'nodes/sim',
    'nodes/cockpit', 'nodes/markers', 'nodes', 'launcher', 'submission', 'verdict', 'search',
    'study/conduct', 'reproduction', 'python_interface', HIGHEST)
# Of the picture [px].
CELL, NAMES, TOP = 22, 150, 120


def modules() -> dict[str, Path]:
    """Return every module of the package, by its dotted name."""
    return {'.'.join(path.relative_to(ROOT).with_suffix('').parts).removesuffix('.__init__'): path
            for path in sorted(PACKAGE.rglob('*.py'))}


def folder_of(path: Path) -> str:
    """Return the folder that a file belongs to."""
    folder = path.parent.relative_to(PACKAGE).as_posix()
    if folder != '.':
        return folder
    return HIGHEST if path.stem in AT_THE_TOP else LOWEST


def imports() -> dict[tuple[str, str], list[str]]:
    """Return what folders import from other folders, as `file imports module`; by both folders."""
    known = modules()
    found: dict[tuple[str, str], list[str]] = {}
    for path in known.values():
        # The package's own file loads a module only when it is used.
        for name in sorted(imported_by(path, known)) if path != PACKAGE / '__init__.py' else ():
            pair = folder_of(path), folder_of(known[name])
            if pair[0] != pair[1]:
                found.setdefault(pair, []).append(
                    f'{path.relative_to(ROOT).as_posix()} imports {name}')
    return found


def imported_by(path: Path, known: dict[str, Path]) -> set[str]:
    """Return the modules of the package that a file imports, within functions as well."""
    # A name may be a module of the folder.
    return {name if (name := f'{module}.{item}') in known else module
            for module, item in imported_names(path)} & set(known)


@cache
def imported_names(path: Path) -> frozenset[tuple[str, str]]:
    """Return what a file imports: modules, each with a name from it, or with an empty one."""
    found: set[tuple[str, str]] = set()
    for node in ast.walk(ast.parse(path.read_text(encoding='utf-8'))):
        if isinstance(node, ast.Import):
            found |= {(item.name, '') for item in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            found |= {(node.module, item.name) for item in node.names}
    return frozenset(found)


def sentence(folder: str) -> str:
    """Return the sentence of a folder's own docstring."""
    if folder == LOWEST:
        return 'What everybody uses: errors, paths, the registry, guarded YAML.'
    if folder == HIGHEST:
        return 'The command `crgame`, and what it finds wrong with an installation.'
    text = ast.get_docstring(ast.parse((PACKAGE / folder / '__init__.py').read_text('utf-8')))
    assert text is not None, folder
    return text.splitlines()[0]


def table(counts: Counter[tuple[str, str]]) -> str:
    """Return the list of the folders as Markdown."""
    rows = ['| folder | files | what it is | imports from |', '|---|---|---|---|']
    for folder in FOLDERS:
        files = sum(folder_of(path) == folder and path.stem != '__init__'
                    for path in modules().values())
        below = [name for name in FOLDERS[:FOLDERS.index(folder)]
                 if counts[folder, name] and name != LOWEST]
        rows.append(f'| `{folder}` | {files} | {sentence(folder)} | {", ".join(below)} |')
    return '\n'.join(rows)


def picture(counts: Counter[tuple[str, str]]) -> str:
    """Return the folders as a matrix: a row's folder imports from the columns' (SVG)."""
    size = len(FOLDERS) * CELL
    most = max(counts.values())
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{NAMES + size + 20}" '
        f'height="{TOP + size + 20}" font-family="sans-serif" font-size="12">',
        '<rect width="100%" height="100%" fill="#ffffff"/>']
    for i, folder in enumerate(FOLDERS):
        place = TOP + i * CELL
        if i % 2:
            parts.append(f'<rect x="0" y="{place}" width="{NAMES + size}" height="{CELL}" '
                         'fill="#f4f6f8"/>')
        parts.append(f'<text x="{NAMES - 8}" y="{place + 15}" text-anchor="end">{folder}</text>')
        across = NAMES + i * CELL + 15
        parts.append(f'<text transform="translate({across},{TOP - 8}) rotate(-60)">'
                     f'{folder}</text>')
        parts.append(f'<rect x="{NAMES + i * CELL}" y="{place}" width="{CELL}" height="{CELL}" '
                     'fill="#c8cfd6"/>')
    for (row, column), count in sorted(counts.items()):
        x = NAMES + FOLDERS.index(column) * CELL
        y = TOP + FOLDERS.index(row) * CELL
        below = FOLDERS.index(column) < FOLDERS.index(row)
        color = '#0b62a8' if below else '#c0262d'
        shade = 0.25 + 0.75 * (count / most) ** 0.5
        parts.append(
            f'<rect x="{x + 1}" y="{y + 1}" width="{CELL - 2}" height="{CELL - 2}" rx="3" '
            f'fill="{color}" fill-opacity="{shade:.2f}"><title>{row} imports from {column}: '
            f'{count}</title></rect>')
        parts.append(f'<text x="{x + CELL / 2:g}" y="{y + 15}" text-anchor="middle" '
                     f'font-size="10" fill="{"#ffffff" if shade > 0.55 else "#10202c"}">'
                     f'{count}</text>')
    return '\n'.join([*parts, '</svg>', ''])


def files() -> dict[Path, str]:
    """Return the document with its list, and the picture."""
    counts = Counter({pair: len(found) for pair, found in imports().items()})
    return {DOCUMENT: between(DOCUMENT.read_text(encoding='utf-8'), 'folders', table(counts)),
            PICTURE: picture(counts)}


if __name__ == '__main__':
    sys.exit(main_of(__doc__, files))
