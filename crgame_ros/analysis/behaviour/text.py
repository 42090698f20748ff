# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Lines of text on how a vehicle was driven."""

from collections.abc import Iterator
import math

from crgame_ros.analysis.behaviour.gaps_accepted import Neighbour
from crgame_ros.analysis.behaviour.measures import MEASURES
from crgame_ros.analysis.behaviour.steering_reversals import COGNITIVE, ReversalSetting, VISUAL
from crgame_ros.analysis.behaviour.take_overs import TakeOver
from crgame_ros.analysis.behaviour.task_events import DetectionScore
from crgame_ros.analysis.behaviour.vehicle import DriverBehaviour, LaneChangeGap


def behaviour_lines(found: DriverBehaviour) -> Iterator[str]:
    """Yield lines on how a vehicle was driven; undefined values are left out."""
    values = found.values
    yield f'{found.vehicle_id} as it was driven'
    for name in ('speed', 'acceleration', 'jerk'):
        yield _line(f'{name}_mean', values[f'{name}_mean'],
                    f'{name}, sd {values[f"{name}_sd"]:.2f}, '
                    f'{values[f"{name}_min"]:.2f} to {values[f"{name}_max"]:.2f}')
    lines = [
        ('time_above_limit', f'of {values["time_with_limit"]:.1f} s with a speed limit'),
        ('sdlp', f'of the centre, N - 1; lane changes cut out: {values["lane_changes"]:.0f}'),
        ('tlc_min', 'smallest time to lane crossing, speed and yaw rate held'),
        ('tlc_linear_min', 'the same by distance and speed towards the boundary'),
        ('srr_visual', _setting(VISUAL)), ('srr_cognitive', _setting(COGNITIVE)),
        *((f'{pedal}_applications', f'applied {100.0 * values[f"{pedal}_share"]:.0f} % of the '
           'time') for pedal in ('throttle', 'brake'))]
    for name, text in lines:
        if math.isfinite(values[name]):
            yield _line(name, values[name], text)
    for each in found.reactions:
        for name, value in zip(('throttle', 'brake', 'steering'), each.reaction, strict=True):
            if math.isfinite(value):
                yield _line(f'reaction_{name}', value, f'after {each.event} at '
                            f'{each.event_s:.1f} s')
    for change in found.lane_changes:
        yield from _lane_change(change)
    for take_over in found.take_overs:
        yield from _take_over_lines(take_over)


def detection_lines(found: DetectionScore) -> Iterator[str]:
    """Yield lines on a driver's results in a detection response task."""
    yield f'{found.task}, answered in {found.seat}'
    yield (f'  hit_rate             {found.hit_rate:9.2f}        {found.hits} hits, '
           f'{found.misses} misses, {found.premature} premature, {found.unrequested} unrequested')
    if found.hits:
        yield (f'  response_mean        {found.response_mean_s:9.2f} s      median '
               f'{found.response_median_s:.2f}, by the page that showed the light')


def _line(name: str, value: float, text: str) -> str:
    return f'  {name:<21}{value:9.2f} {MEASURES[name].unit:<6} {text}'.rstrip()


def _setting(setting: ReversalSetting) -> str:
    return f'steering reversals of {setting.gap_deg:g} degrees, {setting.cutoff_hz:g} Hz'


def _lane_change(change: LaneChangeGap) -> Iterator[str]:
    if math.isnan(change.time_s):
        return
    where = f'to the {change.side} at {change.time_s:.1f} s'
    told = False
    for role in ('leader', 'follower'):
        neighbour: Neighbour | None = getattr(change.gap, role)
        if neighbour is not None and math.isfinite(neighbour.time_gap_s):
            told = True
            yield _line(f'gap_accepted_{role}', neighbour.time_gap_s,
                        f'{getattr(change, role)} in {neighbour.gap:.1f} m, {where}')
    if not told:
        yield f'  lane change {where}: no vehicle near'


def _take_over_lines(take_over: TakeOver) -> Iterator[str]:
    by = '' if take_over.request is None else f', asked for by {take_over.request.by}'
    yield f'  taken over from {take_over.seat_s:.1f} to {take_over.end_s:.1f} s{by}'
    for name, value in (('take_over_hands_on', take_over.to_hands_on_s),
                        ('take_over_stable', take_over.to_stable_s)):
        if math.isfinite(value):
            yield _line(name, value, 'after the request')
