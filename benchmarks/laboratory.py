# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
A whole study as a laboratory has it, with made people, and a check of what is left of it.

    python benchmarks/laboratory.py --seed 1 --bids-validator ~/bids/bin/bids-validator-deno

The plan is written as a preregistration. Four participants in two groups drive in real browsers,
with markers for other instruments and a made gaze stream (LSL). One of them takes part elsewhere,
over TLS. Five processes are killed. One participant withdraws. Tables, report, R script and BIDS
are written, and everything has to be in them, but nothing of who withdrew.
"""

import argparse
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
import json
import math
from pathlib import Path
import random
import subprocess
import sys
import tempfile
import threading

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / 'test' / 'browser'))
sys.path.insert(0, str(Path(__file__).resolve().parent))

from crgame_ros.cockpit.access import reachable_addresses  # noqa: E402, I100
from crgame_ros.instruments.outlets import CONFIGURATION  # noqa: E402
from crgame_ros.yaml_text import read_yaml  # noqa: E402
import pyarrow.parquet as pq  # noqa: E402
from study_people import study_session, StudySession  # noqa: E402
from study_sessions import conduct, table, tell  # noqa: E402
import yaml  # noqa: E402

TRIAL_S = 6.0
GAZE_HZ = 50.0
# An id so long that no file has it by chance.
ELSEWHERE, WITHDRAWS = 'P03', 'Leaves-2000-01-01'
PEOPLE = ('P01', WITHDRAWS, ELSEWHERE, 'P04')
# A browser that is killed forgets its link, and who is elsewhere cannot be given another.
KILLS = {'P01': ['page', 'simulation'], WITHDRAWS: ['launcher'], ELSEWHERE: ['study'],
         'P04': ['study']}


def crgame(*words: object) -> str:
    """Run a command of the program; return what it has printed."""
    done = subprocess.run([sys.executable, '-m', 'crgame_ros.cli', *map(str, words)],
                          stdout=subprocess.PIPE, text=True, check=False)
    if done.returncode:
        raise SystemExit(f'crgame {" ".join(map(str, words))}: exit code {done.returncode}\n'
                         f'{done.stdout[-2000:]}')
    return done.stdout


def write_study(folder: Path) -> Path:
    """Write the example in two groups, with instruments, planned tests and short drives."""
    crgame('study', 'new', folder)
    file = folder / 'study.yaml'
    study = read_yaml(file, 'study')
    study['settings'] |= {'duration': TRIAL_S, 'sound': False, 'instruments': {
        'outlets': True, 'gaze': [{'stream': 'Eyes', 'x': 'gaze_x', 'y': 'gaze_y'}]}}
    study['groups'] = {'name': 'display', 'levels': [
        {'name': 'bare'}, {'name': 'plans', 'plans': True}]}
    study['participants'] = len(PEOPLE)
    *study['factors'], scenes = study['factors']
    study['settings']['game'] = scenes['levels'][0]['game']
    study['blocks'][0] |= {'break_every': 0, 'repetitions': 1,
                           'practice': {'at_least': 1, 'at_most': 1}}
    study['analysis'] = {'comparisons': [
        {'measure': 'max_inverse_ttc_per_s', 'factor': 'planner'}]}
    file.write_text(yaml.safe_dump(study, allow_unicode=True))
    return file


@contextmanager
def made_gaze() -> Iterator[None]:
    """Send where nobody looks: a slow figure of eight over the screen."""
    import pylsl
    pylsl.set_config_content(CONFIGURATION)
    info = pylsl.StreamInfo('Eyes', 'Gaze', 2, GAZE_HZ, pylsl.cf_float32, 'made eyes')
    info.set_channel_labels(['gaze_x', 'gaze_y'])
    outlet, stop = pylsl.StreamOutlet(info), threading.Event()

    def send() -> None:
        number = 0
        while not stop.wait(1.0 / GAZE_HZ):
            phase = 0.5 * number / GAZE_HZ
            outlet.push_sample([0.5 + 0.4 * math.sin(phase), 0.5 + 0.3 * math.sin(2.0 * phase)])
            number += 1

    thread = threading.Thread(target=send)
    thread.start()
    try:
        yield
    finally:
        stop.set()
        thread.join()


def faults(out: Path, sessions: dict[str, StudySession]) -> Iterator[str]:
    """Yield what is wrong with the data of those who stay."""
    trials, answers = table(out, 'trials'), table(out, 'answers')
    stay = [name for name in PEOPLE if name != WITHDRAWS]
    numbers = Counter((row['participant'], row['trial']) for row in trials)
    if numbers != {(name, trial): 1 for name in stay for trial in '12'}:
        yield f'trials.csv has {dict(numbers)}'
    yield from (f'{row["participant"]}, trial {row["trial"]}: {row["problem"]}'
                for row in trials if row['problem'])
    for name in stay:
        told = {row['question']: row['text'] or float(row['number']) for row in answers
                if row['participant'] == name}
        given = {question: float(answer) if isinstance(answer, int | float) else answer
                 for question, answer in sessions[name].answers.items()}
        yield from (f'{name}: {question}: {told.get(question)!r} is not {answer!r}'
                    for question, answer in given.items() if told.get(question) != answer)
    groups = Counter(row['display'] for row in table(out, 'participants'))
    if sorted(groups) != ['bare', 'plans']:
        yield f'groups are {dict(groups)}'
    gaze = pq.read_table(out / 'data' / 'runs' / 'gaze.parquet').to_pylist()
    for name in stay:
        looked = Counter(row['kind'] for row in gaze if row['participant'] == name)
        print(f'{name} looked at: {dict(looked.most_common())}')
        if not looked:
            yield f'{name}: has no gaze'
    left = [path for path in out.rglob('*') if path.is_file()
            and WITHDRAWS.encode() in path.read_bytes()]
    yield from (f'{path}: names {WITHDRAWS}' for path in left)


def main() -> int:
    """Plan, conduct, kill, withdraw, write and check."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[1])
    parser.add_argument('--seed', type=int, default=1)
    parser.add_argument('--folder', type=Path)
    parser.add_argument('--bids-validator', type=Path, help='program of bids-validator-deno')
    values = parser.parse_args()
    folder = values.folder or Path(tempfile.mkdtemp(prefix='crgame_laboratory_'))
    out, file, draw = folder / 'data', write_study(folder / 'study'), random.Random(values.seed)
    address = next((host for host in reachable_addresses('0.0.0.0')
                    if not host.startswith('127.')), '127.0.0.1')
    print(crgame('study', 'preregister', file, '--out', folder / 'plan.md').strip())
    log: list[str] = []
    sessions = {}
    with made_gaze():
        for name in PEOPLE:
            kills = sorted((draw.uniform(12.0, 40.0), victim) for victim in KILLS[name])
            with study_session(file, out, name, 8300,
                               address if name == ELSEWHERE else None) as session:
                conduct(session, kills, log)
            sessions[name] = session
            print(f'{name} is done' + (f', at {address}' if name == ELSEWHERE else ''), flush=True)
    crgame('study', 'data', out, '--bids')
    crgame('study', 'withdraw', out, '--participant', WITHDRAWS, '--yes')
    print(crgame('study', 'report', out).strip())
    crgame('validate', out)
    wrong = list(faults(out, sessions))
    if values.bids_validator is not None:
        told = json.loads(subprocess.run(
            [values.bids_validator, '--json', out / 'data' / 'bids'],
            stdout=subprocess.PIPE, check=False).stdout)['issues']['issues']
        kinds = Counter((issue['severity'], issue['code']) for issue in told)
        print(f'bids-validator: {dict(kinds)}')
        wrong += [f'BIDS: {issue}' for issue in told if issue['severity'] == 'error']
    aborted = sum(entry['entry'] == 'aborted' for name, session in sessions.items()
                  if name != WITHDRAWS for entry in session.entries)
    print(f'{len(log)} kills, {aborted} drives came again; {len(table(out, "trials"))} trials, '
          f'{len(table(out, "answers"))} answers are left')
    return tell(wrong)


if __name__ == '__main__':
    sys.exit(main())
