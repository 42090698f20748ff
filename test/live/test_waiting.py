# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A run with a driver in the browser waits for them at the start and after every reset."""

from collections.abc import Iterator
import json
import time
import urllib.request

from live_support import Launcher, SCENARIOS, wait_until
from page_client import PageClient, STATE
import pytest

# Initial speed of the human of the merge [m/s].
SPEED = 16.0
# A run that must not begin is watched for this long [s]: 50 of its cycles.
LOOK_S = 0.5


@pytest.fixture(scope='module')
def launcher(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Launcher]:
    """Keep one graph of a game that is driven from the page."""
    folder = tmp_path_factory.mktemp('waiting')
    with Launcher([SCENARIOS / 'merge.yaml', '--driver', 'cockpit'], folder / 'run',
                  headless=False) as running:
        yield running


@pytest.fixture
def page(launcher: Launcher) -> Iterator[PageClient]:
    """Open a client whose graph stands at step 0."""
    with PageClient(launcher.page) as client:
        wait_until(lambda: client.documents.get('status', {}).get('run') == 'paused',
                   'a run that stands')
        assert client.documents['status']['n'] == 0
        yield client


def reset(page: PageClient) -> None:
    """Begin the run anew, and wait for its documents."""
    epoch = page.documents['status']['epoch']
    assert page.request('control', action='reset')['ok']
    wait_until(lambda: page.documents['scene']['time']['epoch'] == epoch + 1
               and page.documents['status']['epoch'] == epoch + 1, 'the next epoch')


def stands(page: PageClient, run: str) -> None:
    """Assert that the run stands at its first step, at the speed that it begins with."""
    wait_until(lambda: page.documents['status']['run'] == run, f'a run that is {run}')
    time.sleep(LOOK_S)
    status = page.documents['status']
    assert (status['run'], status['n']) == (run, 0)
    frame = page.newest(STATE)
    assert frame is not None and int(frame[2]) == 0
    assert page.vehicle(0)[3] == pytest.approx(SPEED)


def test_start_waits_for_hands_and_so_does_a_reset(page: PageClient) -> None:
    """It waits at an empty seat and without hands on; a reset with the same hands on goes on."""
    stands(page, 'paused')
    reply = page.request('control', action='start')
    assert reply['ok'] and reply['text'] == 'waiting for the driver of hv0'
    stands(page, 'waiting')
    assert page.documents['status']['awaited'] == ['hv0']
    # One scenario step is a step, too.
    assert page.request('control', action='pause')['ok']
    assert page.request('control', action='step')['ok']
    stands(page, 'waiting')
    assert page.request('control', action='start')['ok']
    assert page.request('claim', seat='hv0')['ok']
    stands(page, 'waiting')
    page.hold_keys('hv0', [0, 0, 0, 0])
    wait_until(lambda: page.documents['status']['run'] == 'running', 'the run')
    assert page.documents['status']['awaited'] == []
    wait_until(lambda: page.documents['status']['n'] > 50, 'n = 50')
    reset(page)
    wait_until(lambda: page.documents['status']['n'] > 50, 'n = 50 once more')
    page.let_go()
    assert page.request('release', seat='hv0')['ok']
    reset(page)
    stands(page, 'paused')


@pytest.mark.exhaustive
def test_a_pause_in_the_run_ends_without_hands(page: PageClient) -> None:
    """Only the start waits: a paused run goes on, and its car brakes by itself."""
    assert page.request('claim', seat='hv0')['ok']
    page.hold_keys('hv0', [0, 0, 0, 0])
    assert page.request('control', action='start')['ok']
    wait_until(lambda: page.documents['status']['n'] > 10, 'n = 10')
    assert page.request('control', action='pause')['ok']
    wait_until(lambda: page.documents['status']['run'] == 'paused', 'the pause')
    page.let_go()
    n = page.documents['status']['n']
    assert page.request('control', action='start')['ok']
    wait_until(lambda: page.documents['status']['n'] > n + 50, 'the run')
    assert page.request('release', seat='hv0')['ok']
    reset(page)


@pytest.mark.exhaustive
def test_a_game_chosen_later_waits_too(page: PageClient) -> None:
    """A start that is ordered during loading is not lost."""
    with urllib.request.urlopen(f'{page.page}api/scenarios', timeout=10) as answer:
        folders = json.load(answer)['folders']
    chosen = next(entry for folder in folders for entry in folder['entries']
                  if entry['name'] == 'cut_in.yaml')
    epoch = page.documents['status']['epoch']
    request = urllib.request.Request(
        f'{page.page}api/load', json.dumps({
            'id': chosen['id'], 'humans': [{'id': 'hv0', 'driver': 'cockpit'}],
            'avs': []}).encode(), {'Content-Type': 'application/json', 'X-Crgame': '1'})
    with urllib.request.urlopen(request, timeout=30):
        pass
    assert page.request('control', action='start')['ok']
    wait_until(lambda: page.documents['status']['epoch'] == epoch + 1
               and page.documents['status']['awaited'] == ['hv0'], 'the game to wait')
    time.sleep(LOOK_S)
    assert page.documents['status']['n'] == 0
    assert page.request('claim', seat='hv0')['ok']
    page.hold_keys('hv0', [0, 0, 0, 0])
    wait_until(lambda: page.documents['status']['n'] > 10, 'n = 10')
