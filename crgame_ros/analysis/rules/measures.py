# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The measures of traffic rules by their names: unit, definition, variant, reference point."""

from typing import NamedTuple

from crgame_ros.analysis.rules.safe_distance import (
    BRAKING,
    LEADER_BRAKING,
    REACTION_S,
    RECOVERY_S,
)
from crgame_ros.roads.signs import SIGN_REACH
from crgame_ros.vehicle.state import STANDING


class RuleMeasure(NamedTuple):
    """
    A measure of how a vehicle kept a traffic rule.

    :param unit: as tables write it.
    :param label: for people.
    :param definition: one sentence.
    :param variant: which of several usual definitions is used.
    :param reference: the point that it is measured at.
    :param is_count: whether it counts events.
    :param empty: when it has no value; empty for a measure that always has one.
    """

    unit: str
    label: str
    definition: str
    variant: str
    reference: str
    is_count: bool = False
    empty: str = ''


_FRONT = 'middle of the front bumper'
_SAFE = (f'Maierhofer et al. 2020, R_G1: reaction {REACTION_S:g} s, braking {BRAKING:g} m/s^2, of '
         f'the leader {LEADER_BRAKING:g} m/s^2; up to {RECOVERY_S:g} s after a cut-in do not '
         'count; each step that it is below counts in full')
_NO_LEADER = 'it followed no leader'
MEASURES = {
    'red_lights_run': RuleMeasure(
        '1', 'Red lights run', 'times that it drove over the line of a light that was red',
        'the stop line, or else the end of the lanelet; red and red-yellow, not yellow', _FRONT,
        is_count=True),
    'stop_lines_run': RuleMeasure(
        '1', 'Stop signs run', 'times that it drove over the line of a stop sign without a halt',
        f'a halt is a speed below {STANDING:g} m/s at most {SIGN_REACH:g} m before the stop line, '
        'or else the end of the lanelet; a light that is on overrules the sign', _FRONT,
        is_count=True),
    'unsafe_distance_share': RuleMeasure(
        '1', 'Share of the time with a leader below the safe distance',
        'share of the steps with a leader at which the gap to it was below the safe distance',
        _SAFE, 'footprints, bumper to bumper', empty=_NO_LEADER),
    'unsafe_distance_s': RuleMeasure(
        's', 'Longest time below the safe distance',
        'longest time without a pause in which the gap to its leader was below the safe distance',
        _SAFE, 'footprints, bumper to bumper', empty=_NO_LEADER),
}
