# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The view that a page shows: map or 3D, its angle, resolution and picture rate."""

from dataclasses import dataclass

# The map, and the viewpoints of the 3D view.
SHOWN = ('map', 'driver', 'chase', 'bird')


@dataclass(frozen=True)
class SeenView:
    """
    The properties of a page's picture, as reported by the page.

    :param shown: one of `SHOWN`; empty before the page has reported.
    :param inset: whether the small map lies over a 3D view.
    :param plans: whether the plans of AVs are shown.
    :param mirrors: whether there are mirrors.
    :param bare: whether the page is a stage, with only the view.
    :param across_deg: angle across a 3D view [deg]; None on the map.
    :param screen_width_m: width of the screen if the view is true to scale [m], else None.
    :param eye_distance_m: distance of the eyes from the screen [m].
    :param width_px: width of the picture on the page [CSS px].
    :param height_px: [CSS px]
    :param ratio: drawn pixels per CSS pixel.
    :param rate_hz: pictures per second; None before the first count.
    :param renderer: name of the renderer as the browser reports it; empty on the map.
    :param software: whether the processor renders.
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
