# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
What has become slower since another version of the program.

    python benchmarks/regressions.py HEAD~20           # a revision, or the folder of a checkout
    python benchmarks/regressions.py v1.0 --only traffic --rounds 15
    python benchmarks/regressions.py --list

Both versions do the same work in turns, each in a process of its own with this version's
benchmarks: the same commands on the same recording, offline games, steps of traffic, of
environments and of planners, a live run. Times are processor time, which other load of the machine
hardly changes. A kind of work is slower, or faster, if its time differs by more than --limit in
all rounds but one. The exit code is 1 where one is slower, also where it no longer works.
"""

import argparse
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
import io
import json
import os
from pathlib import Path
import resource
import statistics
import subprocess
import sys
import tarfile
import tempfile
import time
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
# Kinds of work by name: made once in a process with the folder of a recording, done again and
# again; each returns its time in the unit of its name.
Work = Callable[[], float]
# Before an answer of a process.
TOLD = 'told: '
# With where they write, in a folder of their own.
COMMANDS = {'info': (), 'validate': (), 'measure': (), 'score': (), 'export': (),
            'report': ('--out', 'report.html'), 'figures': ('--out', 'figures')}
# Kinds of the offline runner, as `benchmarks/offline.py` names them.
OFFLINE = ('start of a cell, warm', 'cut-in game, 20 s, idm',
           'the same with drivability at 100 Hz', 'the same with criticality too',
           'a cell of an evaluation, 10 s', 'a cell of 10 s, all measures and rows')
TRAFFIC_STEPS, ENVIRONMENT_STEPS, PLANNED_S = 40, 100, 8.0


def children_s(*command: str) -> float:
    """Return the processor time of a command and of all that it starts [s]."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    with tempfile.TemporaryDirectory() as folder:
        subprocess.run([sys.executable, '-m', *command], check=True, capture_output=True,
                       cwd=folder)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def command(name: str, recording: Path) -> Work:
    """Return the work of a command with the recording."""
    given = recording / 'game.yaml' if name == 'validate' else recording
    return lambda: children_s('crgame_ros.cli', name, str(given), *COMMANDS[name])


def offline(name: str) -> Work:
    """Return the work of a kind of the offline runner."""
    from offline import seconds
    from offline import Work as OfflineWork
    # It is kept as long as the work is: it owns the folder of the cells.
    all_kinds = OfflineWork()
    return lambda: seconds(all_kinds.kinds[f'{name} [s]'][0])


def traffic(place: str, count: int) -> Work:
    """Return a step of traffic [ms]."""
    from traffic import our_motorway, our_town, Start, stepper
    step = stepper(our_town(count) if place == 'town' else our_motorway(Start(count)))

    def work() -> float:
        start = time.process_time()
        for _ in range(TRAFFIC_STEPS):
            step()
        return 1e3 * (time.process_time() - start) / TRAFFIC_STEPS

    return work


def environment() -> Work:
    """Return a step of an environment on a motorway with 20 vehicles [ms]."""
    from gym import motorway, Ours
    ours = Ours(motorway(20, 100))
    return lambda: 1e3 * ours.step_s(ENVIRONMENT_STEPS)


def planner(name: str) -> Work:
    """Return a plan in the game of dense traffic, in the median [ms]."""
    from crgame_ros.launcher.arguments import RunRequest
    from crgame_ros.launcher.run_plan import effective_game, with_planners
    from crgame_ros.paths import scenarios_directory
    from crgame_ros.simulation.offline import run_offline
    from crgame_ros.simulation.setup import build_setup
    setup = with_planners(build_setup(effective_game(RunRequest(
        game=scenarios_directory() / 'dense_merge.yaml'))), (name,))

    def work() -> float:
        result = run_offline(setup, duration_s=PLANNED_S, clock_s=time.process_time)
        return 1e3 * statistics.median(
            time_s for record in result.planners.values()
            for time_s in record.statistics.durations_s)

    return work


def live() -> Work:
    """Return a live run of 10 s, all its processes [s]."""
    return lambda: children_s('crgame_ros.launcher.main', '--headless', '--duration', '10',
                              '--out', 'run')


def kinds(recording: Path) -> dict[str, Callable[[], Work]]:
    """Return how each kind of work is made, by name."""
    return {
        **{f'crgame {name} [s]': partial(command, name, recording) for name in COMMANDS},
        **{f'offline: {name} [s]': partial(offline, name) for name in OFFLINE},
        **{f'traffic, {place}, {count} agents [ms]': partial(traffic, place, count)
           for place in ('motorway', 'town') for count in (100, 1000)},
        'a step of an environment [ms]': environment,
        **{f'a plan of {name} [ms]': partial(planner, name) for name in ('idm', 'reactive')},
        'a live run of 10 s [s]': live}


def serve(recording: Path) -> None:
    """Do the kinds of work named on standard input; tell the time of each, or what failed."""
    made: dict[str, Work] = {}
    for line in sys.stdin:
        name = line.rstrip('\n')
        try:
            if name not in made:
                made[name] = kinds(recording)[name]()
                made[name]()
            answer: dict[str, Any] = {'time': made[name]()}
        except Exception as error:  # another version may not have it
            answer = {'failed': f'{type(error).__name__}: {error}'}
        print(f'{TOLD}{json.dumps(answer)}', flush=True)


