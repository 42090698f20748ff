# Copyright 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Half-made ports in shared memory: removed when nobody finishes them, left alone otherwise."""

import os
from pathlib import Path
import threading
import time

from crgame_ros.ros.shared_memory import PATIENCE_S, remove_half_made_ports

MADE, UNMADE = (2).to_bytes(4, 'little') + bytes(60), bytes(64)


def _age(path: Path, seconds: float) -> None:
    then = time.time() - seconds
    os.utime(path, (then, then))


def test_old_half_made_ports_go_and_all_else_stays(tmp_path: Path) -> None:
    """Only ports, only those that are not initialised, only after the patience."""
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
