# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A run beside other instruments: real streams of LSL out and in, a real terminal for triggers."""

from collections.abc import Iterator
from contextlib import ExitStack
import os
from pathlib import Path
import select
import shutil
import subprocess
import sys
import time
from typing import Any, NamedTuple

from crgame_ros.analysis.runs.run import Run
from crgame_ros.analysis.tables.run_tables import write_tables
from crgame_ros.game.documents import GAME
from crgame_ros.instruments.outlets import CONFIGURATION
from crgame_ros.recording.reader import BagReader
from crgame_ros.recording.run_cycles import read_cycles
from live_support import Launcher, PATIENCE_S, wait_until
import numpy as np
import pandas as pd
import pytest
from steady_game import GAME as STEADY
from steady_game import TIMELINE

pylsl = pytest.importorskip('pylsl', reason='the extra `instruments` is not installed')
pytest.importorskip('serial', reason='the extra `instruments` is not installed')

HERE = Path(__file__).parent
EVENTS = """
events:
  - {name: slow, when: {time: 3.0}, speed_limit: {speed: 20.0}}
  - {name: fast, when: {time: 4.0}, speed_limit: {speed: 30.0}}
"""
# Pulses come ten times a second; of each life of a sender so many are awaited.
PULSES = 40
# What the requirement allows [s].
ALLOWED_S = 0.002


class Sender:
    """A program that sends pulses."""

    def __init__(self, name: str, folder: Path, domain: int, **environment: str) -> None:
        self.file = folder / f'{name}.txt'
        self.file.touch()
        self._words = [sys.executable, str(HERE / 'pulse_sender.py'), name, str(self.file)]
        self._environment = os.environ | {'ROS_DOMAIN_ID': str(domain)} | environment
        self.start()

    def start(self) -> None:
        """Start it, perhaps again."""
        self._process = subprocess.Popen(self._words, env=self._environment)

    def kill(self) -> None:
        """Kill it where it is."""
        self._process.kill()
        self._process.wait()

    @property
    def sent(self) -> dict[int, float]:
        """Return the pulses that somebody was there to receive: steady clock [s] by stamp [ns]."""
        lines = self.file.read_text().rpartition('\n')[0].split('\n')
        return {int(stamp): float(at_s) for stamp, at_s in map(str.split, filter(None, lines))}

    def wait_for(self, count: int) -> None:
        """Wait until it has sent so many."""
        wait_until(lambda: len(self.sent) >= count, f'{count} pulses')


class Recorded(NamedTuple):
    """What a run has left."""

    bag: Path
    samples: pd.DataFrame
    channels: pd.DataFrame
    sent: dict[str, dict[int, float]]
    before_kill: int
    bytes_seen: bytes
    heard: dict[str, tuple[list[Any], list[float], Any]]
    lines: str


def _drifting_clock(folder: Path) -> dict[str, str]:
    """Return the environment of a process whose steady clock runs 50 ppm too fast."""
    compiler = shutil.which('cc')
    if compiler is None:
        pytest.skip('a drifting clock needs a C compiler')
    library = folder / 'drifting_clock.so'
    subprocess.run([compiler, '-shared', '-fPIC', '-O1', '-o', str(library),
                    str(HERE / 'drifting_clock.c')], check=True)
    return {'LD_PRELOAD': str(library)}


@pytest.fixture(scope='module')
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Recorded]:
    """Run a game beside two senders, of which one is killed and one has a clock of its own."""
    folder = tmp_path_factory.mktemp('instruments')
    master, slave = os.openpty()
    (folder / 'steady.joy.yaml').write_text(TIMELINE)
    (folder / 'game.yaml').write_text(f"""{STEADY}{EVENTS}
instruments:
  outlets: true
  inlets: [{{name: steady}}, {{name: drifting, type: Pulses}}]
  triggers: {{port: {os.ttyname(slave)}, codes: {{trial/begin: 1, event: 7, event/fast: 8}}}}
""")
    pylsl.set_config_content(CONFIGURATION)
    with ExitStack() as stack:
        launcher = stack.enter_context(Launcher([folder / 'game.yaml'], folder / 'run'))
        steady = Sender('steady', folder, launcher.domain)
        stack.callback(lambda: steady.kill())
        drifting = Sender('drifting', folder, launcher.domain, **_drifting_clock(folder))
        stack.callback(lambda: drifting.kill())
        heard = {name: _listen(name, launcher.domain) for name in (
            'crgame_ros markers', 'crgame_ros vehicle hv0', 'crgame_ros driver hv0')}
        steady.wait_for(PULSES)
        steady.kill()
        before = len(steady.sent)
        launcher.wait_for('stream steady .* is gone')
        steady.start()
        steady.wait_for(before + PULSES)
        drifting.wait_for(2 * PULSES)
        launcher.wait_for('event fast')
        time.sleep(0.5)
        pulled = {name: (*inlet.pull_chunk(0.0, 100_000), inlet.info(5.0))
                  for name, inlet in heard.items()}
        heard.clear()
        launcher.signal(2)
        assert launcher.wait() == 0
        seen = os.read(master, 100) if select.select([master], [], [], PATIENCE_S)[0] else b''
    os.close(master)
    os.close(slave)
    run = Run.of_recording(folder / 'run')
    assert run.bag is not None
    write_tables([run], folder / 'tables', 'csv')
    yield Recorded(run.bag, *(pd.read_csv(folder / 'tables' / f'instrument_{name}.csv')
                              for name in ('samples', 'channels')),
                   {'steady': steady.sent, 'drifting': drifting.sent}, before, seen,
                   pulled, launcher.text)