class Version:
    """
    A version of the program, in a process that does the kinds of work.

    :param folder: of the checkout.
    :param recording: of a run.
    """

    def __init__(self, folder: Path, recording: Path) -> None:
        self._process = subprocess.Popen(
            [sys.executable, str(Path(__file__).resolve()), '--serve', str(recording)],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True,
            cwd=folder, env=environment_of(folder))

    def time(self, name: str) -> float | str:
        """Return the time of a kind of work, or what failed."""
        assert self._process.stdin is not None and self._process.stdout is not None
        print(name, file=self._process.stdin, flush=True)
        for line in self._process.stdout:
            if line.startswith(TOLD):
                answer = json.loads(line.removeprefix(TOLD))
                return answer['time'] if 'time' in answer else str(answer['failed'])
        return 'its process has ended'

    def close(self) -> None:
        """End the process."""
        self._process.communicate()


def environment_of(folder: Path) -> dict[str, str]:
    """Return the environment in which Python loads the program of a checkout."""
    return os.environ | {'PYTHONPATH': str(folder)}


@contextmanager
def checkout(name: str) -> Iterator[Path]:
    """Yield the folder of another version: a folder, or a revision, which is unpacked."""
    if Path(name).is_dir():
        yield Path(name).resolve()
        return
    done = subprocess.run(['git', 'archive', name], cwd=ROOT, capture_output=True)
    if done.returncode:
        sys.exit(f'{name} is no folder and no revision: {done.stderr.decode().strip()}')
    with tempfile.TemporaryDirectory() as folder:
        tarfile.open(fileobj=io.BytesIO(done.stdout)).extractall(folder, filter='data')
        yield Path(folder)


def compiled(folder: Path) -> None:
    """Compile the traffic of a version, so that no time includes it."""
    subprocess.run([sys.executable, '-m', 'crgame_ros.traffic.warm_up'], check=True, cwd=folder,
                   env=environment_of(folder), capture_output=True)


def verdict(ratios: list[float], limit: float) -> str:
    """Say whether the times of this version to those of the other one differ by a limit."""
    ordered = sorted(ratios)
    if ordered[1] > 1.0 + limit:
        return 'SLOWER'
    return 'faster' if ordered[-2] < 1.0 / (1.0 + limit) else ''


def compare(names: list[str], other: Path, recording: Path, rounds: int, limit: float) -> int:
    """Print the times of both versions; return how many kinds of work are slower or fail."""
    for folder in (other, ROOT):
        print(f'compiling traffic of {folder} …', file=sys.stderr, flush=True)
        compiled(folder)
    versions, worse = [Version(other, recording), Version(ROOT, recording)], 0
    print(f'{"median of processor time":46}{"other":>9}{"this":>9}{"ratio":>7}  (all)')
    for name in names:
        times: list[list[float]] = [[], []]
        failed = ['', '']
        # Who begins changes with each round.
        for turn in range(rounds):
            for i in ((0, 1), (1, 0))[turn % 2]:
                found = versions[i].time(name)
                if isinstance(found, str):
                    failed[i] = found
                else:
                    times[i].append(found)
            if any(failed):
                break
        if any(failed):
            print(f'{name:46}  other: {failed[0] or "works"}; this: {failed[1] or "works"}')
            worse += bool(failed[1]) and not failed[0]
            continue
        ratios = [now / before for before, now in zip(*times, strict=True)]
        said = verdict(ratios, limit)
        worse += said == 'SLOWER'
        print(f'{name:46}{statistics.median(times[0]):9.3f}{statistics.median(times[1]):9.3f}'
              f'{statistics.median(ratios):7.2f}  ({min(ratios):.2f} … {max(ratios):.2f}) {said}',
              flush=True)
    for version in versions:
        version.close()
    return worse


def main() -> int:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('other', nargs='?', help='revision, or folder of a checkout')
    parser.add_argument('--rounds', type=int, default=7, help='at least 3 (default: 7)')
    parser.add_argument('--only', default='', metavar='WORD', help='kinds of work with this word')
    parser.add_argument('--limit', type=float, default=0.1, help='(default: 0.1, which is 10 %%)')
    parser.add_argument('--list', action='store_true', help='print the kinds of work')
    parser.add_argument('--serve', type=Path, help=argparse.SUPPRESS)
    values = parser.parse_args()
    if values.serve is not None:
        serve(values.serve)
        return 0
    names = [name for name in kinds(Path()) if values.only in name]
    if values.list:
        print('\n'.join(names))
        return 0
    if values.other is None or values.rounds < 3 or not names:
        parser.error('name another version, at least 3 rounds, and a kind of work (see --list)')
    with tempfile.TemporaryDirectory() as folder, checkout(values.other) as other:
        recording = Path(folder) / 'run'
        subprocess.run([sys.executable, '-m', 'crgame_ros.cli', 'offline', '--record',
                        str(recording)], check=True, capture_output=True, cwd=ROOT,
                       env=environment_of(ROOT))
        return min(1, compare(names, other, recording, values.rounds, values.limit))


if __name__ == '__main__':
    sys.exit(main())
