# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Drivers, monitors, recorder and simulation are killed and frozen, and a disk fills up."""

import os
from pathlib import Path
import resource
import signal

from crgame_ros.recording.reader import BagReader
from crgame_ros.recording.run_folder import run_folder
from crgame_ros.ros.messages import from_time
from crgame_ros.timing.cycle_rows import CycleTable
from live_peer import Peer
from live_support import CUT_IN, is_node, Launcher, wait_until
import numpy as np
import pytest
from steady_game import Run, STEP_NS, THROTTLE, TOPICS, write_steady_game

# Of the watchdog: CRG's release rate of pedals [1/s], the gentle brake, the silence allowed [s].
RELEASE_RATE, GENTLE_BRAKE, SILENCE_S = 2.2, 0.15, 0.2


def _check_loss(cycles: CycleTable, last_n: int) -> None:
    """Check how a seat releases: after 0.2 s, at the release rate, then the gentle brake."""
    numbers, actual = cycles.column('n'), cycles.column('actual_s')
    throttle, brake, steering = cycles.commands('hv0')[:, :3].T
    falling = int(np.flatnonzero(throttle < THROTTLE)[0])
    heard = int(np.flatnonzero(numbers == last_n)[0])
    # The cycle may have begun a little before it was due: its time has a resolution of one step.
    assert actual[falling] - actual[heard] > SILENCE_S - STEP_NS / 1e9
    # A command may be late on a busy machine; it never holds longer than three such silences.
    assert actual[falling - 1] - actual[heard] < 3 * SILENCE_S
    assert np.all(throttle[heard:falling] == THROTTLE)
    released = falling + int(np.flatnonzero(throttle[falling:] == 0.0)[0])
    pressed = throttle[falling - 1:released]
    lengths = cycles.column('dt_eff_s')[falling:released]
    assert -np.diff(pressed) == pytest.approx(RELEASE_RATE * lengths, abs=1e-6)
    assert np.all(brake[:released] == 0.0)
    assert np.all(steering == 0.0)
    assert np.all(np.diff(brake[released:]) >= 0.0)
    assert brake[-1] == pytest.approx(GENTLE_BRAKE, abs=1e-7)


@pytest.mark.clock
def test_seat_lets_go_while_the_driver_is_frozen(run: Run) -> None:
    """After 0.2 s of silence the pedal is released, then braked gently; the driver continues."""
    launcher, peer = run
    run.wait_for_steps(5)
    launcher.freeze('driver_node_hv0')
    peer.listen_for(0.1)
    last_n = peer.games[-1].scheduler.step_of_stamp(
        from_time(peer.messages['/<v>/driver_command'][-1].header.stamp))
    peer.wait_until(lambda: peer.cycles().commands('hv0')[-1, 1] > 0.999 * GENTLE_BRAKE,
                    'the gentle brake')
    peer.wait_until(lambda: peer.statuses('sim_node: hv0 seat')
                    and peer.statuses('sim_node: hv0 seat')[-1][0].message == 'driver lost',
                    'word of the loss')
    _check_loss(peer.cycles(), last_n)
    speeds = peer.states('hv0')[:, 4]
    assert speeds[-1] < speeds.max()
    assert peer.statuses('sim_node: hv0 seat')[-1][1]['losses'] == '1'
    launcher.thaw('driver_node_hv0')
    peer.wait_until(lambda: peer.cycles().commands('hv0')[-1, 0] == THROTTLE, 'the driver again')
    peer.wait_until(lambda: peer.statuses('sim_node: hv0 seat')[-1][0].message == 'driven',
                    'word of the return')


def test_killed_driver_is_started_again_and_drives(run: Run) -> None:
    """The seat releases meanwhile; the successor continues where the timeline is by then."""
    launcher, peer = run
    starts = len(launcher.started)
    # Meanwhile the launcher starts nobody: the release is seen, however late this test looks.
    launcher.signal(signal.SIGSTOP)
    try:
        launcher.kill('driver_node_hv0')
        peer.wait_until(lambda: peer.cycles().commands('hv0')[-1, 0] < THROTTLE, 'the release')
    finally:
        launcher.signal(signal.SIGCONT)
    wait_until(lambda: len(launcher.started) > starts, 'another driver')
    peer.wait_until(lambda: peer.cycles().commands('hv0')[-1, 0] == THROTTLE, 'the driver again')
    assert peer.cycles().commands('hv0')[-1, 1] == 0.0


