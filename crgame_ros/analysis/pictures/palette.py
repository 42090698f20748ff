# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Colours and lines of roads, vehicles and people, in figures and in pages alike."""

from dataclasses import dataclass

from crgame_ros.game.objects import ObjectDescription, Role

# Okabe and Ito's palette, suitable for colour-blind readers: warm for humans, cold for AVs.
HUMAN_COLOURS = ('#d55e00', '#e69f00', '#cc79a7')
AV_COLOURS = ('#0072b2', '#56b4e9', '#009e73')
OBJECT_COLOUR = '#8c8c8c'
PERSON_COLOUR = '#4d4d4d'
PERSONS = ('pedestrian', 'bicycle', 'motorcycle')
ROAD_COLOUR, LANE_COLOUR = '#ebebeb', '#ffffff'
EDGE_COLOUR, DIVIDER_COLOUR = '#7f7f7f', '#9a9a9a'
INK = '#222222'
# Dashes distinguish lines without colours; with more vehicles than dashes, they repeat.
HUMAN_DASHES = ('-', (0, (6, 1, 1, 1)), (0, (6, 1, 1, 1, 1, 1)))
AV_DASHES = ((0, (4, 1.2)), (0, (1.2, 1.2)), (0, (4, 1.2, 1.2, 1.2)))
HUMAN_MARKERS, AV_MARKERS = ('o', 'v', 'P'), ('s', '^', 'D')


@dataclass(frozen=True)
class VehicleStyle:
    """
    The style of one driven vehicle in all figures.

    :param colour: as #rrggbb.
    :param dashes: line style of matplotlib.
    :param marker: marker of matplotlib.
    """

    colour: str
    dashes: str | tuple[float, tuple[float, ...]]
    marker: str


def vehicle_styles(descriptions: tuple[ObjectDescription, ...]) -> dict[str, VehicleStyle]:
    """Return the style of each driven vehicle, by id."""
    styles = {}
    for role, colours, dashes, markers in (
            (Role.HUMAN, HUMAN_COLOURS, HUMAN_DASHES, HUMAN_MARKERS),
            (Role.AUTONOMOUS, AV_COLOURS, AV_DASHES, AV_MARKERS)):
        for number, item in enumerate(each for each in descriptions if each.role is role):
            place = number % len(colours)
            styles[item.id] = VehicleStyle(colours[place], dashes[place], markers[place])
    return styles


def object_colour(description: ObjectDescription) -> str:
    """Return the colour of an object that is not driven: people on foot or bicycle are darker."""
    return PERSON_COLOUR if description.type in PERSONS else OBJECT_COLOUR


def shade(colour: str) -> str:
    """Return a darker shade of a colour, for text on the road."""
    return '#' + ''.join(f'{round(0.7 * level):02x}' for level in _levels(colour))


def tint(colour: str) -> str:
    """Return a lighter tint of a colour, as on white with 60 % of it."""
    return '#' + ''.join(f'{round(255 - 0.6 * (255 - level)):02x}' for level in _levels(colour))


def _levels(colour: str) -> tuple[int, ...]:
    return tuple(int(colour[i:i + 2], 16) for i in (1, 3, 5))
