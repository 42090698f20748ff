# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Compile everything that traffic runs, before it is needed: `python -m …traffic.warm_up`."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
import fcntl
from functools import cache
import os
from pathlib import Path
import signal
import sys
import time

from commonroad.common.common_lanelet import LaneletType, LineMarking
from commonroad.scenario.lanelet import Lanelet, StopLine
from commonroad.scenario.scenario import Scenario
from commonroad.scenario.traffic_light import (
    TrafficLight,
    TrafficLightCycle,
    TrafficLightCycleElement,
    TrafficLightState,
)
from crgame_ros.game.objects import ObjectDescription, Role
from crgame_ros.game.traffic_spec import TrafficSpec
from crgame_ros.geometry.shape import Shape
from crgame_ros.roads.network import RoadNetwork
from crgame_ros.traffic.compiling.kernel_cache import marker
from crgame_ros.traffic.fleet.adoption import Adopted
from crgame_ros.traffic.fleet.world_view import WorldView
from crgame_ros.traffic.traffic import Traffic
import numpy as np

TICKS = 200
LIGHT = 9001


def ensure_compiled(say: Callable[[str], None]) -> None:
    """Compile what is not compiled yet: about a minute, once for all processes."""
    with _turn(say):
        if not marker().exists():
            _compile(say)


@contextmanager
def _turn(say: Callable[[str], None]) -> Iterator[None]:
    """Wait until no other process compiles: two would each do all of it."""
    lock = marker().with_name('compiling.lock')
    try:
        lock.parent.mkdir(parents=True, exist_ok=True)
        handle = lock.open('a')
    except OSError:
        # Without a cache other processes cannot use the compiled code anyway.
        yield
        return
    with handle:
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            if not _end_idle(lock):
                say('another process compiles traffic: waiting for it')
            fcntl.flock(handle, fcntl.LOCK_EX)
        handle.truncate(0)
        handle.write(str(os.getpid()))
        handle.flush()
        yield


def _end_idle(lock: Path) -> bool:
    """
    End the process that compiles if it gets idle processor time only: it would take too long.

    What it has compiled is kept. To raise its priority takes rights that users lack.
    """
    with suppress(ValueError, OSError):
        process = int(lock.read_text())
        if os.sched_getscheduler(process) == os.SCHED_IDLE:
            os.kill(process, signal.SIGTERM)
            return True
    return False


def _compile(say: Callable[[str], None]) -> None:
    say('compiling traffic: this happens once and takes about a minute')
    start = time.monotonic()
    drive_everything()
    try:
        marker().parent.mkdir(parents=True, exist_ok=True)
        marker().touch()
    except OSError:
        say('note: compiled code cannot be kept; set NUMBA_CACHE_DIR to a folder that is '
            'writable')
    say(f'compiled traffic in {time.monotonic() - start:.0f} s')


@cache
def drive_everything() -> None:
    """
    Run traffic with all features: a light, a crossing, a wreck, a parked car, people, recordings.

    Compiled code is loaded when it first runs, which takes a second, too long for a tick. This
    runs once in a process.
    """
    scenario = crossroads()
    others = [ObjectDescription('wreck', 'parkedVehicle', Role.STATIC, Shape.rectangle(4.5, 1.8)),
              ObjectDescription('edge', 'parkedVehicle', Role.STATIC, Shape.rectangle(4.0, 1.0)),
              ObjectDescription('walker', 'pedestrian', Role.RECORDED, Shape.rectangle(0.5, 0.5)),
              ObjectDescription('driver', 'car', Role.HUMAN, Shape.rectangle(4.5, 1.8))]

    def world(k: int) -> WorldView:
        poses = np.array([[-60.0, -3.5, 0.3], [60.0, 1.7, 0.0], [20.0, -8.0 + 0.1 * k, 1.57],
                          [-190.0 + 0.6 * k, 0.0, 0.0]])
        velocities = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 1.0, 0.0],
                               [6.0, 0.0, 0.0]])
        return WorldView(k, poses, velocities, {LIGHT: 'red' if k < 60 else 'green'})

    recorded = ObjectDescription('o1', 'car', Role.RECORDED, Shape.rectangle(4.5, 1.8))
    track = np.array([[0.0, -60.0, 0.5 * np.pi], [0.0, 100.0, 0.5 * np.pi]])
    bus = ObjectDescription('o2', 'bus', Role.RECORDED, Shape.rectangle(12.0, 2.5))
    bend = np.array([[300.0, 3.4, 0.34], [340.0, 60.0, 0.5 * np.pi]])
    adopted = (Adopted(recorded, 5, track, np.array([[0.0, 9.0, 0.0]] * 2)),
               Adopted(bus, 5, bend, np.array([[5.0, 0.0, 0.0]] * 2)))
    traffic = Traffic(TrafficSpec(agents=14, flow=1800.0, capacity=40),
                      RoadNetwork(scenario.lanelet_network), scenario, others, adopted, 0.1,
                      10, 0, 0, world(0))
    for k in range(TICKS):
        traffic.advance(world(k))
    drive_where_a_lane_ends()


