# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Dense traffic on any maps, judged from outside.

Drives CommonRoad files with traffic alone, recorded vehicles as agents, and looks for what must
not happen, in nothing but states at each scenario time step and the file (package `judge` beside
this file; it uses no code of crgame_ros): overlaps, lines crossed at red, lateral acceleration,
vehicles off the road, stands that no light, queue or human explains, braking beyond 4 m/s^2,
jerk, rights of way that were taken, lane changes undone within 12 s. The exit code is 1 where a
demand is not met.

Columns: overlaps (there when placed / recorded so / struck while standing), red (could not stop:
more than 3 m/s^2 from when the light left green, in the first 3 s), lateral p99 and max [m/s^2],
off the road: events (placed there) and furthest [m], stands beyond 90 s unexplained (behind what
is no agent and stands), braking beyond 4 m/s^2: events and share of driven time [per mille],
jerk p99 and max [m/s^3], forced to brake hard by one that had to yield (drove over a crossing
before a person), lane changes and those undone, agents spawned and left, mean number and speed
[m/s].
"""

import argparse
from collections import Counter
from dataclasses import asdict
import json
import multiprocessing
import os
from pathlib import Path
import sys
import time

from crgame_ros.game.traffic_spec import TrafficSpec
from judge.roads import JudgedRoads
from judge.verdict import judge, Verdict
from traffic_drive import drive

ROOT = Path(__file__).resolve().parents[1]
HEADER = (f'{"map":34}{"seed":>5}{"overlaps":>14}{"red":>8}{"lat p99":>9}{"max":>6}'
          f'{"off road":>12}{"stands":>8}{"brakes":>7}{"‰":>7}{"jerk":>6}{"max":>7}'
          f'{"forced":>8}{"changes":>12}{"spawned":>9}{"left":>6}{"agents":>8}'
          f'{"m/s":>6}{"drive s":>9}{"judge s":>8}')


def default_files() -> list[Path]:
    """List all published scenarios beside the project, and our own."""
    shared = ROOT.parent / 'shared' / 'scenarios'
    return [*sorted(shared.glob('*.xml')), *sorted((shared / 'more').glob('*.xml')),
            *sorted((ROOT / 'scenarios').glob('*.xml'))]


# File, traffic, duration [s], seed, whether what is recorded takes part.
Task = tuple[Path, TrafficSpec, float, int, bool]
Done = tuple[Task, Verdict | None, str, float, float]


def run(task: Task) -> Done:
    """Drive and judge one file with one seed."""
    path, spec, seconds, seed, recorded = task
    start = time.perf_counter()
    try:
        driven = drive(path, spec, seconds, seed, recorded)
        middle = time.perf_counter()
        verdict = judge(driven.history, JudgedRoads(driven.scenario.scenario.lanelet_network),
                        driven.recording)
    except Exception as error:  # one map must not end the table
        return task, None, f'{type(error).__name__}: {error}', 0.0, 0.0
    return task, verdict, '', middle - start, time.perf_counter() - middle


def row(name: str, seed: str, found: Verdict) -> str:
    """Format the result of a run as a row."""
    n = found.counts
    overlaps = f'{n["overlap"]} ({n["overlap placed"]}/{n["overlap recorded"]}/' \
        f'{n["overlap struck"]})'
    red = f'{n["red"]} ({n["red unavoidable"]})'
    off = f'{n["off road"]} ({n["off road placed"]})'
    stands = f'{n["unexplained"]} ({n["blocked"]})'
    forced = f'{n["forced"]} ({n["zebra"]})'
    changes = f'{found.changes} ({n["undone"]})'
    return (f'{name:34}{seed:>5}{overlaps:>14}{red:>8}{found.lateral_p99:9.2f}'
            f'{found.lateral_max:6.1f}{off:>7}{found.off_road_max:5.2f}{stands:>8}'
            f'{n["braking"]:7}{1e3 * found.hard_share:7.2f}{found.jerk_p99:6.1f}'
            f'{found.jerk_max:7.1f}{forced:>8}{changes:>12}{found.spawned:9}{found.left:6}'
            f'{found.mean_agents:8.1f}{found.mean_speed:6.1f}')


def total(verdicts: list[Verdict]) -> str:
    """Write the sums of all runs; percentiles are the worst of a run."""
    driven = sum(x.driven_s for x in verdicts)
    present = sum(x.present_s for x in verdicts)
    seconds = sum(x.seconds for x in verdicts)
    return row('total', '', Verdict(
        tuple(event for x in verdicts for event in x.events), seconds,
        *(max(getattr(x, name) for x in verdicts) for name in (
            'lateral_p99', 'lateral_max', 'off_road_max')),
        sum(x.hard_share * x.driven_s for x in verdicts) / max(driven, 1e-9),
        *(max(getattr(x, name) for x in verdicts) for name in ('jerk_p99', 'jerk_max')),
        *(sum(getattr(x, name) for x in verdicts) for name in ('changes', 'spawned', 'left')),
        present / max(seconds, 1e-9),
        sum(x.mean_speed * x.present_s for x in verdicts) / max(present, 1e-9), driven, present))


def report(done: Done, verbose: bool) -> None:
    """Print a run."""
    (path, _, _, seed, _), found, error, drive_s, judge_s = done
    if found is None:
        print(f'{path.stem:34}{seed:5}  {error[:150]}', flush=True)
        return
    print(f'{row(path.stem[:33], str(seed), found)}{drive_s:9.1f}{judge_s:8.1f}  '
          f'{"; ".join(found.broken)}', flush=True)
    if verbose:
        for event in found.events:
            print(f'    {event.at_s:7.1f} s  {event.what}: {" and ".join(event.ids)} at '
                  f'({event.place[0]:.1f}, {event.place[1]:.1f}): {event.note}', flush=True)


def arguments() -> argparse.Namespace:
    """Read the command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('files', nargs='*', type=Path, metavar='FILE',
                        help='CommonRoad files (default: ../shared/scenarios, its folder more, '
                             'and our own)')
    parser.add_argument('--agents', type=int, default=40)
    parser.add_argument('--flow', type=float, default=400.0,
                        help='arrivals an hour at each lane that begins at the edge')
    parser.add_argument('--minutes', type=float, default=5.0)
    parser.add_argument('--seeds', default='0,1,2')
    parser.add_argument('--recorded', choices=('reactive', 'replayed', 'absent'),
                        default='reactive', help='what becomes of recorded vehicles')
    parser.add_argument('--model', default='acc')
    parser.add_argument('--jobs', type=int, default=1)
    parser.add_argument('--verbose', action='store_true', help='print every event')
    parser.add_argument('--json', type=Path, help='write everything found into this file')
    return parser.parse_args()