def test_a_run_begins_when_its_recorder_has_opened_a_bag(run: Run) -> None:
    """A reset while the recorder stands still: no message of the new run is in the old bag."""
    launcher, peer = run
    before, said = peer.games[-1], len(launcher.lines)
    launcher.freeze('recorder_node')
    assert peer.call('/sim/reset').success
    peer.wait_until(lambda: peer.games[-1] is not before, 'another run')
    game = peer.games[-1]
    first_ns = game.scheduler.clock_offset_ns
    peer.listen_for(0.5)
    assert peer.clock_ns[-1] < first_ns
    launcher.thaw('recorder_node')
    peer.wait_until(lambda: peer.n > 30, 'n = 30')
    # The launcher goes on for all tests: after a killed driver, a run may well have begun without.
    assert not [line for line in launcher.lines[said:] if 'starting without' in line]
    assert peer.call('/sim/reset').success
    launcher.wait_for(rf'recording into .*/run_{game.epoch + 2}/bag$')
    for epoch, is_own in ((before.epoch, False), (game.epoch, True)):
        with BagReader(run_folder(launcher.out, epoch) / 'bag') as reader:
            for topic in ('/hv0/driver_command', '/vehicles/state', '/av0/plan_request'):
                stamps = {from_time(item.message.header.stamp) for item in reader.decoded([topic])}
                assert (first_ns in stamps) is is_own, topic


@pytest.mark.exhaustive
def test_monitor_and_supervisor_are_started_again(run: Run) -> None:
    """Drivability and time-sync are killed: every cycle still happens, and both report again."""
    launcher, peer = run
    peer.wait_until(lambda: peer.messages['/<v>/drivability']
                    and peer.statuses('timesync_node: table I'), 'reports before')
    for name in ('drivability_node', 'timesync_node'):
        launcher.kill(name)
    for name in ('drivability_node', 'timesync_node'):
        launcher.wait_for_restart(name)
        assert launcher.says(rf'{name} died \(signal SIGKILL\); starting it again')
    verdicts, reports = peer.messages['/<v>/drivability'], 'timesync_node: table I'
    heard = (len(verdicts), len(peer.statuses(reports)))
    peer.wait_until(lambda: len(verdicts) > heard[0] and len(peer.statuses(reports)) > heard[1],
                    'reports of the successors')
    assert {item.key: item.value for item in verdicts[-1].status[0].values}['collision'] == 'false'
    numbers = peer.cycles().column('n')
    assert np.array_equal(numbers, np.arange(numbers[0], numbers[0] + len(numbers)))