def drive_where_a_lane_ends() -> None:
    """Run traffic where all agents have to change lanes, and some are let in."""
    x, scenario = np.linspace(-200.0, 0.0, 41), Scenario(0.1)
    level, turn = np.zeros_like(x), np.linspace(0.0, 0.5 * np.pi, 41)
    scenario.add_objects([
        _lanelet(1, x, level, adjacent_right=2, adjacent_right_same_direction=True,
                 successor=[3]),
        _lanelet(2, x, level - 3.5, adjacent_left=1, adjacent_left_same_direction=True),
        # So tight that trial drives try it.
        _lanelet(3, 40.0 * np.sin(turn), 40.0 - 40.0 * np.cos(turn), predecessor=[1])])
    traffic = Traffic(TrafficSpec(agents=12, flow=1800.0, capacity=30),
                      RoadNetwork(scenario.lanelet_network), scenario, (), (), 0.1, 10, 0, 0)
    nowhere = np.zeros((0, 3))
    for k in range(TICKS):
        traffic.advance(WorldView(k, nowhere, nowhere))
        traffic.states  # noqa: B018 - it is compiled as well


def crossroads() -> Scenario:
    """
    Return two lanes to the east, the right one with a light, one to the north, and a bend.

    People may cross the lanes to the east.
    """
    result = Scenario(0.1)
    x = np.linspace(-200.0, 200.0, 81)
    level = np.zeros_like(x)
    right = _lanelet(1, x, level - 3.5, adjacent_left=2, adjacent_left_same_direction=True)
    right.stop_line = StopLine(np.array([-20.0, -1.75]), np.array([-20.0, -5.25]),
                               LineMarking.SOLID, set(), {LIGHT})
    right.add_traffic_light_to_lanelet(LIGHT)
    left = _lanelet(2, x, level, adjacent_right=1, adjacent_right_same_direction=True)
    turn = np.linspace(0.0, 0.5 * np.pi, 60)
    bend = _lanelet(4, 280.0 + 60.0 * np.sin(turn), 60.0 - 60.0 * np.cos(turn))
    crosswalk = _lanelet(5, np.full(8, 20.0), np.linspace(-5.25, 1.75, 8),
                         lanelet_type={LaneletType.CROSSWALK})
    result.add_objects([right, left, _lanelet(3, level, x), bend, crosswalk])
    cycle = TrafficLightCycle([TrafficLightCycleElement(TrafficLightState.GREEN, 10)], 0, True)
    result.add_objects(TrafficLight(LIGHT, np.array([-15.0, -6.0]), cycle), {1})
    return result


def _lanelet(number: int, x: np.ndarray, y: np.ndarray, **links: object) -> Lanelet:
    points = np.stack((x, y), axis=-1)
    tangent = np.gradient(points, axis=0)
    normal = 1.75 * np.stack((-tangent[:, 1], tangent[:, 0]), axis=-1) / np.hypot(
        *tangent.T)[:, None]
    return Lanelet(points + normal, points, points - normal, number, **links)


if __name__ == '__main__':
    if sys.argv[1:] == ['--idle']:
        os.sched_setscheduler(0, os.SCHED_IDLE, os.sched_param(0))
    ensure_compiled(lambda text: print(f'crgame: {text}', file=sys.stderr, flush=True))
