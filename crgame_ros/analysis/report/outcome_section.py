# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What happened in a run: events, contacts, traffic rules, and how critical it was."""

from collections.abc import Iterator, Sequence

from crgame_ros.analysis.criticality.criticality import (
    CHIEF,
    EXPOSURES,
    MEASURES,
    VehicleCriticality,
)
from crgame_ros.analysis.criticality.headways import SHORT_S
from crgame_ros.analysis.criticality.thresholds import Thresholds
from crgame_ros.analysis.pictures.critical_moments import TWICE
from crgame_ros.analysis.report.run_section import named
from crgame_ros.analysis.report.section import (
    filled_table,
    free,
    marked,
    measure_word,
    note,
    NOTHING,
    number,
    Plot,
    PlotLimit,
    Section,
    share,
    table,
    vehicle_line,
)
from crgame_ros.analysis.report.story_section import moment
from crgame_ros.analysis.rules.vehicle_rules import RULE_MEASURES
from crgame_ros.analysis.runs.run import Run
from crgame_ros.measures import with_unit
import numpy as np
from numpy.typing import NDArray

# Longer times are not meaningful: plots initially leave them out [s].
_SHOWN_S = 10.0
# Greater decelerations are physically impossible [m/s^2].
_SHOWN_DRAC = 12.0


def outcome_section(run: Run) -> Section:
    """Return the section on contacts, violations, rules and events that took effect."""
    html = _contacts(run) + _violations(run) + _rules(run) + _events(run)
    return Section('outcome', 'Contacts, violations, events', html)


def _contacts(run: Run) -> str:
    contacts = run.contacts
    if contacts is None:
        return note('Contacts: the recording does not tell.')
    if not contacts:
        return note('No driven vehicle touched anything.')
    return table('Contacts, the first of each pair', (
        'vehicle', 'touched', 'at [s]', 'kind', 'speed [m/s]', "other's [m/s]",
        'avoidable by'), [
            (named(run, item['vehicle']), named(run, item['with']),
             moment(run, _time_s(run, item['n'])), free(item['kind']),
             number(item['speed']), number(item['other_speed']), free(item['avoidable_by']))
            for item in contacts], 'numbers')


def _time_s(run: Run, n: int | None) -> float | None:
    return None if n is None else n * run.log.game.scheduler.dt_s


def _violations(run: Run) -> str:
    if run.outcome is None:
        return note('Violations: the recording does not tell.')
    found = run.outcome['drivability']['list']
    if not found:
        return note('No vehicle left the road or broke a rule that was checked.')
    return table('Violations, when each began', ('vehicle', 'what', 'at [s]'), [
        (named(run, item['vehicle']), free(item['what']), moment(run, _time_s(run, item['n'])))
        for item in found], 'numbers')


def _rules(run: Run) -> str:
    html = table('Traffic rules', ('vehicle', *(
        with_unit(measure_word(each), each.symbol)
        for each in RULE_MEASURES.values())), [
            (named(run, vehicle.vehicle_id), *(
                number(vehicle.values[name], 0 if each.is_count else 2)
                for name, each in RULE_MEASURES.items()))
            for vehicle in run.usual_rules], 'numbers')
    scheduler = run.log.game.scheduler
    return html + filled_table('Lines passed at red, or at a stop sign without a halt', (
        'vehicle', 'what', 'lanelet', 'at [s]', 'speed [m/s]'), (
            (named(run, vehicle.vehicle_id), each.kind, str(each.lanelet),
             moment(run, (each.k - scheduler.k0) * scheduler.time_step_s), number(each.speed))
            for vehicle in run.usual_rules for each in vehicle.passed))


def _events(run: Run) -> str:
    known = run.log.game.events
    if not known and not run.record.fired:
        return note('The game has no events.')
    return table('Events of the game', ('event', 'took effect at [s]', 'by'),
                 _event_rows(run), 'numbers')


def _event_rows(run: Run) -> Iterator[Sequence[str]]:
    dt_s = run.log.game.scheduler.dt_s
    fired = run.record.fired
    for event in fired:
        yield free(event.name), moment(run, event.n * dt_s), event.by
    for spec in run.log.game.events:
        if all(event.name != spec.name for event in fired):
            yield free(spec.name), 'never', NOTHING


