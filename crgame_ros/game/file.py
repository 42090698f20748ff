# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Reads game files: YAML to a checked `Game`, or one clear error."""

from pathlib import Path

from crgame_ros.game.game import Game
from crgame_ros.schema.reading import read
from crgame_ros.yaml_text import read_yaml


def load_game(path: Path) -> Game:
    """
    Read a game file.

    :raises InputError: naming the file, the key and the remedy.
    """
    values = read_yaml(path, 'game file')
    return parse_game(values, str(path), path.parent)


def parse_game(values: object, where: str, base: Path) -> Game:
    """
    Check the content of a game file.

    :param values: the parsed YAML.
    :param where: file name for messages.
    :param base: directory against which its file names are resolved.
    """
    return read(Game, values, where, base)
