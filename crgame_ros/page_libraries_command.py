# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The command `crgame page-libraries`: fetches the JavaScript libraries of pages and reports."""

import argparse

from crgame_ros.page_libraries import fetch_libraries, find_libraries

DESCRIPTION = """\
Fetch three.js, which draws the 3D view, and Plotly, which draws the plots of the cockpit and of
reports, from npm. Both have the MIT licence. scripts/env.sh fetches them for a checkout; after
`pip install`, run this command once. Without npm on this machine, pip brings it."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.description = DESCRIPTION
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.set_defaults(command=run)


def run(_: argparse.Namespace) -> int:
    """
    Fetch the libraries and print their folder.

    :raises CrgameError: if they cannot be fetched.
    """
    was_there = find_libraries() is not None
    folder = fetch_libraries()
    print(f'{folder} {"is there already" if was_there else "fetched"}', flush=True)
    return 0
