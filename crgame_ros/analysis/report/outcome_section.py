# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The section on a run's events, contacts, violations and traffic rules."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from crgame_ros.analysis.report.run_section import named
from crgame_ros.analysis.report.section import Section
from crgame_ros.analysis.report.story_section import moment
from crgame_ros.analysis.report.text import free, note, NOTHING, number, plain, table
from crgame_ros.analysis.rules.vehicle_rules import RULE_MEASURES
from crgame_ros.analysis.runs.run import Run
from crgame_ros.units import unit_symbol


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
             moment(run, _time_s(run, item)), free(item['kind']),
             number(item['speed']), number(item['other_speed']), free(item['avoidable_by']))
            for item in contacts], 'numbers')


def _time_s(run: Run, item: Mapping[str, Any]) -> float | None:
    n = item['n']
    return None if n is None else n * run.log.game.scheduler.dt_s


def _violations(run: Run) -> str:
    if run.outcome is None:
        return note('Violations: the recording does not tell.')
    found = run.outcome['drivability']['list']
    if not found:
        return note('No vehicle left the road or broke a rule that was checked.')
    return table('Violations, when each began', ('vehicle', 'what', 'at [s]'), [
        (named(run, item['vehicle']), free(item['what']),
         NOTHING if item['n'] is None else moment(run, _time_s(run, item)))
        for item in found], 'numbers')


def _rules(run: Run) -> str:
    html = table('Traffic rules', ('vehicle', *(
        f'<span title="{plain(f"{each.definition}; {each.variant}")}">{each.label}</span>'
        + ('' if each.unit == '1' else f' [{unit_symbol(each.unit)}]')
        for each in RULE_MEASURES.values())), [
            (named(run, vehicle.vehicle_id), *(
                number(vehicle.values[name], 0 if each.is_count else 2)
                for name, each in RULE_MEASURES.items()))
            for vehicle in run.usual_rules], 'numbers')
    scheduler = run.log.game.scheduler
    passed = [(named(run, vehicle.vehicle_id), each.kind, str(each.lanelet),
               moment(run, (each.k - scheduler.k0) * scheduler.time_step_s), number(each.speed))
              for vehicle in run.usual_rules for each in vehicle.passed]
    return html if not passed else html + table(
        'Lines passed at red, or at a stop sign without a halt', (
            'vehicle', 'what', 'lanelet', 'at [s]', 'speed [m/s]'), passed, 'numbers')


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
