# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The files beside a planner's or a policy's that its source names: its weights, its tables."""

import ast
from collections.abc import Iterator
from pathlib import Path

# More of one planner would better be installed where the workers are [bytes].
MOST_BYTES = 512 * 1024 * 1024


def code_neighbours(file: Path) -> list[Path]:
    """
    Find the files in the folder of a Python file whose names stand in its source as texts.

    `Path(__file__).with_name('weights.npz')` names one so. Python files among them are read in
    the same way; a file that is no Python has no neighbours.

    :return: in alphabetical order, without the file itself.
    """
    found, to_read = {file}, [file]
    while to_read:
        for name in _texts(to_read.pop()):
            path = file.with_name(name)
            if path not in found and path.is_file():
                found.add(path)
                to_read.append(path)
    return sorted(found - {file})


def _texts(file: Path) -> Iterator[str]:
    """Yield the texts in a Python file that can be the name of a file in the same folder."""
    if file.suffix != '.py':
        return
    try:
        tree = ast.parse(file.read_bytes())
    except (OSError, SyntaxError, ValueError):
        # Whoever loads it says why it cannot be used.
        return
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and isinstance(node.value, str) \
                and 0 < len(node.value) < 256 and '\0' not in node.value \
                and '/' not in node.value and node.value not in ('.', '..'):
            yield node.value
