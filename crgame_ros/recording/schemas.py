# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Types of messages: those that the contract wants, and their definitions as recorded."""

from functools import cache, lru_cache
import re

from crgame_ros.errors import InputError
from crgame_ros.messages.contract import load_contract
from crgame_ros.recording.standard_messages import standard_types
from rosbags.typesys import TypesysError

_VEHICLE = re.compile(r'/(hv|av)\d{1,3}(/.+)')


@lru_cache(maxsize=4096)
def is_foreign(topic: str, type_name: str) -> bool:
    """Return whether a message cannot be one of a run: another type on a topic of the contract."""
    topics = load_contract().topics
    names = [topic]
    vehicle = _VEHICLE.fullmatch(topic)
    if vehicle is not None:
        names += [f'/<{vehicle.group(1)}>{vehicle.group(2)}', f'/<v>{vehicle.group(2)}']
    wanted = next((topics[name].type_name for name in names if name in topics), None)
    return wanted not in (None, type_name)


@cache
def type_schema(type_name: str) -> tuple[str, str]:
    """
    Return the definition of a message type as recordings store it, and its hash.

    :param type_name: such as `nav_msgs/msg/Odometry`.
    :return: the text of it and of all types that it uses (`ros2msg`), and `RIHS01_...`, by which
        ROS 2 distinguishes the versions of a type.
    :raises InputError: if it is no type of ROS 2 Jazzy.
    """
    types = standard_types()
    try:
        return types.generate_msgdef(type_name, ros_version=2)[0], types.hash_rihs01(type_name)
    except TypesysError as error:
        raise InputError('is no message type of ROS 2 Jazzy', type_name,
                         'write it as package/msg/Type') from error
