# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Selects the moments of a run that its report shows, and finds them for links."""

from collections.abc import Sequence

from crgame_ros.analysis.criticality.criticality import Criticality, MEASURES
from crgame_ros.analysis.pictures.critical_moments import Moment, TOGETHER_S
from crgame_ros.recording.run_record import RunRecord

# Greatest number of pictures of a run, start and end included.
MOST_FRAMES = 14
# This measure has the same value as the time headway.
TWICE = 'time_gap'


def story_moments(record: RunRecord, criticality: Criticality,
                  critical: Sequence[Moment]) -> tuple[Moment, ...]:
    """
    Return the moments of a run to show, in order of time.

    These are start and end, the most critical ones, and those to which worst values are linked.

    :param critical: the critical ones, the most critical one first.
    """
    log = record.log
    scheduler = log.game.scheduler
    first_s, last_s = ((int(k) - scheduler.k0) * scheduler.time_step_s
                       for k in (log.ks[0], log.ks[-1]))
    ends = [Moment(first_s, 'start', ()), Moment(last_s, 'end', ())]
    found = list(critical)
    found += [Moment(worst.time_s, f'{MEASURES[name].label} of {vehicle.vehicle_id} to '
                     f'{worst.other} is {worst.value:.2f} {MEASURES[name].symbol}',
                     (vehicle.vehicle_id, worst.other))
              for vehicle in criticality.report() for name, worst in vehicle.worst.items()
              if name != TWICE and MEASURES[name].matters(worst.value)]
    chosen: list[Moment] = []
    for each in found:
        if all(abs(each.time_s - other.time_s) > TOGETHER_S for other in chosen) \
                and len(chosen) + len(ends) < MOST_FRAMES:
            chosen.append(each)
    chosen += [end for end in ends
               if all(abs(end.time_s - other.time_s) > TOGETHER_S for other in chosen)]
    return tuple(sorted(chosen))


def nearest_moment(moments: Sequence[Moment], time_s: float) -> int | None:
    """Return the index of the moment that shows a time; None if there is none near it."""
    near = min(range(len(moments)), key=lambda i: abs(moments[i].time_s - time_s), default=None)
    if near is None or abs(moments[near].time_s - time_s) > TOGETHER_S + 1e-6:
        return None
    return near
