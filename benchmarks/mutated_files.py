# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Broken files of every kind: each is refused in one line or gives a run, in 10 s and 1 GiB."""

import argparse
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
import faulthandler
import gc
import os
from pathlib import Path
import pickle
import random
import resource
import select
import shutil
import signal
import sys
import tempfile
import time
import traceback

from crgame_ros.errors import InputError, LONGEST

# The script may be loaded from elsewhere, by a test.
sys.path.insert(0, str(Path(__file__).resolve().parent))

import file_trials  # noqa: E402

CPU_S, WALL_S, MEMORY = 10, 90, 2 ** 30
LOADED, REFUSED, BAD_REFUSAL = 'loaded', 'refused', 'bad refusal'
TRACEBACK, WRONG, SLOW, LARGE = 'traceback', 'wrong result', 'too slow', 'too large'
OUTCOMES = (LOADED, REFUSED, BAD_REFUSAL, TRACEBACK, WRONG, SLOW, LARGE)
DESCRIPTION = """\
Break files of every kind in one or two places, and read each as a user would: scenarios, games,
vehicles, steering ratios, timelines, device maps, gains, occupancy maps, trajectories, way-points,
recordings, evaluations and studies. Scenarios and games are driven for half a second and exported,
recordings are looked into, converted and recovered, evaluations summed up, and the tables of
studies made. Every case is a process of its own with 10 s of computing
and 1 GiB more memory than this process. The same seed gives the same cases.

  mutated_files.py --count 200                        a look
  mutated_files.py --count 2000 --seed 5 FILE.xml …   with published scenarios as well
  mutated_files.py --seed 5 --only 1234               one case again, with its message

A case is good if it is loaded (and what it gives is finite, valid by CommonRoad's schema, equal to
what was recorded) or refused by exit code 2 in one line of at most 500 characters that names the
file. All else is printed, counted in the table and makes the exit code 1."""


@dataclass(frozen=True)
class Outcome:
    """
    The result of a case.

    :param kind: one of `OUTCOMES`.
    :param detail: the message or traceback.
    """

    kind: str
    detail: str = ''
    cpu_s: float = 0.0
    memory: int = 0

    @property
    def is_good(self) -> bool:
        """Return whether a user would be served."""
        return self.kind in (LOADED, REFUSED)


@dataclass(frozen=True)
class Case:
    """A broken file; the same seed and number give the same one."""

    number: int
    kind: str
    name: str
    mutation: str
    outcome: Outcome


class Harness:
    """
    Makes and tries cases.

    :param folder: an empty folder, filled with the sound files.
    :param seed: of all cases.
    :param published: scenarios besides our own.
    """

    def __init__(self, folder: Path, seed: int, published: Sequence[Path] = ()) -> None:
        self._folder, self._seed = folder / 'sound', seed
        self._folder.mkdir()
        file_trials.prepare(self._folder)
        self._trials = file_trials.trials(self._folder, published)
        # Everything is imported and compiled before the first case. No case's collection of
        # garbage goes through it again, and its pages stay shared.
        file_trials.warm_up(self._folder)
        gc.collect()
        gc.freeze()

    @property
    def kinds(self) -> tuple[str, ...]:
        """Return the kinds of file."""
        return tuple(self._trials)

    def case(self, number: int, sound: str | None = None) -> Case:
        """
        Break one file and read it.

        :param sound: a kind of file; it is read as it is.
        """
        dice = random.Random(f'{self._seed} {number}')
        shares = [self._trials[name].share for name in self.kinds]
        kind = sound or dice.choices(self.kinds, shares)[0]
        trial = self._trials[kind]
        file = dice.choice(trial.files)
        data, mutation = file.read_bytes(), 'none'
        if sound is None:
            data, mutation = trial.breaks(data, dice)
        root = self._folder.with_name('case')
        shutil.rmtree(root, ignore_errors=True)
        broken = self._place(file, root)
        broken.unlink(missing_ok=True)
        broken.write_bytes(data)
        outcome = _fork(lambda: trial.reads(broken, dice), broken)
        return Case(number, kind, file.name, mutation, outcome)

    def _place(self, file: Path, root: Path) -> Path:
        """Make the folder of a case: links to the sound files."""
        root.mkdir()
        for other in self._folder.iterdir():
            if other.is_file():
                os.link(other, root / other.name)
        place = file.relative_to(self._folder) if file.is_relative_to(self._folder) \
            else Path(file.name)
        for name in {'map', *place.parts[:-1][:1]}:
            shutil.copytree(self._folder / name, root / name, copy_function=os.link)
        return root / place


