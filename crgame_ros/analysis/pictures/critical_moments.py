# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Finds the moments of a run that figures and reports show."""

from collections.abc import Collection, Iterator, Sequence
import math
from typing import NamedTuple

from crgame_ros.analysis.criticality.criticality import Criticality, MEASURES, Worst
from crgame_ros.recording.run_record import RunRecord
from crgame_ros.simulation.contacts import ContactEntry

# Moments this close to each other are merged [s].
TOGETHER_S = 1.0
# Longer times to collision do not make a moment [s].
NOTICED_S = 10.0
# Groups, in the order of their ranks.
_CONTACT, _CRITICAL, _EVENT, _NOTICED, _CLOSE = range(5)
# Replaces a value of zero in a division.
_LEAST = 1e-3
# Greatest number of pictures of a run, start and end included.
MOST_FRAMES = 14
# This measure has the same value as the time headway.
TWICE = 'time_gap'


class Moment(NamedTuple):
    """
    A moment to show.

    :param time_s: since the start of the run [s]
    :param why: what happens, in a few words.
    :param vehicles: ids of those involved, driven vehicles first.
    """

    time_s: float
    why: str
    vehicles: tuple[str, ...]


class _Ranked(NamedTuple):
    """A moment with its rank, smaller first."""

    group: int
    rank: float
    moment: Moment


def critical_moments(record: RunRecord, criticality: Criticality,
                     contacts: Sequence[ContactEntry] = ()) -> tuple[Moment, ...]:
    """
    Return the moments of a run, the most critical one first.

    Contacts come first, then values beyond their thresholds by how far they are beyond, events as
    they fired, the smallest ttc that is not critical, and finally the smallest distance of each
    vehicle. A moment within `TOGETHER_S` of a more critical one becomes part of it, at its time.

    :param criticality: criticality of the same run (`measure_log`).
    :param contacts: of the run, as in `timing.json`; those of unknown steps are left out.
    """
    dt_s = record.log.game.scheduler.dt_s
    found = [_contact(item['n'] * dt_s, (item['vehicle'], item['with'])) for item in contacts
             if item['n'] is not None]
    found += _critical(criticality)
    found += [_Ranked(_EVENT, event.n * dt_s, Moment(
        event.n * dt_s, f'event {event.name}', ())) for event in record.fired]
    found += _close(criticality, float(record.log.times_s[0]))
    moments: list[Moment] = []
    for _, _, moment in sorted(found):
        for place, other in enumerate(moments):
            if abs(other.time_s - moment.time_s) <= TOGETHER_S:
                moments[place] = _merged(other, moment)
                break
        else:
            moments.append(moment)
    return tuple(moments)


def _critical(criticality: Criticality) -> Iterator[_Ranked]:
    limits = criticality.thresholds
    for vehicle in criticality.report():
        for name in ('ttc', 'drac'):
            worst = vehicle.worst.get(name)
            if worst is None or worst.value == 0.0 or math.isinf(worst.value):
                # They touch.
                continue
            excess = limits.excess(name, worst.value)
            if excess > 1.0 or name == 'ttc' and worst.value < NOTICED_S:
                yield _Ranked(_CRITICAL if excess > 1.0 else _NOTICED, -excess,
                              _worst(vehicle.vehicle_id, name, worst))
        for crossing in vehicle.crossings:
            if limits.exceeded('pet', crossing.pet_s):
                first, second = (criticality.ids[i] for i in (crossing.first, crossing.second))
                yield _Ranked(_CRITICAL, -limits.pet_s / max(crossing.pet_s, _LEAST), Moment(
                    crossing.entered_s,
                    f'{second} enters {crossing.pet_s:.2f} s after {first} has left (PET)',
                    tuple(sorted((first, second), key=lambda each: each != vehicle.vehicle_id))))


def _worst(vehicle_id: str, name: str, worst: Worst) -> Moment:
    """Return the moment of a vehicle's worst value of a measure."""
    measure = MEASURES[name]
    return Moment(worst.time_s, f'{measure.label} of {vehicle_id} to {worst.other} is '
                  f'{worst.value:.2f} {measure.symbol}', (vehicle_id, worst.other))


def _close(criticality: Criticality, start_s: float) -> Iterator[_Ranked]:
    driven = [vehicle.vehicle_id for vehicle in criticality.report()]
    for vehicle in criticality.report():
        worst = vehicle.worst.get('min_distance')
        if worst is None or worst.time_s == start_s and worst.value > 0.0:
            # The initial distance is not a result of the run.
            continue
        both = vehicle.vehicle_id, worst.other
        # Both of two driven vehicles report the same pair.
        pair = tuple(sorted(both, key=driven.index)) if worst.other in driven else both
        yield _contact(worst.time_s, pair) if worst.value == 0.0 else _Ranked(
            _CLOSE, worst.value, Moment(
                worst.time_s, f'{named(pair)} are {worst.value:.2f} m apart', pair))


def _contact(time_s: float, pair: tuple[str, ...]) -> _Ranked:
    return _Ranked(_CONTACT, time_s, Moment(time_s, f'{named(pair)} touch', pair))


def named(names: Collection[str]) -> str:
    """Return the names of vehicles as part of a sentence."""
    *others, last = names or ('nobody',)
    return f'{", ".join(others)} and {last}' if others else last


def _merged(moment: Moment, later: Moment) -> Moment:
    """Return a less critical moment as part of another."""
    why = moment.why if later.why in moment.why else f'{moment.why}; {later.why}'
    return Moment(moment.time_s, why, tuple(dict.fromkeys((*moment.vehicles, *later.vehicles))))


def story_moments(record: RunRecord, criticality: Criticality,
                  critical: Sequence[Moment]) -> tuple[Moment, ...]:
    """
    Return the moments of a run to show, in order of time.

    These are start and end, the most critical ones, and those to which worst values are linked.

    :param critical: the critical ones, the most critical one first.
    """
    first_s, last_s = record.log.times_s[[0, -1]].tolist()
    ends = [Moment(first_s, 'start', ()), Moment(last_s, 'end', ())]
    found = [*critical, *(
        _worst(vehicle.vehicle_id, name, worst)
        for vehicle in criticality.report() for name, worst in vehicle.worst.items()
        if name != TWICE and MEASURES[name].matters(worst.value))]
    chosen: list[Moment] = []
    for each in found:
        if len(chosen) + len(ends) < MOST_FRAMES and _is_apart(each, chosen):
            chosen.append(each)
    chosen += [end for end in ends if _is_apart(end, chosen)]
    return tuple(sorted(chosen))


def _is_apart(moment: Moment, others: Sequence[Moment]) -> bool:
    return all(abs(moment.time_s - other.time_s) > TOGETHER_S for other in others)


def nearest_moment(moments: Sequence[Moment], time_s: float) -> int | None:
    """Return the index of the moment that shows a time; None if there is none near it."""
    near = min(range(len(moments)), key=lambda i: abs(moments[i].time_s - time_s), default=None)
    if near is None or abs(moments[near].time_s - time_s) > TOGETHER_S + 1e-6:
        return None
    return near