def main() -> int:
    """Run the benchmark."""
    values = arguments()
    recorded = 'reactive' if values.recorded == 'reactive' else 'replayed'
    spec = TrafficSpec(recorded=recorded, agents=values.agents, flow=values.flow,
                       model=values.model)
    tasks: list[Task] = [(path, spec, 60.0 * values.minutes, int(seed),
                          values.recorded != 'absent')
                         for path in values.files or default_files()
                         for seed in values.seeds.split(',')]
    os.environ.setdefault('OMP_NUM_THREADS', '1')
    print(HEADER, flush=True)
    results: list[Done] = []
    with multiprocessing.get_context('spawn').Pool(values.jobs, maxtasksperchild=4) as pool:
        for done in pool.imap(run, tasks):
            results.append(done)
            report(done, values.verbose)
    verdicts = [found for _, found, _, _, _ in results if found is not None]
    if verdicts:
        print(total(verdicts))
        causes = Counter(event.note.partition(':')[0] for x in verdicts for event in x.events
                         if event.what == 'braking')
        print('braked hard for: ' + ', '.join(f'{n} {cause}' for cause, n in
                                              causes.most_common()))
    bad = sum(found is None or bool(found.broken) for _, found, _, _, _ in results)
    print(f'{len(results)} runs, {bad} with something that must not be')
    if values.json is not None:
        values.json.write_text(json.dumps([
            {'file': str(path), 'seed': seed, 'error': error,
             'verdict': None if found is None else {**asdict(found), 'broken': found.broken}}
            for (path, _, _, seed, _), found, error, _, _ in results], indent=1), encoding='utf-8')
    return 1 if bad else 0


if __name__ == '__main__':
    sys.exit(main())
