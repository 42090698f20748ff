# Copyright 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.
"""Reading game files: YAML in, a checked `Game` or one clear error out."""

from pathlib import Path
from typing import Any

from crgame_ros.game.game import Game
from crgame_ros.schema.reading import read
from crgame_ros.schema.writing import write
from crgame_ros.yaml_text import read_yaml
import yaml


def load_game(path: Path) -> Game:
    """
    Read a game file.

    :raises InputError: naming the file, the key and the remedy.
    """
    values = read_yaml(path, 'game file')
    return parse_game(values, str(path), path.parent)


def parse_game(values: Any, where: str, base: Path) -> Game:
    """
    Check the content of a game file.

    :param values: what YAML gave.
    :param where: file name for messages.
    :param base: directory against which its file names are resolved.
    """
    return read(Game, values, where, base)


def dump_game(game: Game) -> str:
    """
    Write a game file that gives the same game from anywhere: its file names are absolute.

    :return: YAML text.
    """
    return yaml.safe_dump(write(game, game.base), sort_keys=False, allow_unicode=True)
