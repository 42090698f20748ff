# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The command `crgame dds-profile`: nodes started one by one believe each other alone."""

import argparse
from contextlib import suppress
import os
from pathlib import Path
import shlex
from tempfile import TemporaryDirectory

from crgame_ros.errors import InputError
from crgame_ros.ros.namespace_lock import read_namespace

DESCRIPTION = """\
Write a Fast DDS profile with which nodes that you start one by one take a run's own topics from
each other alone, as those of run.sh do. Give the same command in each shell that starts some of
them; a profile that is there is kept.

  eval "$(crgame dds-profile runs/mine/fastdds.xml)"
  ros2 run crgame_ros sim_node --ros-args -p game:=cut_in

docs/nodes.md tells which topics these are."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument('file', type=Path, help='the profile, in a folder that exists')
    parser.add_argument('--namespace', type=read_namespace, default='/', metavar='/NAME',
                        help="of the run's nodes (default: none)")
    parser.add_argument('--own-orders', action='store_true',
                        help='of services, /seats/order and /trigger as well')
    parser.set_defaults(command=_write)


def _write(values: argparse.Namespace) -> int:
    from crgame_ros.ros.environment import PROFILE_VARIABLES
    from crgame_ros.ros.run_profile import check_believing, check_profile, write_run_profile
    file = values.file.absolute()
    if not file.exists():
        check_believing('dds-profile')
        try:
            # Several shells may begin at once: they all get the first profile, and get it whole.
            with TemporaryDirectory(dir=file.parent) as folder, suppress(FileExistsError):
                whole = Path(folder) / file.name
                write_run_profile(whole, values.namespace, own_orders=values.own_orders)
                os.link(whole, file)
        except OSError as error:
            raise InputError(f'cannot be written ({error.strerror})', str(file),
                             'name a file in a folder of yours') from error
    check_profile(file, values.namespace, values.own_orders)
    print('export', *(f'{name}={shlex.quote(str(file))}' for name in PROFILE_VARIABLES))
    return 0
