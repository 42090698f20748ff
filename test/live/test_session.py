# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A graph with a page stays when a run has ended, until it is ended by hand."""

import json
from pathlib import Path
import shutil
import signal
import time
from typing import Any
import urllib.request

from crgame_ros.game.game import load_game
from live_support import is_node, Launcher, SCENARIOS, wait_until
from page_client import PageClient
import pytest

pytestmark = pytest.mark.exhaustive

SHORT_S = 1.5
SCENARIO = 'ZAM_CutIn-1_1_T-1.xml'
GAME = f"""
scenario: {SCENARIO}
duration: {SHORT_S}
humans:
  - {{id: hv0, driver: DRIVER}}
"""
# Longer than a graph without a page takes to end.
LOOK_S = 3.0


def load(page: PageClient, name: str) -> None:
    """Begin a game of the list, as the page does."""
    with urllib.request.urlopen(f'{page.page}api/scenarios', timeout=10) as answer:
        folders = json.load(answer)['folders']
    chosen = next(entry for folder in folders for entry in folder['entries']
                  if entry['name'] == name)
    request = urllib.request.Request(
        f'{page.page}api/load', json.dumps({'id': chosen['id'], 'humans': [], 'avs': []}).encode(),
        {'Content-Type': 'application/json', 'X-Crgame': '1'})
    with urllib.request.urlopen(request, timeout=30):
        pass


def ended(page: PageClient, epoch: int) -> None:
    """Wait for the end of a run, and for its files."""
    wait_until(lambda: page.documents['status']['epoch'] == epoch
               and page.documents['status']['run'] == 'ended', f'the end of epoch {epoch}')
    wait_until(lambda: (files := page.documents.get('files', {})).get('epoch') == epoch
               and files['complete'], f'the files of epoch {epoch}')


def _settled(page: PageClient) -> dict[str, Any]:
    """Return the status without the measured pace, which falls to 0 within a second of the end."""
    return {key: value for key, value in page.documents['status'].items()
            if key != 'measured_factor'}


def test_an_undriven_game_one_that_ends_and_the_same_again(tmp_path: Path) -> None:
    """All nodes live on after the end; the page's orders but reset are refused; 0 at the end."""
    for driver in ('cockpit', 'idle'):
        (tmp_path / f'{driver}.yaml').write_text(GAME.replace('DRIVER', driver))
    shutil.copy(SCENARIOS / SCENARIO, tmp_path)
    out = tmp_path / 'run'
    with Launcher([tmp_path / 'cockpit.yaml'], out, headless=False) as launcher:
        with PageClient(launcher.page) as page:
            wait_until(lambda: page.documents.get('status', {}).get('run') == 'paused',
                       'a run that waits for its driver')
            load(page, 'idle.yaml')
            wait_until(lambda: page.documents['status']['epoch'] == 1
                       and page.documents['status']['run'] == 'paused', 'the game')
            assert page.request('control', action='start')['ok']
            ended(page, 1)
            status = _settled(page)
            assert (status['reason'], status['t']) == ('duration', SHORT_S)
            assert status['recording']['state'] == 'recorded'
            assert set(page.documents['files']['names']) == {
                'bag', 'game.yaml', 'timing.json', 'C-ZAM_CutIn-1_1_T-1.xml'}
            assert page.documents['alarms']['active'] == []
            time.sleep(LOOK_S)
            assert _settled(page) == status
            started = dict(launcher.started)
            # The driver node of the human that is not driven in the first game came later.
            assert all(is_node(pid) for pid in started.values()) and 'driver_node_hv0' in started
            for action in ('start', 'pause', 'step', 'stop'):
                reply = page.request('control', action=action)
                assert not reply['ok'] and 'the run is over' in reply['text']
            assert page.request('control', action='reset')['ok']
            ended(page, 2)
            wait_until(lambda: page.documents['status']['timing']['cycles']
                       == round(100 * SHORT_S), 'all cycles of it')
        launcher.signal(signal.SIGINT)
        assert launcher.wait() == 0, launcher.text
    assert launcher.says(f'{out}: nothing was recorded: the run ended before its first step')
    assert not list(out.glob('*.xml')) and (out / 'bag' / 'metadata.yaml').is_file()
    for name in ('run_2', 'run_3'):
        assert load_game(out / name / 'game.yaml').humans[0].driver == 'idle'
        assert json.loads((out / name / 'timing.json').read_text())['cycles'] == 100 * SHORT_S
    assert not launcher.says('Traceback')
