# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A take-over is replayed offline: the human to the last bit, the AV by the same commands."""

from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise
import json
from pathlib import Path
import subprocess
import sys
from typing import NamedTuple

from crgame_ros.game.game import load_game
from crgame_ros.messages.joints import vehicle_to_joints
from crgame_ros.recording.reader import BagReader
from crgame_ros.recording.recorded_game import recorded_inputs
from crgame_ros.recording.run_cycles import read_cycles
from crgame_ros.ros.messages import from_time
from crgame_ros.simulation.offline import OfflineResult, run_offline
from crgame_ros.simulation.setup import build_setup
from crgame_ros.vehicle.state import StateColumn, VehicleState
from live_support import CUT_IN, Launcher, ROOT, wait_until
import numpy as np
from numpy.typing import NDArray
from page_client import PageClient
import pytest

pytestmark = pytest.mark.exhaustive

STEP_NS = 10_000_000


class Recorded(NamedTuple):
    """A run whose hv0 changed hands for a while and whose av0 was taken over."""

    folder: Path
    commands: NDArray[np.float64]

    @property
    def duration_s(self) -> float:
        """Duration of the run [s]."""
        return len(self.commands) * STEP_NS * 1e-9

    @property
    def driven(self) -> NDArray[np.intp]:
        """Cycles in which av0 was driven by hand."""
        return np.flatnonzero(np.isfinite(self.commands[:, 0]))


@pytest.fixture(scope='module')
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Recorded]:
    """Drive in the browser: the human's car a little, then the AV for a while, then nothing."""
    folder = tmp_path_factory.mktemp('take_over') / 'run'
    with Launcher([CUT_IN, '--duration', 300], folder, headless=False) as launcher:
        with PageClient(launcher.page) as page:
            _drive(page, 'hv0', [0, 0, 1, 0], 60)
            _drive(page, 'av0', [0, 1, 0, 0], 120)
            n = page.documents['status']['n']
            wait_until(lambda: page.documents['status']['n'] > n + 100, 'another second')
            assert page.request('control', action='stop')['ok']
        assert launcher.wait() == 0, launcher.text
    yield Recorded(folder, read_cycles(folder / 'bag').commands('av0'))


def _drive(page: PageClient, seat: str, keys: list[int], steps: int) -> None:
    """Claim a seat, hold keys for so many steps, release them and give the seat back."""
    wait_until(lambda: page.documents.get('status', {}).get('run') == 'running', 'the run')
    page.hold_keys(seat, keys)
    assert page.request('claim', seat=seat)['ok']
    wait_until(lambda: page.seat(seat)['source'] == 'cockpit', 'the seat')
    n = page.documents['status']['n']
    wait_until(lambda: page.documents['status']['n'] > n + steps, f'{steps} steps')
    page.let_go()
    assert page.request('release', seat=seat)['ok']
    wait_until(lambda: page.seat(seat)['source'] != 'cockpit', 'the seat given back')


def _published(bag: Path, vehicle: str) -> NDArray[np.float64]:
    """Read the (n + 1, 2, 4) joint positions and velocities of a vehicle, step by step."""
    found = {}
    with BagReader(bag) as reader:
        for item in reader.decoded(['/vehicles/state']):
            first = list(item.message.joint_names).index(f'{vehicle}/x')
            point = item.message.points[0]
            found[from_time(item.message.header.stamp)] = (
                point.positions[first:first + 4], point.velocities[first:first + 4])
    stamps = sorted(found)
    assert np.all(np.diff(stamps) == STEP_NS)
    return np.array([found[stamp_ns] for stamp_ns in stamps])


def _replayed(recorded: Recorded) -> OfflineResult:
    game = load_game(recorded.folder / 'game.yaml')
    human = replace(game.humans[0], driver=f'replay:{recorded.folder / "bag"}')
    setup = build_setup(replace(game, humans=(human,)))
    drivers, intervals_s = recorded_inputs(setup)
    assert sorted(drivers) == ['av0', 'hv0']
    return run_offline(setup, duration_s=recorded.duration_s, drivers=drivers,
                       intervals_s=intervals_s)


def _joints(result: OfflineResult, vehicle: str) -> NDArray[np.float64]:
    return np.array([vehicle_to_joints(VehicleState(*row))[:2]
                     for row in result.states_of(vehicle).tolist()])


