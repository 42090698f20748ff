# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Half-made ports in shared memory: removed if no process finishes them, kept otherwise."""

from contextlib import suppress
import fcntl
import mmap
import os
from pathlib import Path
import subprocess
import sys
import threading
import time

from crgame_ros.ros.shared_memory import (
    PATIENCE_S,
    remove_half_made_ports,
    remove_stale,
    SHARED_MEMORY,
    YOUNG_S,
)
from ros_domains import own_domain_id

MADE, UNMADE = (2).to_bytes(4, 'little') + bytes(60), bytes(64)


def _age(path: Path, seconds: float) -> None:
    then = time.time() - seconds
    os.utime(path, (then, then))


def test_old_half_made_ports_go_and_all_else_stays(tmp_path: Path) -> None:
    """Only ports that are not initialised go, and only after a waiting time."""
    for name, content in (('fastrtps_port7001', MADE), ('fastrtps_port7002', UNMADE),
                          ('fastrtps_port7003', b''), ('fastrtps_port7002_el', b''),
                          ('sem.fastrtps_port7002_mutex', UNMADE), ('fastrtps_0123', UNMADE),
                          ('somebody_elses', UNMADE)):
        (tmp_path / name).write_bytes(content)
        _age(tmp_path / name, PATIENCE_S + 1.0)
    assert sorted(remove_half_made_ports(tmp_path)) == ['fastrtps_port7002', 'fastrtps_port7003']
    assert {path.name for path in tmp_path.iterdir()} == {
        'fastrtps_port7001', 'fastrtps_port7002_el', 'sem.fastrtps_port7002_mutex',
        'fastrtps_0123', 'somebody_elses'}
    assert remove_half_made_ports(tmp_path / 'nothing') == []


def test_a_port_in_the_making_is_waited_for(tmp_path: Path) -> None:
    """Its maker finishes it: it stays."""
    port = tmp_path / 'fastrtps_port7001'
    port.write_bytes(UNMADE)
    maker = threading.Timer(0.3, port.write_bytes, (MADE,))
    maker.start()
    start_s = time.monotonic()
    assert remove_half_made_ports(tmp_path) == []
    assert time.monotonic() - start_s > 0.2
    maker.join()
    assert port.exists()


def _left(folder: Path, *names: str) -> None:
    for name in names:
        (folder / name).write_bytes(MADE)
        _age(folder / name, 2.0 * YOUNG_S)


def test_what_dead_processes_left_goes_and_what_is_used_stays(tmp_path: Path) -> None:
    """Only unlocked and unmapped files go; young, locked, mapped and foreign ones stay."""
    gone, locked, mapped, young = (f'fastrtps_{digit * 16}' for digit in '0123')
    _left(tmp_path, gone, f'{gone}_el', locked, f'{locked}_el', mapped, f'{mapped}_el',
          'fastrtps_port7001', 'fastrtps_port7001_el', 'sem.fastrtps_port7001_mutex',
          'fastrtps_port7002', 'somebody_elses', 'fastrtps_xyz')
    (tmp_path / young).write_bytes(MADE)
    (tmp_path / f'{young}_el').write_bytes(b'')
    with (tmp_path / f'{locked}_el').open() as holder, (tmp_path / mapped).open('rb') as file, \
            mmap.mmap(file.fileno(), 0, prot=mmap.PROT_READ):
        fcntl.flock(holder, fcntl.LOCK_EX)
        count, size = remove_stale(tmp_path)
        left = {path.name for path in tmp_path.iterdir()}
    assert count == 1 and size > 0
    assert left == {locked, f'{locked}_el', mapped, f'{mapped}_el', young, f'{young}_el',
                    'fastrtps_port7001', 'fastrtps_port7001_el', 'sem.fastrtps_port7001_mutex',
                    'fastrtps_port7002', 'somebody_elses', 'fastrtps_xyz'}


def test_ports_of_the_dead_go_when_asked_for(tmp_path: Path) -> None:
    """Their locks and mutexes go, too; a port that is mapped or locked stays."""
    gone, locked, mapped = (f'fastrtps_port{number}' for number in (7410, 7411, 7412))
    _left(tmp_path, gone, f'{gone}_el', f'sem.{gone}_mutex', locked, f'{locked}_sl',
          f'sem.{locked}_mutex', mapped, f'sem.{mapped}_mutex', 'sem.strange')
    with (tmp_path / f'{locked}_sl').open() as holder, (tmp_path / mapped).open('rb') as file, \
            mmap.mmap(file.fileno(), 0, prot=mmap.PROT_READ):
        fcntl.flock(holder, fcntl.LOCK_SH)
        assert remove_stale(tmp_path) == (0, 0)
        count, size = remove_stale(tmp_path, ports=True)
    assert count == 1 and size > 0
    assert {path.name for path in tmp_path.iterdir()} == {
        locked, f'{locked}_sl', f'sem.{locked}_mutex', mapped, f'sem.{mapped}_mutex',
        'sem.strange'}


def test_a_living_participant_keeps_its_memory_and_a_killed_one_does_not() -> None:
    """With real Fast DDS a participant's files survive all cleaning while it lives, then go."""
    code = ('import rclpy, time; rclpy.init(); node = rclpy.create_node("held"); '
            'print("up", flush=True); time.sleep(100)')
    process = subprocess.Popen(
        [sys.executable, '-c', code], stdout=subprocess.PIPE, text=True,
        env=os.environ | {'ROS_DOMAIN_ID': str(own_domain_id())})
    try:
        assert process.stdout is not None and process.stdout.readline() == 'up\n'
        own = {line.rpartition('/')[2].split()[0] for line in Path(
            f'/proc/{process.pid}/maps').read_text().splitlines() if '/dev/shm/fastrtps_' in line}
        assert own
        for name in own:
            _age(SHARED_MEMORY / name, 2.0 * YOUNG_S)
        remove_stale()
        assert all((SHARED_MEMORY / name).exists() for name in own)
    finally:
        process.kill()
        process.wait()
        process.stdout.close()
    for name in own:
        # The last write made it young again: the time of a mapped file is that of the first
        # touch of each of its pages. Another process may have cleaned already.
        with suppress(FileNotFoundError):
            _age(SHARED_MEMORY / name, 2.0 * YOUNG_S)
    remove_stale()
    assert not any((SHARED_MEMORY / name).exists() for name in own if 'port' not in name)
