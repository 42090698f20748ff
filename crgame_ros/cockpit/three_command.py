# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The command `crgame cockpit-3d`: fetches what the page's 3D view is drawn with."""

import argparse

from crgame_ros.cockpit.three_library import fetch_library, find_library

DESCRIPTION = """\
Fetch three.js (MIT), with which the cockpit's page draws its 3D view, from npm.
scripts/env.sh does so by itself; after `pip install` it is done once by this command.
Without npm on this machine pip brings one for the time that it takes."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.description = DESCRIPTION
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.set_defaults(command=run)


def run(_: argparse.Namespace) -> int:
    """
    Fetch it, and say where it is.

    :raises CrgameError: if it cannot be had.
    """
    was_there = find_library() is not None
    folder = fetch_library()
    print(f'{folder} {"is there already" if was_there else "fetched"}', flush=True)
    return 0
