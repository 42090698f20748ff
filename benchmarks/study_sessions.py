# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
A study of 4 participants × 8 trials in real browsers, with five kills -9, and a check of its data.

    python benchmarks/study_sessions.py --seed 1

At random moments the participant's browser, the simulation, the launcher or the study itself is
killed; each participant goes on with the same command. Then the tables are written, and every
trial, answer and marker must be in them.
"""

import argparse
from bisect import bisect
from collections import Counter
import csv
import math
from pathlib import Path
import random
import statistics
import subprocess
import sys
import tempfile
import time
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / 'test' / 'browser'))

from crgame_ros.recording.reader import BagReader  # noqa: E402, I100
from crgame_ros.study.file import load_study  # noqa: E402
from crgame_ros.study.participant_session import ParticipantSession  # noqa: E402
from crgame_ros.yaml_text import read_yaml  # noqa: E402
from study_people import study_session, StudySession, VICTIMS  # noqa: E402
import yaml  # noqa: E402

TRIAL_S = 4.0
# A marker belongs to the moment at which it was set, within a scenario step [s].
MARKER_S = 0.1


def write_study(folder: Path) -> Path:
    """Write the example with short drives, and without the long end."""
    subprocess.run([sys.executable, '-m', 'crgame_ros.cli', 'study', 'new', str(folder)],
                   check=True, stdout=subprocess.DEVNULL)
    file = folder / 'study.yaml'
    study = read_yaml(file, 'study')
    study['settings']['duration'] = TRIAL_S
    study['blocks'][0] |= {'break_every': 0, 'practice': {'at_least': 1, 'at_most': 1}}
    study['languages'] = ['en']
    file.write_text(yaml.safe_dump(study, allow_unicode=True))
    return file


def conduct(session: StudySession, kills: list[tuple[float, str]], log: list[str]) -> None:
    """Go through a session, kill what is due, and set a marker in each drive."""
    began_s, marked = time.monotonic(), [0.0]

    def each(shown: str) -> None:
        now_s = time.monotonic() - began_s
        if kills and now_s > kills[0][0]:
            victim = kills[0][1]
            if session.kill(victim):
                log.append(f'{session.folder.name}: {victim} killed after {now_s:.1f} s, while '
                           f'the page showed {shown or "nothing"}')
                print(log[-1], flush=True)
                del kills[0]
        if shown == 'drive' and now_s - marked[0] > 2.0:
            marked[0] = now_s
            session.mark(f'marker {len(session.marked) + 1}')

    session.run(1200.0, each)


def check(file: Path, out: Path, sessions: list[StudySession]) -> list[str]:
    """Return the faults of the data; there should be none."""
    wrong: list[str] = []
    study = load_study(file)
    for place, session in enumerate(sessions):
        entries = session.entries
        finished = Counter(entry['item'] for entry in entries if entry['entry'] == 'finished')
        with ParticipantSession(study, session.folder, session.folder.name, place) as whole:
            items = [item.id for item in whole.items]
        wrong += [f'{session.folder.name}: {item} finished {finished[item]} times'
                  for item in items if finished[item] != 1]
        for entry in entries:
            if entry['entry'] == 'finished':
                wrong += [f'{session.folder.name}: {entry["item"]}: {name}: {value!r} is not '
                          f'{session.answers.get(name)!r}'
                          for name, value in entry['answers'].items()
                          if session.answers.get(name) != value]
        wrong += [f'{session.folder.name}: {name} was not noted on a clock'
                  for name, late_s in marker_errors(session) if math.isnan(late_s)]
        wrong += [f"{session.folder.name}: a marker is {error_s} s from the run's clock"
                  for error_s in clock_errors(session) if abs(error_s) > MARKER_S]
        told = Counter(row['name'] for row in table(out, 'events')
                       if (row['participant'], row['kind']) == (session.folder.name, 'marker'))
        wrong += [f'events.csv has {name} of {session.folder.name} {told[name]} times'
                  for name, _ in session.marked if told[name] != 1]
    rows = table(out, 'trials')
    keys = Counter((row['participant'], row['trial']) for row in rows)
    expected = {(session.folder.name, str(number)) for session in sessions
                for number in range(1, 9)}
    wrong += [f'trials.csv lacks {key}' for key in expected - keys.keys()]
    wrong += [f'trials.csv has {key} {count} times' for key, count in keys.items() if count > 1]
    wrong += [f'{row["participant"]} {row["trial"]}: lasted {row["run_end_s"]} s'
              for row in rows if abs(float(row['run_end_s']) - TRIAL_S) > 0.01]
    return wrong


def marker_errors(session: StudySession) -> list[tuple[str, float]]:
    """Return how far each marker is from the clock of the picture in which it was set [s]."""
    told = {entry['name']: entry['time_s'] for entry in session.entries
            if entry['entry'] == 'marker'}
    return [(name, math.nan if told.get(name) is None else told[name] - shown_s)
            for name, shown_s in session.marked]


def clock_errors(session: StudySession) -> list[float]:
    """Return how far each marker's time is from the run's clock at its moment, as recorded [s]."""
    entries = [entry for entry in session.entries
               if entry['entry'] == 'marker' and entry.get('time_s') is not None]
    errors = []
    for run in sorted({entry['run'] for entry in entries}):
        with BagReader(session.folder / run / 'bag', parts=True) as reader:
            states = [(message.log_time_ns, reader.decode(message).message.header.stamp)
                      for message in reader.messages(['/vehicles/state'])]
        at_s = [1e-9 * log_ns for log_ns, _ in states]
        times_s = [stamp.sec + 1e-9 * stamp.nanosec for _, stamp in states]
        errors += [entry['time_s'] + times_s[0] - times_s[max(bisect(at_s, entry['at']) - 1, 0)]
                   for entry in entries if entry['run'] == run]
    return errors


def table(out: Path, name: str) -> list[dict[str, Any]]:
    """Read a table of the study."""
    with (out / 'data' / f'{name}.csv').open(encoding='utf-8', newline='') as file:
        return list(csv.DictReader(file))


def tell(wrong: list[str]) -> int:
    """Print what is wrong; return the exit code."""
    for text in wrong:
        print(f'WRONG: {text}')
    print('nothing is wrong' if not wrong else f'{len(wrong)} findings')
    return 1 if wrong else 0


def main() -> int:
    """Run the study, kill, resume, and check the data."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[1])
    parser.add_argument('--seed', type=int, default=1)
    parser.add_argument('--participants', type=int, default=4)
    parser.add_argument('--kills', type=int, default=5)
    parser.add_argument('--folder', type=Path)
    values = parser.parse_args()
    folder = values.folder or Path(tempfile.mkdtemp(prefix='crgame_study_'))
    out, file = folder / 'data', write_study(folder / 'study')
    draw = random.Random(values.seed)
    victims = [VICTIMS[number % len(VICTIMS)] for number in range(values.kills)]
    draw.shuffle(victims)
    when = sorted((draw.randrange(values.participants), draw.uniform(8.0, 60.0), victim)
                  for victim in victims)
    log: list[str] = []
    sessions = []
    for place in range(values.participants):
        kills = [(after_s, victim) for who, after_s, victim in when if who == place]
        with study_session(file, out, f'P{place + 1:02}', 8300) as session:
            conduct(session, kills, log)
        sessions.append(session)
        print(f'P{place + 1:02} is done', flush=True)
    for command in ('data', 'report'):
        subprocess.run([sys.executable, '-m', 'crgame_ros.cli', 'study', command, str(out)],
                       check=True, stdout=subprocess.DEVNULL)
    valid = subprocess.run([sys.executable, '-m', 'crgame_ros.cli', 'validate', str(out)],
                           stdout=subprocess.PIPE, text=True, check=False)
    wrong = check(file, out, sessions) + ([] if valid.returncode == 0 else [valid.stdout[-500:]])
    starts = [entry['start_at'] - entry['asked_at'] for session in sessions
              for entry in session.entries if entry.get('start_at')]
    aborted = sum(entry['entry'] == 'aborted' for session in sessions
                  for entry in session.entries)
    marks = sum(len(session.marked) for session in sessions)
    print(f'{len(table(out, "trials"))} trials, {len(table(out, "answers"))} answers, {marks} '
          f'markers; {len(log)} kills, {aborted} drives came again')
    print(f'"ready" to the first cycle [s]: median {statistics.median(starts):.2f}, '
          f'worst {max(starts):.2f} (wanted <= 3)')
    errors = [abs(error_s) for session in sessions for error_s in clock_errors(session)]
    print(f"markers and the run's clock when they were set [s]: median "
          f'{statistics.median(errors):.3f}, worst {max(errors):.3f} (wanted <= {MARKER_S})')
    late = [abs(late_s) for session in sessions for _, late_s in marker_errors(session)]
    # That is the age of a picture.
    print(f'markers and the clock that the page showed [s]: median {statistics.median(late):.3f}, '
          f'worst {max(late):.3f}')
    return tell(wrong)


if __name__ == '__main__':
    sys.exit(main())
