# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
A run for `ros2 launch crgame_ros crgame.launch.py game:=FILE`.

The launcher of run.sh starts the nodes that the game needs, writes the same files into
runs/<time>_<scenario> and ends every node with itself; `--show-args` explains the arguments.
"""

import shutil
import sys

from crgame_ros.launcher.launch_words import LAUNCH_ARGUMENTS, launch_words
from launch import LaunchContext, LaunchDescription
from launch.actions import DeclareLaunchArgument, EmitEvent, ExecuteProcess, OpaqueFunction
from launch.events import Shutdown
from launch.substitutions import LaunchConfiguration

# A long recording takes its time to become a scenario after Ctrl-C [s].
PATIENCE_S = '300'


def run(context: LaunchContext) -> list:
    """Start the launcher, once the arguments are known."""
    values = {name: LaunchConfiguration(name).perform(context) for name in LAUNCH_ARGUMENTS}
    # ros2 itself may run with another interpreter than the one that has the packages.
    python = shutil.which('python3') or sys.executable
    return [ExecuteProcess(
        cmd=[python, '-u', '-m', 'crgame_ros.launcher.main', *launch_words(values)],
        name='crgame', output='screen', sigterm_timeout=PATIENCE_S, sigkill_timeout=PATIENCE_S,
        on_exit=[EmitEvent(event=Shutdown(reason='the run is over'))])]


def generate_launch_description() -> LaunchDescription:
    """Describe the run."""
    return LaunchDescription([
        *(DeclareLaunchArgument(name, default_value=argument.default, description=argument.what)
          for name, argument in LAUNCH_ARGUMENTS.items()),
        OpaqueFunction(function=run)])
