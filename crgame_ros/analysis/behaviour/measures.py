# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The measures of driving by their names: unit, definition, variant, reference point."""

from dataclasses import dataclass

from crgame_ros.analysis.behaviour.driver_controls import (
    COGNITIVE,
    PRESSED,
    RELEASED_AGAIN,
    ReversalSetting,
    SHORTEST_S,
    VISUAL,
)
from crgame_ros.analysis.behaviour.gaps_accepted import IN_LANE, NEAR
from crgame_ros.analysis.behaviour.lane_keeping import (
    HORIZON_S,
    LONGEST_HALF_S,
    SIDEWAYS,
    STANDING,
)
from crgame_ros.analysis.behaviour.reactions import (
    LONGEST_WAIT_S,
    PEDAL_INPUT,
    STABLE_S,
    STABLE_WHEEL_DEG,
    USUAL_LIMITS,
    WHEEL_INPUT_DEG,
)
from crgame_ros.measures import Measure

# A second is stable with accelerations up to this [m/s^2].
STABLE_ACCELERATION = 2.0


@dataclass(frozen=True, kw_only=True)
class BehaviourMeasure(Measure):
    """
    A measure of driving; reports show those with a label.

    :param per: what one value is for: vehicle, event, lane change, take-over or step.
    """

    per: str = 'vehicle'


def _spread(name: str, unit: str, what: str, variant: str, reference_point: str,
            **labels: str) -> dict[str, BehaviourMeasure]:
    return {f'{name}_{key}': BehaviourMeasure(unit, f'{words} of {what}', variant,
                                              reference_point, labels.get(key, ''))
            for key, words in (('mean', 'mean'), ('sd', 'standard deviation (N - 1)'),
                               ('min', 'smallest value'), ('max', 'greatest value'))}


def _pedal(name: str) -> dict[str, BehaviourMeasure]:
    command, hysteresis = f'{name} of the consumed command', (
        f'applied from {PRESSED:g} of the travel on until back at {RELEASED_AGAIN:g}')
    return {
        **_spread(name, '1', f"the {name}'s travel, 0 to 1", 'whole time driven', command),
        f'{name}_share': BehaviourMeasure(
            '1', f'share of the time driven in which the {name} is applied', hysteresis, command),
        f'{name}_applications': BehaviourMeasure(
            '1/min', f'applications of the {name} per minute driven', hysteresis, command,
            f'Applications of the {name}')}


def _reversals(setting: ReversalSetting, load: str) -> BehaviourMeasure:
    return BehaviourMeasure(
        '1/min', f'steering reversals per minute of more than {setting.gap_deg:g} degrees',
        f'Markkula and Engstroem 2006, {load} load: Butterworth low pass of order 2 at '
        f'{setting.cutoff_hz:g} Hz forth and back; pieces below {SHORTEST_S:g} s left out',
        'steering wheel, s theta_sw,max (CRG III-C2b)',
        f'Steering reversals, {setting.gap_deg:g}°')


_STEPS = 'at the scenario steps'
_EVENT = f'within {USUAL_LIMITS.window_s:g} s, first onset after the event'
_GAP = (f'first step at which a wheel is beyond the boundary; others are in the lane if they '
        f'overlap it by {IN_LANE:g} m, up to {NEAR:g} m away')
_TAKEN = f'simulated time; a request counts for {LONGEST_WAIT_S:g} s'
_BUMPERS, _WHEELS = 'bumper to bumper', 'wheels, at the sides of the vehicle'

