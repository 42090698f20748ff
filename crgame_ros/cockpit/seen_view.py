# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What a page shows its person: the map or a 3D view, how wide, how fine and how often."""

from dataclasses import dataclass

# The map, and the viewpoints of the 3D view.
SHOWN = ('map', 'driver', 'chase', 'bird')


@dataclass(frozen=True)
class SeenView:
    """
    What a page has told of its picture.

    :param shown: one of `SHOWN`; empty before the page has told.
    :param inset: whether the small map lies over a 3D view.
    :param plans: whether what AVs plan is to be seen.
    :param mirrors: whether there are mirrors.
    :param bare: whether the page is a stage, with nothing but the view.
    :param across_deg: angle across a 3D view [deg]; None on the map.
    :param screen_width_m: of the screen, where the view is true to scale [m]; None where not.
    :param eye_distance_m: of the eyes from it [m].
    :param width_px: of the picture on the page [CSS px].
    :param height_px: [CSS px]
    :param ratio: pixels that are drawn to a CSS pixel.
    :param rate_hz: pictures per second; None where nobody has counted yet.
    :param renderer: what draws, as far as the browser tells; empty on the map.
    :param software: whether that is the processor.
    """

    shown: str = ''
    inset: bool = False
    plans: bool = False
    mirrors: bool = False
    bare: bool = False
    across_deg: float | None = None
    screen_width_m: float | None = None
    eye_distance_m: float | None = None
    width_px: float = 0.0
    height_px: float = 0.0
    ratio: float = 1.0
    rate_hz: float | None = None
    renderer: str = ''
    software: bool = False
