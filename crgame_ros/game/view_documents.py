# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What a driver's 3D view showed where, picture by picture: for what their gaze was on."""

from dataclasses import dataclass
import re
from typing import Annotated, Literal, NamedTuple

from annotated_types import Interval, Predicate
from crgame_ros.game.documents import VehicleId
from crgame_ros.game.task_documents import Milliseconds, SteadySeconds
from crgame_ros.schema.document_marks import Bounded, Exact
from crgame_ros.schema.json_documents import JsonDocument

# The nearest are told; a picture with all of them has 12 kB.
MAX_SHOWN = 200
# Things of the world, and what lies over it.
ShownKind = Literal['vehicle', 'pedestrian', 'object', 'sign', 'traffic_light', 'mirror',
                    'instrument', 'task']
ThingId = Annotated[str, Predicate(re.compile(r'[A-Za-z0-9_-]{1,60}').fullmatch)]
Epoch = Annotated[int, Exact(), Interval(ge=0, le=2**53)]
Share = Annotated[float, Exact(), Interval(ge=0.0, le=1.0)]
Pixels = Annotated[float, Exact(), Interval(ge=-1e5, le=1e5)]
Metres = Annotated[float, Exact(), Interval(ge=0.0, le=1e5)]
Coordinate = Annotated[float, Exact(), Interval(ge=-1e9, le=1e9)]
Angle = Annotated[float, Exact(), Interval(ge=-10.0, le=10.0)]
Tangent = Annotated[float, Exact(), Interval(gt=0.0, le=100.0)]


class ShownThing(NamedTuple):
    """
    A thing in a picture, and the box around it: shares of the view's width and height.

    :param kind: of thing.
    :param id: as in the rest of the recording; of a sign or traffic light, that of the map; of a
        task its name.
    :param left: edge, from the view's left.
    :param top: edge, from the view's top.
    :param right: edge.
    :param bottom: edge.
    :param distance_m: from the eye to the nearest point of its body; None for what lies over the
        view [m]
    :param mirror: in which it is seen; None for none.
    """

    kind: ShownKind
    id: ThingId  # noqa: A003
    left: Share
    top: Share
    right: Share
    bottom: Share
    distance_m: Metres | None = None
    mirror: ThingId | None = None


class ViewEye(NamedTuple):
    """
    The eye of a picture, above the road on which the vehicle stands.

    :param x: in frame map [m]
    :param y: likewise [m]
    :param yaw: heading in which it looks [rad]
    :param height_m: above the road [m]
    :param pitch: direction of the picture's middle above the road's plane [rad]
    :param across: tangent of half the angle across the picture.
    :param tall: tangent of half the angle of its height.
    """

    x: Coordinate
    y: Coordinate
    yaw: Angle
    height_m: Metres
    pitch: Angle
    across: Tangent
    tall: Tangent


class ViewPlace(NamedTuple):
    """
    The place of a view on the screen [CSS px].

    :param left: edge, from the screen's left.
    :param top: edge, from the screen's top.
    :param width: of the view.
    :param height: of the view.
    :param screen_width: of the screen.
    :param screen_height: of the screen.
    :param ratio: pixels of the screen per CSS pixel.
    """

    left: Pixels
    top: Pixels
    width: Pixels
    height: Pixels
    screen_width: Pixels
    screen_height: Pixels
    ratio: Tangent


@dataclass(frozen=True)
class ViewPicture:
    """
    What was where in one picture of a driver's view.

    :param seat: the vehicle whose driver it is.
    :param epoch: of the run.
    :param steady_s: when it was drawn, on the steady clock of the server's machine, which is that
        of the run's cycles [s]
    :param clock_error_ms: half of the round trip that related both clocks: the error of
        `steady_s` is no larger.
    :param place: of the view on the screen.
    :param eye: of the view.
    :param shown: what is in it, the foremost first: what lies over the view, then what mirrors
        show and their glass, then the nearest.
    """

    seat: VehicleId
    epoch: Epoch
    steady_s: SteadySeconds
    clock_error_ms: Milliseconds
    place: ViewPlace
    eye: ViewEye
    shown: Annotated[tuple[ShownThing, ...], Bounded(MAX_SHOWN)]


VIEW_PICTURE: JsonDocument[ViewPicture] = JsonDocument(
    ViewPicture, '/views/pictures', 'picture of a view')
