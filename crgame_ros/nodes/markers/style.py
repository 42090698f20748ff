# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Colours that the colour-blind can distinguish, and a blank marker."""

from collections.abc import Iterable

from builtin_interfaces.msg import Duration
from crgame_ros.game.objects import ObjectDescription, Role
from crgame_ros.messages.joint_messages import MAP
from geometry_msgs.msg import Point
from std_msgs.msg import ColorRGBA, Header
from visualization_msgs.msg import Marker

# The palette of Okabe and Ito, with greys and a lavender.
ORANGE, SKY_BLUE, GREEN, YELLOW = '#E69F00', '#56B4E9', '#009E73', '#F0E442'
VERMILLION, PURPLE, LAVENDER = '#D55E00', '#CC79A7', '#B3A2E8'
WHITE, LIGHT_GREY, GREY, DARK_GREY = '#FFFFFF', '#C8C8C8', '#999999', '#666666'
ROAD, PATHS, INK = '#3A3D42', '#5A5D63', '#101010'
BRAKE_ON, BRAKE_OFF = '#FF1010', '#500000'
ROLE_COLOURS = {Role.HUMAN: ORANGE, Role.AUTONOMOUS: SKY_BLUE, Role.RECORDED: LIGHT_GREY,
                Role.STATIC: GREY, Role.TRAFFIC: GREEN, Role.SCRIPTED: LAVENDER}
LIGHT_COLOURS = {'red': VERMILLION, 'redYellow': ORANGE, 'yellow': YELLOW, 'green': GREEN,
                 'inactive': DARK_GREY}
SOFT_TYPES = frozenset({'pedestrian', 'bicycle'})
MOTOR_TYPES = frozenset({'car', 'truck', 'bus', 'motorcycle', 'taxi', 'priorityVehicle'})


def colour(code: str, alpha: float = 1.0) -> ColorRGBA:
    """Return a colour of the form #RRGGBB as a message."""
    red, green, blue = (int(code[place:place + 2], 16) / 255.0 for place in (1, 3, 5))
    return ColorRGBA(r=red, g=green, b=blue, a=alpha)


def body_colour(item: ObjectDescription) -> str:
    """Return the colour of an object; people outside cars stand out."""
    return PURPLE if item.type in SOFT_TYPES else ROLE_COLOURS[item.role]


def blank(header: Header, namespace: str, number: int, kind: int, paint: ColorRGBA,
          scale: tuple[float, float, float] = (1.0, 1.0, 1.0),
          lifetime_s: int = 0) -> Marker:
    """
    Build a marker at the origin of map.

    :param header: shared by the markers of a message.
    :param number: id, unique in the namespace.
    :param kind: Marker.CUBE …
    :param lifetime_s: time after which viewers drop it, 0 for never [s]
    """
    marker = Marker(header=header, ns=namespace, id=number, type=kind, action=Marker.ADD,
                    color=paint, lifetime=Duration(sec=lifetime_s))
    marker.pose.orientation.w = 1.0
    marker.scale.x, marker.scale.y, marker.scale.z = scale
    return marker


def map_header() -> Header:
    """Return a header in frame map."""
    return Header(frame_id=MAP)


def points(rows: Iterable[Iterable[float]], z: float) -> list[Point]:
    """Return (x, y) points as messages, all at one height [m]."""
    return [Point(x=x, y=y, z=z) for x, y in rows]
