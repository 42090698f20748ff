# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The markers of one thing that may come, move and vanish; colours for the colour-blind."""

from collections.abc import Iterable, Sequence
import math

from builtin_interfaces.msg import Duration
from crgame_ros.game.objects import ObjectDescription, Role
from crgame_ros.geometry.reference_point import ahead
from crgame_ros.geometry.shape import Shape
from crgame_ros.messages.joints import MAP
from geometry_msgs.msg import Point, Pose
import numpy as np
from numpy.typing import NDArray
import shapely
from std_msgs.msg import ColorRGBA, Header
from visualization_msgs.msg import Marker

FloatArray = NDArray[np.float64]

# Viewers drop markers that are not renewed for this long [s], so that no frozen scene stays.
LIFETIME_S = 5
LABEL_HEIGHT = 1.2
LIGHT_DIAMETER = 1.2
LIGHT_Z = 3.0
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


class Item:
    """
    Markers that are shown together or not at all.

    :param markers: refilled in place by the owner of the item.
    """

    def __init__(self, markers: Sequence[Marker]) -> None:
        self.markers = tuple(markers)
        self.present = False
        self._shown = False

    def collect(self, into: list[Marker]) -> None:
        """Add the markers to a message; add deletions once when they are no longer present."""
        if self.present or self._shown:
            action = Marker.ADD if self.present else Marker.DELETE
            for marker in self.markers:
                marker.action = action
            into += self.markers
        self._shown = self.present


class Body(Item):
    """
    A vehicle or other object: box, heading, label and, of motor vehicles, brake lights.

    :param header: shared by the markers of a message.
    :param number: id of the markers, in each of their namespaces.
    """

    def __init__(self, header: Header, number: int, item: ObjectDescription) -> None:
        height = item.height
        self._half_height = 0.5 * height
        self._rear_to_center = item.rear_to_center
        namespace = 'vehicles' if item.role.is_ego else 'objects'
        box = _box(header, namespace, number, item, height)
        markers = [box]
        if item.role is not Role.STATIC:
            markers.append(_heading(header, number, item.shape, self._half_height))
        self._lights: Marker | None = None
        if item.type in MOTOR_TYPES and item.role is not Role.STATIC:
            self._lights = _brake_lights(header, number, item.shape, self._half_height)
            markers.append(self._lights)
        # All parts fixed to the body share one pose; the label is drawn above it.
        self._pose: Pose = box.pose
        self._pose.position.z = self._half_height
        for marker in markers:
            marker.pose = self._pose
        self._label = blank(header, 'labels', number, Marker.TEXT_VIEW_FACING,
                            colour(WHITE), (0.0, 0.0, LABEL_HEIGHT), LIFETIME_S)
        self._label.text = item.id
        self._label.pose.position.z = height + LABEL_HEIGHT
        super().__init__((*markers, self._label))
        self._on, self._off = colour(BRAKE_ON), colour(BRAKE_OFF)

    def place(self, x: float, y: float, yaw: float, braking: bool) -> None:
        """
        Place the markers at the object's pose; hide them if the pose is not finite.

        :param x: of its reference point in map, like y [m]
        :param yaw: [rad]
        """
        self.present = math.isfinite(x) and math.isfinite(y) and math.isfinite(yaw)
        if not self.present:
            return
        x, y = ahead(x, y, yaw, self._rear_to_center)
        position, orientation = self._pose.position, self._pose.orientation
        position.x, position.y = x, y
        orientation.z, orientation.w = math.sin(0.5 * yaw), math.cos(0.5 * yaw)
        label = self._label.pose.position
        label.x, label.y = x, y
        if self._lights is not None:
            self._lights.color = self._on if braking else self._off


class Line(Item):
    """
    A line whose points change.

    :param marker: LINE_STRIP or LINE_LIST.
    :param z: height of its points [m]
    """

    def __init__(self, marker: Marker, z: float) -> None:
        super().__init__((marker,))
        self._marker = marker
        self._z = z
        self._pool: list[Point] = []

    def fill(self, places: FloatArray) -> None:
        """Set new points (n, 2); hide the line with fewer than two."""
        count = len(places)
        self.present = count > 1
        while len(self._pool) < count:
            self._pool.append(Point(z=self._z))
        for point, (x, y) in zip(self._pool, places.tolist(), strict=False):
            point.x, point.y = x, y
        if len(self._marker.points) != count:
            self._marker.points = self._pool[:count]