def _fork(work: object, broken: Path) -> Outcome:
    """Do something in a process of its own, within bounds."""
    assert callable(work)
    reading, writing = os.pipe()
    dump = broken.parent / 'trace.txt'
    child = os.fork()
    if not child:
        os.close(reading)
        outcome = Outcome(TRACEBACK)
        try:
            _bound(dump)
            outcome = _outcome(work, broken)
        finally:
            with os.fdopen(writing, 'wb') as stream:
                stream.write(pickle.dumps(outcome))
            os._exit(0)
    os.close(writing)
    data, until = b'', time.monotonic() + WALL_S
    while select.select([reading], [], [], max(0.0, until - time.monotonic()))[0]:
        part = os.read(reading, 1 << 16)
        if not part:
            break
        data += part
    else:
        os.kill(child, signal.SIGKILL)
    os.close(reading)
    _, status, usage = os.wait4(child, 0)
    if data:
        outcome = pickle.loads(data)
        return Outcome(outcome.kind, outcome.detail, usage.ru_utime + usage.ru_stime,
                       outcome.memory)
    signal_number = os.WTERMSIG(status) if os.WIFSIGNALED(status) else 0
    trace = dump.read_text(errors='replace')[-3000:] if dump.exists() else ''
    kind = SLOW if signal_number in (signal.SIGXCPU, signal.SIGKILL) else TRACEBACK
    return Outcome(kind, f'signal {signal_number}\n{trace}', usage.ru_utime + usage.ru_stime)


def _bound(dump: Path) -> None:
    pages = int(Path('/proc/self/statm').read_text().split()[0])
    limit = pages * resource.getpagesize() + MEMORY
    resource.setrlimit(resource.RLIMIT_AS, (limit, limit))
    resource.setrlimit(resource.RLIMIT_CPU, (CPU_S, CPU_S + 5))
    # Kept open: the handler writes to it.
    stream = dump.open('w')
    faulthandler.register(signal.SIGXCPU, file=stream, chain=True)
    globals()['_dump'] = stream


def _outcome(work: object, broken: Path) -> Outcome:
    assert callable(work)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    outcome = Outcome(LOADED)
    try:
        work()
    except InputError as error:
        text = str(error)
        good = '\n' not in text and len(text) <= LONGEST + 20 and (
            any(name in text for name in (broken.name, broken.parent.name, 'made.xml'))
            or text.startswith('--'))
        outcome = Outcome(REFUSED if good else BAD_REFUSAL, text)
    except MemoryError:
        outcome = Outcome(LARGE, traceback.format_exc(limit=-4))
    except file_trials.WrongResult as error:
        outcome = Outcome(WRONG, str(error)[:600])
    except BaseException:  # whatever escapes is the finding
        outcome = Outcome(TRACEBACK, traceback.format_exc(limit=-6)[-3000:])
    grown = 1024 * (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before)
    if grown > MEMORY:
        return Outcome(LARGE, outcome.detail, 0.0, grown)
    return Outcome(outcome.kind, outcome.detail, 0.0, grown)


def table(counts: dict[str, Counter[str]]) -> str:
    """Write the counts by kind of file, as Markdown."""
    lines = [f'| kind of file | mutations | {" | ".join(OUTCOMES)} |',
             '|' + '---|' * (len(OUTCOMES) + 2)]
    total: Counter[str] = Counter()
    for kind in sorted(counts):
        total += counts[kind]
    for kind, row in [*sorted(counts.items()), ('all', total)]:
        numbers = ' | '.join(str(row[name]) for name in OUTCOMES)
        lines.append(f'| {kind} | {row.total()} | {numbers} |')
    return '\n'.join(lines)


def main() -> int:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(description=DESCRIPTION,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('scenarios', nargs='*', type=Path, help='CommonRoad files besides our own')
    parser.add_argument('--count', type=int, default=200, help='cases (default: 200)')
    parser.add_argument('--seed', type=int, default=0)
    parser.add_argument('--first', type=int, default=0, help='number of the first case')
    parser.add_argument('--only', type=int, action='append',
                        help='this case alone; may be repeated')
    parser.add_argument('--minutes', type=float, default=float('inf'),
                        help='begin no case after so long (default: no limit)')
    values = parser.parse_args()
    until = time.monotonic() + 60.0 * values.minutes
    counts: dict[str, Counter[str]] = {}
    slowest, largest = 0.0, 0
    with tempfile.TemporaryDirectory() as folder:
        harness = Harness(Path(folder), values.seed, values.scenarios)
        for number in values.only or range(values.first, values.first + values.count):
            if time.monotonic() > until:
                break
            case = harness.case(number)
            counts.setdefault(case.kind, Counter())[case.outcome.kind] += 1
            slowest = max(slowest, case.outcome.cpu_s)
            largest = max(largest, case.outcome.memory)
            if values.only or not case.outcome.is_good:
                print(f'{case.number} {case.outcome.kind}: {case.kind}: {case.name}: '
                      f'{case.mutation[:300]} ({case.outcome.cpu_s:.1f} s)\n'
                      f'    {case.outcome.detail}', flush=True)
    print(table(counts))
    print(f'The slowest took {slowest:.1f} s of computing, the largest '
          f'{largest / 2 ** 20:.0f} MiB.')
    return 0 if all(set(row) <= {LOADED, REFUSED} for row in counts.values()) else 1


if __name__ == '__main__':
    sys.exit(main())
