# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A platform's participants arrive, take part in processes of their own, and come back."""

from http.cookiejar import CookieJar
from pathlib import Path
import re
import shutil
import signal
import ssl
import subprocess
import sys
import urllib.error
import urllib.request

from crgame_ros.cockpit.access import reachable_addresses
from crgame_ros.paths import scenarios_directory
from crgame_ros.study.session_journal import read_journal
import pytest
import yaml

pytestmark = [pytest.mark.exhaustive, pytest.mark.skipif(
    shutil.which('openssl') is None, reason='openssl is not installed')]
PATIENCE_S = 120.0
PORT = 8520


class Browser:
    """A browser with its cookies, whose user accepts the certificate."""

    def __init__(self) -> None:
        self._opener = urllib.request.build_opener(
            urllib.request.HTTPSHandler(context=ssl._create_unverified_context()),
            urllib.request.HTTPCookieProcessor(CookieJar()))

    def open(self, address: str) -> tuple[int, str, str]:  # noqa: A003
        """Return status, final address and text."""
        try:
            with self._opener.open(address, timeout=PATIENCE_S) as answer:
                return answer.status, answer.url, answer.read().decode()
        except urllib.error.HTTPError as answer:
            return answer.code, answer.url, answer.read().decode()


def test_an_arrival_gets_its_session_and_one_too_many_waits(tmp_path: Path) -> None:
    game = str(scenarios_directory() / 'cut_in.yaml')
    file, out = tmp_path / 'study.yaml', tmp_path / 'data'
    file.write_text(yaml.safe_dump({
        'name': 'far', 'settings': {'duration': 2.0, 'game': game},
        'fields': [{'name': 'why', 'text': {}}], 'blocks': [{'name': 'main'}],
        'elsewhere': {'id_from': 'PID', 'completion_code': 'C1'}}))
    command = [sys.executable, '-m', 'crgame_ros.cli', 'study', 'serve', str(file), '--out',
               str(out), '--listen', reachable_addresses('0.0.0.0')[0], '--port', str(PORT)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as reception:
        try:
            assert reception.stdout is not None
            address = re.findall(r'https\S+', reception.stdout.readline())[0]
            assert '&PID=ID' in address
            anna, bert = Browser(), Browser()
            status, page, text = anna.open(address.replace('=ID', '=5f0canna'))
            assert status == 200 and 'participant.js' in text and page.endswith('/')
            # The same id leads to the same session, in the browser that began it.
            assert anna.open(address.replace('=ID', '=5f0canna')) == (200, page, text)
            status, _, text = bert.open(address.replace('=ID', '=5f0canna'))
            assert status == 403 and 'This link has been used' in text
            status, _, text = bert.open(address.replace('=ID', '=bert'))
            assert status == 503 and 'All places are taken' in text
            reception.send_signal(signal.SIGINT)
            told = reception.stdout.read()
            assert reception.wait(PATIENCE_S) == 0
        finally:
            reception.kill()
    own = subprocess.run([*command, '--id-of', '5f0canna'], capture_output=True, text=True,
                         check=True).stdout.strip()
    assert [path.name for path in (out / 'participants').iterdir()] == [own]
    assert f'{own} goes on with the same command' in told
    assert [entry['entry'] for entry in read_journal(out / 'participants' / own)] == [
        'begun', 'opened']
    kept = b''.join(path.read_bytes() for path in out.rglob('*') if path.is_file())
    assert b'5f0canna' not in kept