def criticality_section(run: Run) -> Section:
    """Return the section on criticality."""
    limits = run.usual_criticality.thresholds
    measured = run.usual_criticality.report()
    html = note('Each row is the most critical value of the whole run, with which other, when; '
                'the time leads to the picture of that moment. Bold and ‼ mark what is beyond a '
                f'threshold: TTC below {limits.ttc_s:g} s, DRAC above {limits.drac:g} m/s², '
                f'PET below {limits.pet_s:g} s.')
    for vehicle in measured:
        caption = f'Worst values of {named(run, vehicle.vehicle_id)}'
        html += filled_table(caption, ('measure', 'worst', 'unit', 'against', 'at [s]'),
                             _worst(run, vehicle, limits), 'numbers worst') \
            or f'<p>{caption}: no other was near.</p>'
    told = [each.told(limits) for each in EXPOSURES.values()]
    html += table('Over the whole run', ('vehicle', *(
        with_unit(each.label, each.symbol) for each in told)), [
            (named(run, vehicle.vehicle_id), *map(number, vehicle.exposures.values()))
            for vehicle in measured], 'numbers')
    html += filled_table('Following a leader: gaps bumper to bumper, headways front to front', (
        'vehicle', 'value', 'mean', 'median', 'unit', *(f'below {limit} s' for limit in SHORT_S)),
        (row for vehicle in measured for row in _headways(run, vehicle)))
    ids = run.usual_criticality.ids
    html += filled_table('Ways that crossed: post-encroachment time (PET)', (
        'vehicle', 'first', 'second', 'second entered at [s]', 'PET [s]'), (
            (named(run, vehicle.vehicle_id), named(run, ids[each.first]),
             named(run, ids[each.second]), moment(run, each.entered_s),
             marked(('≈ ' if each.is_estimate else '') + number(each.pet_s),
                    limits.exceeded('pet', each.pet_s)))
            for vehicle in measured for each in vehicle.crossings))
    return Section('criticality', 'Criticality', html, tuple(_plots(run, limits)))


def _worst(run: Run, vehicle: VehicleCriticality, limits: Thresholds) -> Iterator[Sequence[str]]:
    for name, measure in MEASURES.items():
        worst = vehicle.worst.get(name)
        if worst is None or name == TWICE or not measure.matters(worst.value):
            continue
        yield (measure_word(measure),
               marked(number(worst.value), limits.exceeded(name, worst.value)),
               measure.symbol, named(run, worst.other), moment(run, worst.time_s))


def _headways(run: Run, vehicle: VehicleCriticality) -> Iterator[Sequence[str]]:
    if not vehicle.headways.following:
        return
    for values, unit in ((vehicle.headways.distances(), 'm'), (vehicle.headways.times(), 's')):
        for name, each in values.items():
            shares = (share(part, 1.0) if unit == 's' else '' for part in each.below)
            yield (named(run, vehicle.vehicle_id), name.replace('_', ' '), number(each.mean),
                   number(each.median), unit, *shares)


def _plots(run: Run, limits: Thresholds) -> Iterator[Plot]:
    lines_at = {'ttc': (PlotLimit(limits.ttc_s, 'critical below'),),
                'drac': (PlotLimit(limits.drac, 'critical above'),),
                'min_distance': (PlotLimit(0.0, 'contact'),), 'gap': (PlotLimit(0.0, 'contact'),)}
    for name, measure in CHIEF.items():
        values = run.course[name]
        if not np.isfinite(values).any():
            continue
        unit = measure.symbol
        yield Plot(name.replace('_', '-'), measure.label, unit, tuple(
            vehicle_line(run, i, run.times_s, row) for i, row in enumerate(values)),
            lines_at.get(name, ()),
            bounds=_bounds(name, unit, values, limits))


def _bounds(name: str, unit: str, values: NDArray[np.float64],
            limits: Thresholds) -> tuple[float, float] | None:
    """Return a plot's initial bounds, if its extremes would hide the rest; None for all."""
    finite = values[np.isfinite(values)]
    most = float(finite.max())
    if unit == 's':
        least = min(0.0, float(finite.min()))
        return (1.05 * least, _SHOWN_S) if most > _SHOWN_S else None
    if name == 'drac':
        return -0.2, 1.1 * max(limits.drac, min(most, _SHOWN_DRAC))
    return None
