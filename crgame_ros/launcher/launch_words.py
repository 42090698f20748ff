# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The arguments of `ros2 launch crgame_ros crgame.launch.py`, as words for the launcher."""

from argparse import Action
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from crgame_ros.errors import InputError
from crgame_ros.launcher.arguments import build_parser

# What a run of ROS's launch does not do: it plays no recordings into the page.
_LEFT_OUT = ('help', 'replay')
_WHERE = 'crgame.launch.py'


@dataclass(frozen=True)
class LaunchArgument:
    """
    One argument, made from an option of run.sh. Its default is an empty text: not given.

    :param option: of run.sh, '' for the game.
    :param flag: whether it is true or false.
    :param several: whether values are separated by commas; the option is given once for each.
    """

    option: str
    what: str
    flag: bool
    several: bool

    def words(self, name: str, value: str) -> Iterator[str]:
        """
        Yield the words of the command line.

        :raises InputError: if a flag is neither true nor false.
        """
        if self.flag:
            if value.lower() not in ('true', 'false', ''):
                raise InputError(f'{name} is {value}', _WHERE, 'give true or false')
            if value.lower() == 'true':
                yield self.option
            return
        for item in value.split(',') if self.several else (value,):
            if item:
                yield from (self.option, item) if self.option else (item,)


def _argument(action: Action) -> LaunchArgument:
    option = action.option_strings[0] if action.option_strings else ''
    flag, several = action.nargs == 0, isinstance(action.default, list)
    what = ' '.join(str(action.help).split())
    notes = ['true or false'] * flag + ['values separated by commas'] * several
    return LaunchArgument(option, f'{what} [{", ".join(notes)}]' if notes else what, flag,
                          several)


def _name(action: Action) -> str:
    """Return an option's name in ROS's spelling; the planners have a plural one."""
    if action.dest in ('game', 'planners'):
        return action.dest
    return action.option_strings[0].removeprefix('--').replace('-', '_')


LAUNCH_ARGUMENTS = {_name(action): _argument(action)
                    for action in build_parser()._actions if action.dest not in _LEFT_OUT}


def launch_words(values: Mapping[str, str]) -> list[str]:
    """
    Return the command line of the launcher.

    :param values: of `LAUNCH_ARGUMENTS`; those left out are not given.
    :raises InputError: if an argument is unknown, or a flag is neither true nor false.
    """
    unknown = values.keys() - LAUNCH_ARGUMENTS.keys()
    if unknown:
        raise InputError(f'there is no argument {min(unknown)}', _WHERE, 'see --show-args')
    return [word for name, argument in LAUNCH_ARGUMENTS.items()
            for word in argument.words(name, values.get(name, ''))]
