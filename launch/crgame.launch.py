# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
A run for `ros2 launch crgame_ros crgame.launch.py game:=NAME`.

The launcher of run.sh starts the nodes that the game needs, writes the same files into
runs/<time>_<scenario> and ends every node with itself; `--show-args` explains the arguments. It
can be included in another launch file, also in a group with PushRosNamespace.
"""

import os
import shutil
import sys

from crgame_ros.launcher.launch_words import LAUNCH_ARGUMENTS, launch_words
from crgame_ros.ros.node_main import PARENT_VARIABLE
from launch import LaunchContext, LaunchDescription
from launch.actions import DeclareLaunchArgument, ExecuteProcess, OpaqueFunction
from launch.events.process import ProcessExited
from launch.substitutions import LaunchConfiguration

# A long recording takes its time to become a scenario after Ctrl-C [s].
PATIENCE_S = '300'


def run(context: LaunchContext) -> list:
    """Start the launcher, once the arguments are known."""
    values = {name: LaunchConfiguration(name).perform(context) for name in LAUNCH_ARGUMENTS}
    group = context.launch_configurations.get('ros_namespace', '')
    if not values['namespace'].startswith('/'):
        values['namespace'] = '/'.join(part for part in (group, values['namespace']) if part)
    # ros2 itself may run with another interpreter than the one that has the packages.
    python = shutil.which('python3') or sys.executable
    return [ExecuteProcess(
        cmd=[python, '-u', '-m', 'crgame_ros.launcher.main', *launch_words(values)],
        # It ends in good order if ros2 itself is killed.
        additional_env={PARENT_VARIABLE: str(os.getpid())},
        name='crgame', output='screen', sigterm_timeout=PATIENCE_S, sigkill_timeout=PATIENCE_S,
        on_exit=fail_with)]


def fail_with(event: ProcessExited, _context: LaunchContext) -> None:
    """Let ros2 launch end with an exit code of its own if the run has failed."""
    if event.returncode:
        raise RuntimeError(f'the run has failed (exit code {event.returncode})')


def generate_launch_description() -> LaunchDescription:
    """Describe the run."""
    return LaunchDescription([
        *(DeclareLaunchArgument(name, default_value='', description=argument.what)
          for name, argument in LAUNCH_ARGUMENTS.items()),
        OpaqueFunction(function=run)])
