# Copyright 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Where the package's data files (config, scenarios, contract) are."""

from pathlib import Path
import sys

from crgame_ros.errors import CrgameError

PACKAGE = 'crgame_ros'


def share_directory() -> Path:
    """
    Find the package's share directory: the source tree, a colcon install or a pip install.

    :raises CrgameError: if the data files were not installed.
    """
    package = Path(__file__).resolve().parent
    candidates = [package.parent]
    candidates += [parent / 'share' / PACKAGE for parent in package.parents]
    candidates.append(Path(sys.prefix) / 'share' / PACKAGE)
    for candidate in candidates:
        if (candidate / 'msg_defs' / 'interfaces.yaml').is_file():
            return candidate
    raise CrgameError(f'{package}: the data files of {PACKAGE} are missing; '
                      'install with colcon or `pip install .`, or run from the source tree')


def config_directory() -> Path:
    """Find the directory of configuration files."""
    return share_directory() / 'config'


def scenarios_directory() -> Path:
    """Find the directory of the package's own scenarios and game files."""
    return share_directory() / 'scenarios'


def default_game() -> Path:
    """Find the game that runs when none is named."""
    return scenarios_directory() / 'cut_in.yaml'
