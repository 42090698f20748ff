# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Each score's unit, definition and variant, for tables and their dictionaries."""

from typing import NamedTuple

from crgame_ros.analysis.scores.commonroad_costs import COSTS


class ScoreMeasure(NamedTuple):
    """
    A score.

    :param unit: as tables write it; 1 for a share.
    :param definition: one sentence.
    :param variant: which of several definitions this is.
    :param undefined: when the score has no value; empty if it always has one.
    """

    unit: str
    definition: str
    variant: str
    undefined: str


_NUPLAN = 'nuplan-devkit, closed loop'
_OURS = 'crgame_ros'
_SHORT = 'the run has fewer than 5 time steps'
_NO_PLANS = 'it has no planner, or its plans were not recorded'
SCORE_MEASURES = {
    'nuplan_score': ScoreMeasure('1', 'product of the multipliers times the weighted mean',
                                 _NUPLAN, _SHORT),
    'no_collision_at_fault': ScoreMeasure(
        '1', '1, 0.5 after one collision at fault with an object, else 0', _NUPLAN, _SHORT),
    'drivable_area': ScoreMeasure('1', '1 where no corner is off the road by 0.3 m or more',
                                  'road: union of the lanelets', _SHORT),
    'driving_direction': ScoreMeasure(
        '1', '1, 0.5 from 2 m, 0 from 6 m against the lane within 1 s',
        'steps at which the lane changes count too', _SHORT),
    'making_progress': ScoreMeasure('1', '1 where progress is above 0.2', _NUPLAN, _SHORT),
    'progress': ScoreMeasure(
        '1', "way along the expert's route over the expert's way, 0 to 1",
        'without an expert: over that of a free drive at the speed limit; 1 where the expert has '
        'no route', _SHORT),
    'time_to_collision': ScoreMeasure(
        '1', '1 where it is always above 0.95 s, sampled each 0.1 s within 3 s', _NUPLAN, _SHORT),
    'speed_limit': ScoreMeasure('1', '1 - mean excess / 2.23 m/s, 0 at least',
                                f'{_NUPLAN}; 1 where no limit is known', _SHORT),
    'comfort': ScoreMeasure('1', '1 where accelerations, jerks and yaw are within bounds',
                            'derivatives of speed and yaw', _SHORT),
    **{name: ScoreMeasure('1', f'CommonRoad cost {name} as docs/scores.md has it: '
                          f'{cost.definition}', cost.variant,
                          'the checker finds no lane or lacks a state')
       for name, cost in COSTS.items()},
    'valid': ScoreMeasure('', 'whether all checks of valid_solution are passed',
                          'road: union of the lanelets; of a human the goal is where its drive '
                          'ended', ''),
    'feasible': ScoreMeasure('', 'whether the model KS can make every transition',
                             'the checker, 2 cm and 0.03 rad, at 0.1 s',
                             'the checker was not available'),
    'accepted_share': ScoreMeasure('1', 'answers accepted that are no fallback, of all answers',
                                   _OURS, f'{_NO_PLANS}, or it never answered'),
    'latency_ms': ScoreMeasure('ms', 'time from a request to its plan', _OURS, _NO_PLANS),
    'age_ms': ScoreMeasure('ms', 'age of the plan in use, sampled once a second', _OURS,
                           _NO_PLANS),
    'reached_s': ScoreMeasure('s', 'time until a state first meets the goal',
                              'of a human the goal is where its drive ended', 'it never did'),
    'last_distance_m': ScoreMeasure('m', "distance from the centre to the goal's area at the end",
                                    'of a human the goal is where its drive ended',
                                    'the goal has no position'),
}
