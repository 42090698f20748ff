# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Says what is doubtful about the roads of a converted map."""

from crgame_ros.geometry.angles import wrap_pi
from crgame_ros.roads.network import RoadNetwork
import numpy as np

# Between the end of a lane and the start of the next one: a corner [rad] and a gap [m] that a
# driver feels.
_KINK, _GAP = 0.35, 0.5
# Lanes that end within the map, not at its edge: so far from the edge [m].
_INSIDE = 20.0
_TOLD = 3


def road_remarks(network: RoadNetwork) -> list[str]:
    """
    Return remarks on the lanes for cars, one line each.

    They are on lanes that end within the map, kinks and gaps between lanes, and missing limits.
    """
    lanes = [lanelet for lanelet in network.lanelet_ids if network.is_drivable(lanelet)]
    if not lanes:
        return []
    points = np.concatenate([network.line(lanelet).points for lanelet in lanes])
    low, high = points.min(axis=0) + _INSIDE, points.max(axis=0) - _INSIDE
    ends, kinks, gaps, unlimited = [], [], [], []
    for lanelet in lanes:
        line = network.line(lanelet)
        after = [other for other in network.successors(lanelet) if other != lanelet]
        if not after and ((line.points[-1] > low) & (line.points[-1] < high)).all():
            ends.append(lanelet)
        for other in after:
            next_line = network.line(other)
            if abs(wrap_pi(float(next_line.heading[0] - line.heading[-1]))) > _KINK:
                kinks.append(lanelet)
            if np.hypot(*(next_line.points[0] - line.points[-1])) > _GAP:
                gaps.append(lanelet)
        if network.speed_limit(lanelet) is None:
            unlimited.append(lanelet)
    return [f'{len(found)} of {len(lanes)} lanes {what}: lanelet '
            + ', '.join(map(str, found[:_TOLD])) + (' …' if len(found) > _TOLD else '')
            for found, what in (
                (ends, 'end within the map'),
                (kinks, f'turn by more than {np.degrees(_KINK):.0f} degrees at their end'),
                (gaps, f'end more than {_GAP:g} m from the start of the next one'),
                (unlimited, "have no speed limit: agents take their road type's")) if found]