MEASURES = {
    **_spread('speed', 'm/s', 'the speed, negative in reverse', _STEPS, 'rear axle',
              mean='Speed, mean', sd='Speed, standard deviation'),
    **_spread('acceleration', 'm/s^2', 'the longitudinal acceleration', _STEPS, 'rear axle'),
    **_spread('jerk', 'm/s^3', 'the longitudinal jerk',
              'difference of the accelerations of successive scenario steps over their time',
              'rear axle', sd='Jerk, standard deviation'),
    'time_above_limit': BehaviourMeasure(
        's', 'time in which the speed is above the limit of the lanelet',
        'no tolerance; limits of signs and of events', 'rear axle', 'Time above the speed limit'),
    'time_with_limit': BehaviourMeasure(
        's', 'time in a lanelet that has a limit', 'limits of signs and of events', 'center'),
    'sdlp': BehaviourMeasure(
        'm', "standard deviation of the offset from the lane's centre line, lane changes cut out",
        f'N - 1; above {STANDING:g} m/s; a change is cut out from where the vehicle begins to '
        f'move sideways faster than {SIDEWAYS:g} m/s until it no longer does, at most '
        f'{LONGEST_HALF_S:g} s on either side', 'center', 'Deviation of lateral position (SDLP)'),
    'lane_offset_mean': BehaviourMeasure(
        'm', "mean offset to the left of the lane's centre line", 'the samples of sdlp', 'center',
        'Offset in the lane, mean'),
    'lane_changes': BehaviourMeasure(
        '1', 'changes to a neighbouring lane', 'completed: the centre is across', 'center',
        'Lane changes'),
    'srr_visual': _reversals(VISUAL, 'visual'),
    'srr_cognitive': _reversals(COGNITIVE, 'cognitive'),
    'tlc_min': BehaviourMeasure(
        's', 'smallest time to lane crossing of the first wheel',
        f'speed and yaw rate held; up to {HORIZON_S:g} s, lane changes cut out', _WHEELS,
        'Time to lane crossing, least'),
    'tlc_linear_min': BehaviourMeasure(
        's', 'smallest linear time to lane crossing',
        f'distance to the boundary over the speed towards it; up to {HORIZON_S:g} s, lane changes '
        'cut out', _WHEELS),
    **_pedal('throttle'), **_pedal('brake'),
    'tlc': BehaviourMeasure(
        's', 'time to lane crossing of the first wheel',
        f'speed and yaw rate held; up to {HORIZON_S:g} s, 0 with a wheel across', _WHEELS,
        per='step'),
    'tlc_linear': BehaviourMeasure(
        's', 'distance to the boundary over the speed towards it, of the first wheel',
        f'up to {HORIZON_S:g} s, 0 with a wheel across', _WHEELS, per='step'),
    'reaction_throttle': BehaviourMeasure(
        's', 'time from the event until the throttle is released',
        f'by {USUAL_LIMITS.throttle_release:g} of its travel; {_EVENT}', 'throttle', per='event'),
    'reaction_brake': BehaviourMeasure(
        's', 'time from the event until the brake is pressed',
        f'from {USUAL_LIMITS.brake_press:g} of its travel on; {_EVENT}', 'brake', per='event'),
    'reaction_steering': BehaviourMeasure(
        's', 'time from the event until the steering wheel is turned',
        f'at {USUAL_LIMITS.wheel_rate_deg:g} degrees/s or more over the last '
        f'{USUAL_LIMITS.rate_time_s:g} s; {_EVENT}', 'steering wheel',
        per='event'),
    'gap_to_leader': BehaviourMeasure(
        'm', 'gap to the leader in the lane entered', _GAP, _BUMPERS, per='lane change'),
    'gap_accepted_leader': BehaviourMeasure(
        's', 'gap to the leader in the lane entered over the own speed', _GAP,
        _BUMPERS, per='lane change'),
    'gap_to_follower': BehaviourMeasure(
        'm', 'gap to the follower in the lane entered', _GAP, _BUMPERS, per='lane change'),
    'gap_accepted_follower': BehaviourMeasure(
        's', "gap to the follower in the lane entered over the follower's speed", _GAP,
        _BUMPERS, per='lane change'),
    'take_over_hands_on': BehaviourMeasure(
        's', 'time from the request to the first input',
        f'pedal from {PEDAL_INPUT:g} of its travel on, or steering wheel {WHEEL_INPUT_DEG:g} '
        f'degrees from where it was; {_TAKEN}', 'consumed command', per='take-over'),
    'take_over_stable': BehaviourMeasure(
        's', 'time from the request to the beginning of the first stable second',
        f'{STABLE_S:g} s after the first input in which no wheel is beyond its lane, the steering '
        f'wheel stays within {STABLE_WHEEL_DEG:g} degrees and the acceleration within '
        f'{STABLE_ACCELERATION:g} m/s^2; {_TAKEN}', 'wheels, steering wheel and rear axle',
        per='take-over'),
}
