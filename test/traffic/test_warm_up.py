# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Everything that traffic runs is compiled, and loaded, before it is needed."""

import json
import os
from pathlib import Path
import shutil
import signal
import subprocess
import sys

from crgame_ros.traffic.changing.courtesy import relief_at_change
from crgame_ros.traffic.compiling import kernel_cache
import pytest

WAITING = 'crgame_ros.traffic.crossing.waiting'
LANE_TABLE = 'crgame_ros.traffic.lanes.lane_table'
# Counts what each compiled function has been compiled or loaded for, before and after drives.
SCRIPT = """
import importlib, json, pkgutil, sys
from pathlib import Path
sys.path[:0] = sys.argv[1:2]
import crgame_ros.traffic
from crgame_ros.traffic.warm_up import drive_everything
modules = [importlib.import_module(x.name) for x in pkgutil.walk_packages(
    crgame_ros.traffic.__path__, 'crgame_ros.traffic.')]
def count():
    return {f'{x.__module__}.{x.__name__}': len(x.overloads)
            for module in modules for x in vars(module).values() if hasattr(x, 'overloads')}
drive_everything()
before = count()
from traffic_drive import drive
from crgame_ros.game.traffic_spec import TrafficSpec
for path in sys.argv[2:]:
    drive(Path(path), TrafficSpec(recorded='reactive', agents=30, flow=600.0), 25.0)
print(json.dumps([len(before), {x: n for x, n in count().items() if n != before[x]}]))
"""
COPY = """
from crgame_ros.traffic.changing import courtesy
courtesy.relief_at_change(10.0, 20.0)
stats = courtesy.relief_at_change.stats
print(courtesy.__file__, sum(stats.cache_hits.values()), sum(stats.cache_misses.values()))
"""
HOLDING = """
import fcntl, os, sys, time
lock = open(sys.argv[1], 'a')
fcntl.flock(lock, fcntl.LOCK_EX)
lock.truncate(0)
lock.write(str(os.getpid()))
lock.flush()
print('held', flush=True)
time.sleep(60.0)
"""


@pytest.mark.exhaustive
def test_a_run_compiles_and_loads_nothing_more(maps: Path,
                                               shared_scenarios: Path) -> None:
    """Lights, junctions, lane changes, swerves, recorded vehicles, parked cars, pedestrians."""
    paths = [shared_scenarios / 'USA_Lanker-1_3_T-1.xml',
             shared_scenarios / 'OSC_PedestrianCollision-1_1_T-1.xml',
             maps / 'ZAM_ParkedCars-1_1_T-1.xml', maps / 'ZAM_Merge-1_1_T-1.xml']
    benchmarks = Path(__file__).resolve().parents[2] / 'benchmarks'
    done = subprocess.run([sys.executable, '-c', SCRIPT, str(benchmarks), *map(str, paths)],
                          capture_output=True, text=True, timeout=240)
    assert done.returncode == 0, done.stderr
    functions, more = json.loads(done.stdout.splitlines()[-1])
    assert functions > 40 and more == {}


@pytest.mark.parametrize('file', ['traffic/fleet/agents.py', 'vehicle/state.py'])
def test_what_is_compiled_in_names_the_cache(file: str, tmp_path: Path,
                                             monkeypatch: pytest.MonkeyPatch) -> None:
    """`waiting` uses agents and a threshold: code compiled with others is not loaded again."""
    package = Path(kernel_cache.__file__).parents[2]
    for folder in ('traffic', 'vehicle'):
        shutil.copytree(package / folder, tmp_path / folder,
                        ignore=shutil.ignore_patterns('__pycache__'))
    monkeypatch.setattr(kernel_cache, '_PACKAGE', tmp_path)
    before = kernel_cache.digest.__wrapped__(WAITING)
    assert before == kernel_cache.digest(WAITING)
    with (tmp_path / file).open('a') as changed:
        changed.write('# Changed.\n')
    assert kernel_cache.digest.__wrapped__(WAITING) != before
    assert kernel_cache.digest.__wrapped__(LANE_TABLE) == kernel_cache.digest(LANE_TABLE)


def test_a_copy_elsewhere_loads_what_is_compiled(tmp_path: Path) -> None:
    """As colcon installs one: the place of the sources is in no name of the cache."""
    relief_at_change(10.0, 20.0)
    package = Path(kernel_cache.__file__).parents[2]
    shutil.copytree(package, tmp_path / package.name,
                    ignore=shutil.ignore_patterns('__pycache__'))
    done = subprocess.run(
        [sys.executable, '-c', COPY], capture_output=True, text=True, timeout=240, cwd=tmp_path,
        env=os.environ | {'NUMBA_CACHE_DIR': str(kernel_cache.cache_root()),
                          'PYTHONPATH': f'{tmp_path}:{os.environ.get("PYTHONPATH", "")}'})
    file, *counts = done.stdout.split()
    assert Path(file).is_relative_to(tmp_path), done.stderr
    assert counts == ['1', '0']


@pytest.mark.exhaustive
def test_who_comes_while_another_compiles_waits_for_it(tmp_path: Path) -> None:
    """It reports this, and then compiles nothing itself; one in idle time it ends at once."""
    for idle in (False, True):
        other, process = holding(tmp_path / 'compiling.lock', idle), warming_up(tmp_path)
        if not idle:
            assert 'waiting for it' in process.stderr.readline()
            assert other.poll() is None
        (tmp_path / kernel_cache.marker().name).touch()
        if not idle:
            other.terminate()
        assert other.wait(60.0) == -signal.SIGTERM
        assert process.communicate()[1] == ''
        assert process.returncode == 0


def holding(lock: Path, idle: bool) -> subprocess.Popen[str]:
    """Start a process that holds the lock as one that compiles does."""
    process = subprocess.Popen(
        [sys.executable, '-c', HOLDING, str(lock)], stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    assert process.stdout.readline() == 'held\n'
    if idle:
        os.sched_setscheduler(process.pid, os.SCHED_IDLE, os.sched_param(0))
    return process


def warming_up(cache: Path) -> subprocess.Popen[str]:
    return subprocess.Popen([sys.executable, '-m', 'crgame_ros.traffic.warm_up'],
                            env=os.environ | {'NUMBA_CACHE_DIR': str(cache)},
                            stderr=subprocess.PIPE, text=True)
