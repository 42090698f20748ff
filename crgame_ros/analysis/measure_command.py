# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""`crgame measure`: print how critical a run was, rules, and how people drove, also as JSON."""

import argparse
from collections.abc import Iterator, Mapping, Sequence
import json
from pathlib import Path
from typing import Any, TYPE_CHECKING

from crgame_ros.analysis.criticality.thresholds import OPTIONS, Thresholds, USUAL

if TYPE_CHECKING:
    from crgame_ros.analysis.rules.vehicle_rules import VehicleRules
    from crgame_ros.analysis.run_measures import RunMeasures

# Printed after a value that is beyond its threshold.
CRITICAL = '   <- critical'

DESCRIPTION = """\
Measure how critical a recorded run was: for each driven vehicle the worst moment of each measure,
the time it spent below a threshold, whose way it crossed, and the traffic rules that it broke.
Then how people drove: lane keeping, steering reversals, pedals, reactions to events, gaps
accepted, take-overs.

Distances are bumper to bumper along the vehicle's own lane. docs/criticality.md, docs/scores.md
and docs/behaviour.md define each.

  crgame measure runs/NAME
  crgame measure runs/NAME --request take-over --json"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of the command."""
    parser.add_argument('run', type=Path, help='folder of a run, or its recording')
    parser.add_argument('--epoch', type=int, help='which run of a recording that holds several '
                        '(resets count them from 0; default: the last)')
    for field, (name, sentence) in OPTIONS.items():
        default = getattr(USUAL, field)
        parser.add_argument(f'--{name.replace("_", "-")}', type=float, default=default,
                            dest=field, metavar='N', help=f'{sentence} (default: {default:g})')
    parser.add_argument('--request', action='append', default=[], metavar='EVENT',
                        help='an event that asks to take over an AV, as orders of its seat do; '
                        'may be given several times')
    parser.add_argument('--json', action='store_true', help='print it as JSON')
    parser.set_defaults(command=measure)


def measure(values: argparse.Namespace) -> int:
    """Measure a run, and print the results."""
    from crgame_ros.analysis.behaviour.driver import behaviour_lines, detection_lines
    from crgame_ros.analysis.run_measures import check_requests, measure_run
    from crgame_ros.recording.progress import on_stderr, Progress
    from crgame_ros.recording.run_folder import recording_in
    from crgame_ros.recording.run_record import read_run_record
    thresholds = Thresholds(*(getattr(values, field) for field in OPTIONS))
    thresholds.check('--')
    path = values.run
    record = read_run_record(recording_in(path), values.epoch,
                             Progress(on_stderr, f'reading {path}'))
    check_requests(record, values.request, '--request')
    found = measure_run(record, thresholds, values.request,
                        Progress(on_stderr, f'measuring {path}'),
                        Progress(on_stderr, f'measuring the drivers of {path}'))
    if values.json:
        print(json.dumps(found.as_dict(), indent=2, allow_nan=False))
    else:
        lines = [*_lines(found),
                 *(line for each in found.behaviour if each.human or each.take_overs
                   for line in behaviour_lines(each)),
                 *(line for each in found.detection for line in detection_lines(each))]
        print('\n'.join(lines))
    return 0


def _lines(measured: 'RunMeasures') -> Iterator[str]:
    from crgame_ros.analysis.criticality.criticality import EXPOSURES, MEASURES
    ids, limits = measured.criticality.ids, measured.criticality.thresholds
    for vehicle, rules in zip(measured.criticality.report(), measured.rules, strict=True):
        yield vehicle.vehicle_id
        near = {name: worst for name, measure in MEASURES.items()
                if (worst := vehicle.worst.get(name)) and measure.matters(worst.value)}
        for name, worst in near.items():
            critical = limits.exceeded(name, worst.value)
            yield (f'  {name:<13}{worst.value:9.2f} {MEASURES[name].unit:<6} {worst.other} at '
                   f'{worst.time_s:.1f} s{CRITICAL if critical else ""}')
        if not near:
            yield '  no other was near'
        for name, exposure in EXPOSURES.items():
            yield (f'  {name.removesuffix("_s"):<15}{vehicle.exposures[name]:7.2f} '
                   f'{exposure.unit:<6} {exposure.told(limits).definition}')
        for each in vehicle.crossings:
            yield (f'  pet          {each.pet_s:9.2f} s      {ids[each.second]} after '
                   f'{ids[each.first]} at {each.entered_s:.1f} s'
                   f'{CRITICAL if limits.exceeded("pet", each.pet_s) else ""}')
        yield from _rule_lines(rules)


def _rule_lines(rules: 'VehicleRules') -> Iterator[str]:
    """Yield the lines passed, and how long the safe distance was not kept, where it was so."""
    from crgame_ros.analysis.rules.vehicle_rules import RULE_MEASURES
    for name, value in rules.values.items():
        if value:
            measure = RULE_MEASURES[name]
            shown = f'{value:.0f}' if measure.is_count else f'{value:.2f}'
            unit = 's' if measure.unit == 's' else ''
            yield f'  {name:<21}{shown:>8} {unit:<6} {measure.label.lower()}'
    for each in rules.passed:
        yield f'  {each.kind} passed at {each.speed:.1f} m/s, lanelet {each.lanelet}'


NEVER = '-'
HEAD = ('planner', 'vehicle', 'gap [m]', 'ttc [s]', 'a_req [m/s^2]', 'distance [m]', 'tet [s]',
        'contacts', 'human differs', 'others differ')


def replay_rows(found: Sequence[Mapping[str, Any]]) -> Iterator[tuple[str, ...]]:
    """
    Yield a row for each planner and vehicle, with the cells that `HEAD` names.

    :param found: entries of `Alternative.as_dict`; the entry of the recorded run itself lacks the
        comparison.
    """
    from crgame_ros.analysis.criticality.criticality import MEASURES
    for each in found:
        for vehicle_id, vehicle in each['criticality']['vehicles'].items():
            worst = {name: f'{entry["value"]:.2f}' for name, entry in vehicle['worst'].items()
                     if entry['value'] is not None
                     and MEASURES[name].matters(entry['value'])}
            touched = [item for item in each.get('contacts') or ()
                       if vehicle_id in (item['vehicle'], item['with'])]
            yield (
                each['planner'], vehicle_id,
                *(worst.get(name, NEVER) for name in ('gap', 'ttc', 'a_req', 'min_distance')),
                f'{vehicle["exposures"]["tet_s"]["value"]:.1f}',
                str(len(touched)) if each.get('contacts') is not None else NEVER,
                *(NEVER if each.get(name) is None else f'from {each[name]:.1f} s'
                  for name in ('human_differs_s', 'others_differ_s')))