class LightMarker(Item):
    """A traffic light: a ball in the colour of its state, at a place in map [m]."""

    def __init__(self, header: Header, light_id: int, x: float, y: float) -> None:
        marker = blank(header, 'lights', light_id, Marker.SPHERE,
                       colour(LIGHT_COLOURS['inactive']),
                       (LIGHT_DIAMETER,) * 3, LIFETIME_S)
        marker.pose.position.x, marker.pose.position.y = x, y
        marker.pose.position.z = LIGHT_Z
        super().__init__((marker,))
        self.present = True

    def show(self, state: str) -> None:
        """Set the colour of a state in its XML spelling; an unknown state counts as inactive."""
        code = LIGHT_COLOURS.get(state, LIGHT_COLOURS['inactive'])
        self.markers[0].color = colour(code)


def _box(header: Header, namespace: str, number: int, item: ObjectDescription,
         height: float) -> Marker:
    shape, paint = item.shape, colour(_body_colour(item))
    if shape.kind == 'polygon':
        marker = blank(header, namespace, number, Marker.TRIANGLE_LIST, paint,
                       lifetime_s=LIFETIME_S)
        marker.points = points(_triangles(shape).tolist(), 0.5 * height)
        return marker
    kind = Marker.CYLINDER if shape.kind == 'circle' else Marker.CUBE
    return blank(header, namespace, number, kind, paint,
                 (shape.length, shape.width, height), LIFETIME_S)


def _triangles(shape: Shape) -> FloatArray:
    """Return the corners (3 n, 2) of triangles that fill a polygon, counter-clockwise."""
    polygon = shapely.make_valid(shapely.Polygon(shape.vertices))
    parts = shapely.get_parts(shapely.constrained_delaunay_triangles(polygon))
    corners = [shapely.get_coordinates(shapely.orient_polygons(part))[:3] for part in parts]
    return np.concatenate(corners) if corners else np.empty((0, 2))


def _heading(header: Header, number: int, shape: Shape, top: float) -> Marker:
    """Draw a wedge on the roof that points forward."""
    marker = blank(header, 'heading', number, Marker.TRIANGLE_LIST,
                   colour(INK, 0.8), lifetime_s=LIFETIME_S)
    tip, base = 0.5 * shape.length, 0.5 * shape.length - min(shape.width, 0.5 * shape.length)
    marker.points = points(
        ((tip, 0.0), (base, 0.4 * shape.width), (base, -0.4 * shape.width)), top + 0.03)
    return marker


def _brake_lights(header: Header, number: int, shape: Shape, top: float) -> Marker:
    marker = blank(header, 'brake_lights', number, Marker.CUBE_LIST,
                   colour(BRAKE_OFF), (0.4, 0.3 * shape.width, 0.1), LIFETIME_S)
    rear, side = 0.2 - 0.5 * shape.length, 0.35 * shape.width
    marker.points = points(((rear, side), (rear, -side)), top)
    return marker


def colour(code: str, alpha: float = 1.0) -> ColorRGBA:
    """Return a colour of the form #RRGGBB as a message."""
    red, green, blue = (int(code[place:place + 2], 16) / 255.0 for place in (1, 3, 5))
    return ColorRGBA(r=red, g=green, b=blue, a=alpha)


def _body_colour(item: ObjectDescription) -> str:
    """Return the colour of an object; people outside cars stand out."""
    return PURPLE if item.type in SOFT_TYPES else ROLE_COLOURS[item.role]


def blank(header: Header, namespace: str, number: int, kind: int, paint: ColorRGBA,
          scale: tuple[float, float, float] = (1.0, 1.0, 1.0),
          lifetime_s: int = 0) -> Marker:
    """
    Build a marker at the origin of map.

    :param header: shared by the markers of a message.
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
