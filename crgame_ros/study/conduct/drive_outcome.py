# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What became of a drive, from what the nodes told while it went on."""

from typing import Any

from crgame_ros.cockpit.run_status import RunStatus

# How runs end that were driven to their end: at their time, or by their own drivability.
TIME, DRIVABILITY = 'duration', 'drivability of '
RESET = 'reset'
_CUT_SHORT = {'stop': 'somebody stopped the run', RESET: 'somebody began the run anew',
              'signal': 'the programs were asked to end', 'silence': 'the simulation fell silent'}


def cut_short(reason: str) -> str:
    """
    Return why a run is no whole drive; empty if it is one.

    :param reason: with which it ended, as sim_node gives it.
    """
    if reason == TIME or reason.startswith(DRIVABILITY):
        return ''
    return _CUT_SHORT.get(reason, f'the run ended: {reason or "nobody knows why"}')


def outcome_of(status: RunStatus, seat: str, end_time_s: float) -> dict[str, Any]:
    """
    Return what became of a drive.

    :param status: at its end, which was not cut short.
    :param seat: vehicle of the participant.
    :param end_time_s: the run's clock then [s].
    :return: `outcome`: time, collision or off_road; `end_time_s`; and how often the vehicle
        touched something, and left the road.
    """
    contacts, departures = _times(status, seat)
    outcome = 'time'
    if status.reason != TIME:
        # Its own drivability ended it: whichever came last.
        outcome = 'collision' if contacts and contacts[-1] >= max(departures, default=0.0) \
            else 'off_road'
    return {'outcome': outcome, 'end_time_s': round(end_time_s, 6), 'contacts': len(contacts),
            'departures': len(departures)}


def clean_s(status: RunStatus, seat: str, end_time_s: float) -> float:
    """Return the longest time of a drive without a contact or leaving the road [s]."""
    contacts, departures = _times(status, seat)
    times = [0.0, *sorted((*contacts, *departures)), end_time_s]
    return max(later - sooner for sooner, later in zip(times, times[1:], strict=False))


def _times(status: RunStatus, seat: str) -> tuple[list[float], list[float]]:
    return ([entry['t'] for entry in status.contacts if seat in (entry['vehicle'], entry['with'])],
            [entry['t'] for entry in status.departures if entry['vehicle'] == seat])