def _computed_s(pid: int) -> float:
    """Return the time that a process has computed for [s]."""
    fields = Path(f'/proc/{pid}/stat').read_text().rpartition(')')[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf('SC_CLK_TCK')


@pytest.mark.exhaustive
def test_replacement_has_everything_loaded(run: Run) -> None:
    """Any node, twice in a row: its replacement works after less computing than imports take."""
    launcher, peer = run
    # So slowly that what it computes from its first message on does not count.
    assert peer.set_parameter('real_time_factor', 0.1).successful
    for name, topic in (('planner_node_av0', '/<av>/plan'), ('planner_node_av0', '/<av>/plan'),
                        ('drivability_node', '/<v>/drivability')):
        killed = launcher.node(name)
        launcher.kill(name)
        wait_until(lambda name=name, killed=killed: launcher.node(name) != killed,
                   f'another start of {name}')
        peer.forget()
        peer.wait_until(lambda topic=topic: peer.messages[topic], f'{topic} of the successor')
        successor = launcher.node(name)
        assert _computed_s(successor) < 1.0
        assert Path(f'/proc/{successor}/comm').read_text().strip() == name.partition('_av')[0][:15]


def _recorded_steps(bag: Path, offset_ns: int) -> list[int]:
    """Return the steps of /vehicles/state in a recording, in its order."""
    with BagReader(bag) as reader:
        return [(from_time(item.message.header.stamp) - offset_ns) // STEP_NS
                for item in reader.decoded(['/vehicles/state'])]


@pytest.mark.exhaustive
def test_recorder_is_killed_then_its_disk_is_full(tmp_path: Path) -> None:
    """
    Killed, it loses no more than its last moments, and continues in another folder.

    There its disk fills up: that is an error on /diagnostics, and the driving goes on. At the end
    both recordings are finished files, and the run has its scenario.
    """
    with Launcher([write_steady_game(tmp_path)], tmp_path / 'run') as launcher, \
            Peer(launcher.domain, *TOPICS) as peer:
        run = Run(launcher, peer)
        peer.wait_until(lambda: peer.n > 150, 'n = 150')
        killed_n = peer.n
        launcher.kill('recorder_node')
        offset_ns = peer.games[-1].scheduler.clock_offset_ns
        steps = _recorded_steps(tmp_path / 'run' / 'bag', offset_ns)
        # It hands over every 0.4 s what it has; 0.4 s more for a machine that is busy.
        assert steps == list(range(len(steps)))
        assert steps[-1] > killed_n - 80
        launcher.wait_for('recording into .*bag_part2')
        part = tmp_path / 'run' / 'bag_part2'
        file = part / 'bag_part2_0.mcap'
        wait_until(lambda: file.stat().st_size > 20_000, 'a part of the recording')
        limit = file.stat().st_size + 1000
        peer.wait_until(lambda: peer.statuses('recorder_node: recording'), 'word of the recorder')
        healthy = peer.statuses('recorder_node: recording')[-1]
        assert healthy[0].level == healthy[0].OK and int(healthy[1]['bytes']) > 0
        resource.prlimit(launcher.node('recorder_node'), resource.RLIMIT_FSIZE, (limit, limit))

        def failures() -> list[str]:
            return [status.message for status, _ in peer.statuses('recorder_node: recording')
                    if status.level == status.ERROR]
        peer.wait_until(failures, 'word of the disk')
        assert 'recording stopped: File too large' in failures()[0]
        run.wait_for_steps(50)
        assert peer.call('/sim/stop').success
        assert launcher.wait() == 0, launcher.text
        assert is_node(launcher.node('recorder_node')) is False
    for folder, first in ((tmp_path / 'run' / 'bag', 0), (part, killed_n)):
        with BagReader(folder) as reader:
            assert reader.complete
        steps = _recorded_steps(folder, offset_ns)
        assert steps[0] >= first
        assert steps == list(range(steps[0], steps[0] + len(steps)))
    assert (tmp_path / 'run' / 'C-ZAM_CutIn-1_1_T-1.xml').is_file()


@pytest.mark.clock
def test_killed_simulation_ends_the_run(tmp_path: Path) -> None:
    """The launcher says so and fails; everything that was published by then is recorded."""
    with Launcher([CUT_IN], tmp_path / 'run') as launcher, Peer(launcher.domain, *TOPICS) as peer:
        peer.wait_until(lambda: peer.n > 60, 'n = 60')
        launcher.kill('sim_node')
        assert launcher.wait() == 1
        peer.listen_for(0.2)
        assert launcher.says(r'^sim_node died \(signal SIGKILL\); ending the others$')
        assert not any(is_node(pid) for _, pid in launcher.started)
        heard = peer.states('hv0')[:, 0]
        offset_ns = peer.games[-1].scheduler.clock_offset_ns
    steps = _recorded_steps(tmp_path / 'run' / 'bag', offset_ns)
    assert steps == list(range(len(steps)))
    assert steps[-1] == (heard[-1] - offset_ns) // STEP_NS
    with BagReader(tmp_path / 'run' / 'bag') as reader:
        assert reader.complete
    assert (tmp_path / 'run' / 'timing.json').is_file()
    assert (tmp_path / 'run' / 'C-ZAM_CutIn-1_1_T-1.xml').is_file()