def _listen(name: str, domain: int) -> Any:
    """Open an inlet of a stream of the run."""
    found = pylsl.resolve_bypred(f"name='{name}' and contains(source_id, '/{domain}/')",
                                 1, PATIENCE_S)
    assert found, name
    inlet = pylsl.StreamInlet(found[0], max_buflen=360)
    inlet.open_stream(PATIENCE_S)
    return inlet


@pytest.mark.parametrize('stream', ['steady', 'drifting'])
def test_pulses_are_where_they_were_sent(recorded: Recorded, stream: str) -> None:
    """
    Each pulse has its time on the steady clock, and that of its stamp on the run's, within 2 ms.

    What a busy machine adds comes on top, as it is recorded: the uncertainty that LSL tells of its
    measurement; and the simulation publishes a stamp while it is busy with this cycle, which is a
    larger part of the step where it hurries after a late one.
    """
    with BagReader(recorded.bag, parts=True) as reader:
        latched = reader.latched(GAME.topic)
    assert latched is not None
    game = GAME.read(latched.message.data)
    pulses = recorded.samples[recorded.samples.stream == stream]
    assert len(pulses) >= 2 * PULSES - 2
    stamps_ns = np.round(pulses.value.to_numpy() * 1e9).astype(np.int64)
    sent_s = np.array([recorded.sent[stream][stamp] for stamp in stamps_ns.tolist()])
    of_clock_s = np.abs(pulses.steady_s.to_numpy() - sent_s)
    in_run_s = pulses.time_s.to_numpy() - 1e-9 * (stamps_ns - game.clock_offset_ns)
    uncertain_s = pulses.uncertainty_s.fillna(0.0).to_numpy()
    print(f'{stream}: {len(pulses)} pulses, ' + ', '.join(
        f'{what} median {1e3 * np.median(error):.3f} ms, worst {1e3 * error.max():.3f} ms'
        for what, error in (('steady clock', of_clock_s), ("run's clock", np.abs(in_run_s))))
        + f', drift {recorded.channels.set_index("stream").clock_drift[stream]:.2e}')
    assert (of_clock_s - uncertain_s).max() < ALLOWED_S
    cycles = read_cycles(recorded.bag)
    ns, actual_s = cycles.column('n'), cycles.column('actual_s')
    part = cycles.column('busy_s') / np.append(np.diff(actual_s), game.scheduler.dt_s)
    after_start_s = np.maximum(cycles.column('busy_s'), part * game.scheduler.dt_s)
    places = np.searchsorted(ns, (stamps_ns - game.clock_offset_ns) // game.dt_ns)
    assert (np.abs(in_run_s) - uncertain_s - after_start_s[places]).max() < ALLOWED_S
    if stream == 'drifting':
        # Uncorrected, it would be off by this much.
        assert np.median(pulses.sent_s - pulses.steady_s) > 0.04


def test_nothing_is_lost_but_what_the_killed_program_held(recorded: Recorded) -> None:
    """Before the kill, at most the last pulse is missing; the gap is counted; nothing is twice."""
    got = np.round(recorded.samples[recorded.samples.stream == 'steady'].value * 1e9).astype(int)
    sent, before = list(recorded.sent['steady']), recorded.before_kill
    assert len(set(got)) == len(got)
    assert set(sent[:before - 1]) <= set(got)
    assert len(set(got) & set(sent[before:])) >= PULSES - 2
    channels = recorded.channels.set_index('stream')
    assert channels.gaps['steady'] == 1
    assert channels.gaps['drifting'] == 0
    assert list(channels.loc['steady', ['channel', 'unit', 'source_id']]) \
        == ['stamp', 's', 'device steady']
    assert 'stream steady (Pulses) is back' in recorded.lines


def test_triggers_reach_the_terminal_in_order(recorded: Recorded) -> None:
    """Run's start, first event, second event with a code of its own; their times are recorded."""
    assert recorded.bytes_seen == bytes((1, 7, 8))
    sent = recorded.samples[recorded.samples.stream == 'triggers'].pivot(
        index='number', columns='channel', values='text')
    assert list(sent.marker) == ['trial/begin/0', 'event/slow/condition', 'event/fast/condition']
    assert list(sent.code) == ['1', '7', '8']


def test_another_program_hears_the_run(recorded: Recorded) -> None:
    """Markers and 100 Hz states have the time of their cycle, names and units."""
    texts, times, _ = recorded.heard['crgame_ros markers']
    markers = {row[0]: at_s for row, at_s in zip(texts, times, strict=True)}
    cycles = read_cycles(recorded.bag)
    starts = dict(cycles.steady_rows().tolist())
    for name, at_s in (('slow', 3.0), ('fast', 4.0)):
        assert markers[f'event/{name}/condition'] == pytest.approx(starts[at_s / 0.01], abs=1e-6)
    rows, times, info = recorded.heard['crgame_ros vehicle hv0']
    assert info.get_channel_labels()[:4] == ['x', 'y', 'yaw', 'speed']
    assert info.get_channel_units()[:4] == ['m', 'm', 'rad', 'm/s']
    assert info.nominal_srate() == 100.0
    known = np.sort(list(starts.values()))
    nearest = known[np.clip(np.searchsorted(known, times), 0, len(known) - 1)]
    assert len(rows) > 100
    assert np.abs(nearest - times).max() < 1e-6
    rows, _, info = recorded.heard['crgame_ros driver hv0']
    assert info.get_channel_labels()[:2] == ['throttle', 'brake']
    assert rows[-1][0] == 0.375