def test_the_human_is_reproduced_to_the_last_bit(recorded: Recorded) -> None:
    """Every published state is the same under script, browser and script again."""
    live, again = _published(recorded.folder / 'bag', 'hv0'), _joints(_replayed(recorded), 'hv0')
    assert len(live) == len(recorded.commands) + 1 and np.array_equal(live, again)
    # The browser's input is in it: the script alone drives elsewhere.
    script = run_offline(build_setup(load_game(recorded.folder / 'game.yaml')),
                         duration_s=recorded.duration_s)
    assert np.hypot(*(_joints(script, 'hv0')[-1, 0, :2] - live[-1, 0, :2])) > 1.0


def test_the_take_over_is_repeated(recorded: Recorded) -> None:
    """
    The same cycles have the same commands; before and after, its planner drives the AV.

    Live, plans arrive some steps late, so that the AV enters the take-over elsewhere than in
    lockstep: from there on its driver changes its speed by the same amount.
    """
    driven = recorded.driven
    assert len(driven) > 100 and np.all(np.diff(driven) == 1)
    result = _replayed(recorded)
    live, again = _published(recorded.folder / 'bag', 'av0'), result.states_of('av0')
    speeds = np.hypot(live[:, 1, 0], live[:, 1, 1])
    # To the end of the whole brake, or of what moves: the key may have been held till it stood.
    whole = driven[(recorded.commands[driven, 1] == 1.0) & (speeds[driven] > 1.0)]
    first, last = driven[0], whole[-1] + 1
    assert speeds[first] - speeds[last] > 3.0
    assert again[last, StateColumn.SPEED] - again[first, StateColumn.SPEED] == pytest.approx(
        speeds[last] - speeds[first], abs=0.3)
    # Full braking, at the end, in the same steps as live.
    assert again[last - 5:last, StateColumn.ACCELERATION].max() < -3.0
    alone = run_offline(result.setup, duration_s=recorded.duration_s, drivers={
        'hv0': recorded_inputs(result.setup)[0]['hv0']})
    assert alone.states_of('av0')[last, StateColumn.SPEED] > speeds[last] + 3.0


def test_live_it_is_repeated_too(recorded: Recorded, tmp_path: Path) -> None:
    """The recording alone repeats each driver's cycles and commands, and the human's states."""
    with Launcher(['--driver', f'replay:{recorded.folder / "bag"}', '--duration',
                   f'{recorded.duration_s:.2f}'], tmp_path / 'run') as launcher:
        assert launcher.wait() == 0, launcher.text
    first, second = (read_cycles(folder / 'bag') for folder in (recorded.folder, tmp_path / 'run'))
    for vehicle in ('hv0', 'av0'):
        assert np.array_equal(first.commands(vehicle), second.commands(vehicle), equal_nan=True)
    before, after = (_published(folder / 'bag', 'hv0')
                     for folder in (recorded.folder, tmp_path / 'run'))
    assert np.array_equal(before, after)
    # The seat changes hands when its commands do: the planner's, the recording's, the planner's.
    assert _sources(recorded.folder / 'bag') == ['planner', 'cockpit', 'planner']
    assert _sources(tmp_path / 'run' / 'bag') == ['planner', 'replay', 'planner']


def _sources(bag: Path) -> list[str]:
    """Read the drivers of av0, one after the other."""
    with BagReader(bag) as reader:
        told = [json.loads(item.message.data)['av0']['source']
                for item in reader.decoded(['/seats'])]
    return [source for before, source in pairwise(['', *told]) if source != before]


def test_the_command_line_does_the_same_twice(recorded: Recorded) -> None:
    """`crgame offline GAME --driver replay:BAG` has one state hash, that of the runner."""
    hashes = set()
    for _ in range(2):
        process = subprocess.run(
            [sys.executable, '-m', 'crgame_ros.cli', 'offline', recorded.folder / 'game.yaml',
             '--driver', f'replay:{recorded.folder / "bag"}',
             '--duration', str(recorded.duration_s)],
            cwd=ROOT, capture_output=True, text=True, timeout=300, check=True)
        hashes.add(json.loads(process.stdout)['state_hash'])
    assert hashes == {_replayed(recorded).state_hash}
