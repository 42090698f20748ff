# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The arguments of `ros2 launch crgame_ros crgame.launch.py`, as words for the launcher."""

from collections.abc import Mapping
from typing import NamedTuple

from crgame_ros.errors import InputError


class LaunchArgument(NamedTuple):
    """
    One argument.

    :param option: the launcher's option, '' for the game; given once for each value of a list.
    :param what: its meaning.
    :param default: as text; an empty value is none.
    :param flag: whether it is true or false.
    """

    option: str
    what: str
    default: str = ''
    flag: bool = False


LAUNCH_ARGUMENTS = {
    'game': LaunchArgument('', 'game file; the cut-in game if it is empty'),
    'scenario': LaunchArgument('--scenario', "CommonRoad file instead of the game's"),
    'driver': LaunchArgument('--driver', "driver of the first human's vehicle"),
    'planners': LaunchArgument('--planner', 'planners of the AVs, separated by commas; one '
                               'serves all'),
    'duration': LaunchArgument('--duration', "simulated seconds; the game's if it is empty"),
    'rate': LaunchArgument('--rate', "simulation rate [Hz]; the game's if it is empty"),
    'real_time_factor': LaunchArgument('--real-time-factor', 'simulated seconds per second',
                                       '1.0'),
    'headless': LaunchArgument('--headless', 'true: without the cockpit', 'false', flag=True),
    'port': LaunchArgument('--port', "of the cockpit's page", '8080'),
    'namespace': LaunchArgument('--namespace', 'of every node, topic and service', '/'),
    'out': LaunchArgument('--out', "folder of the run's files; runs/<time>_<scenario> if it is "
                          'empty'),
}


def launch_words(values: Mapping[str, str]) -> list[str]:
    """
    Return the command line of the launcher.

    :param values: of `LAUNCH_ARGUMENTS`; those left out have their defaults.
    :raises InputError: if an argument is unknown, or a flag is neither true nor false.
    """
    unknown = values.keys() - LAUNCH_ARGUMENTS.keys()
    if unknown:
        raise InputError(f'there is no argument {min(unknown)}', 'crgame.launch.py',
                         'see --show-args')
    words: list[str] = []
    for name, argument in LAUNCH_ARGUMENTS.items():
        value = values.get(name, argument.default)
        if argument.flag:
            if value.lower() not in ('true', 'false', ''):
                raise InputError(f'{name} is {value}', 'crgame.launch.py', 'give true or false')
            words += [argument.option] * (value.lower() == 'true')
        elif name == 'planners':
            words += [word for item in value.split(',') if item
                      for word in (argument.option, item)]
        elif value:
            words += [argument.option, value] if argument.option else [value]
    return words
