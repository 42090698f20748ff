# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A desk's process, and the actions of participants and experimenters in a browser."""

from collections.abc import Iterator
from contextlib import contextmanager
import functools
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
import re
import subprocess
import sys
import threading
from typing import Any

from browser_support import Browser
from crgame_ros.study.session_journal import read_journal
import pytest
from selenium.webdriver.common.action_chains import ActionChains
from selenium.webdriver.common.keys import Keys

STUDY_TESTS = Path(__file__).resolve().parents[1] / 'study'
sys.path.insert(0, str(STUDY_TESTS))

from desk_support import write_study  # noqa: E402, I100


class DeskProcess:
    """A desk's process, with the addresses that it has printed."""

    def __init__(self, process: 'subprocess.Popen[str]') -> None:
        self.process = process
        assert process.stdout is not None
        self.participant, self.experimenter = (
            re.findall(r'http\S+', process.stdout.readline())[0] for _ in range(2))
        self.port = int(re.findall(r':(\d+)/', self.participant)[0])


@contextmanager
def running(folder: Path, port: int = 0, step_s: float = 0.05, link: str = '',
            **changed: Any) -> Iterator[DeskProcess]:
    """Start a desk of the study in a folder."""
    if not (folder / 'study').exists():
        write_study(folder / 'study', **changed)
    process = subprocess.Popen(
        [sys.executable, STUDY_TESTS / 'desk_process.py', folder / 'study' / 'study.yaml',
         folder / 'P07', str(port), link, str(step_s)], stdout=subprocess.PIPE, text=True)
    try:
        yield DeskProcess(process)
    finally:
        process.kill()
        process.wait()


class Participant:
    """A participant with only a keyboard."""

    def __init__(self, browser: Browser) -> None:
        self.browser = browser

    def press(self, *keys: str) -> None:
        ActionChains(self.browser.driver).send_keys(*keys).perform()

    def tab_to(self, selector: str) -> None:
        """Move the focus to the next control that fits."""
        for _ in range(80):
            if self.browser.run('return document.activeElement.matches(arguments[0])', selector):
                return
            self.press(Keys.TAB)
        pytest.fail(f'no way to {selector} by Tab')

    def question(self, name: str) -> None:
        self.tab_to(f'[data-name="{name}"] :is(input, textarea)')

    def go_on(self) -> None:
        self.tab_to('button.primary')
        self.press(Keys.ENTER)

    def shows(self, what: str, heading: str = '') -> None:
        """Wait for a page that shows a text."""
        self.browser.wait('document.body.dataset.show === arguments[0]'
                          ' && document.body.innerText.includes(arguments[1])',
                          f'{what} {heading}', arguments=(what, heading))

    def answer_all(self) -> None:
        """Answer all questions of the page: with the second option, one step, 30, a few words."""
        kinds = self.browser.run('return [...document.querySelectorAll(".question")].map('
                                 '(node) => [node.dataset.name, node.dataset.kind])')
        for name, kind in kinds:
            self.question(name)
            self.press({'likert': Keys.ARROW_RIGHT, 'slider': Keys.ARROW_RIGHT,
                        'choice': Keys.ARROW_RIGHT, 'number': '30', 'text': 'yes'}[kind])


def finished(folder: Path) -> dict[str, dict[str, Any]]:
    """Return the record of each finished item."""
    entries = [entry for entry in read_journal(folder / 'P07') if entry['entry'] == 'finished']
    assert len({entry['item'] for entry in entries}) == len(entries)
    return {entry['item']: entry for entry in entries}


# Stands for the cockpit's stage: it is seated, draws later, and keeps received messages.
STAGE = """<!DOCTYPE html><title>stage</title><input id="wheel"><script>
window.heard = [];
window.began = Math.random();
addEventListener('message', ({ data, origin }) => {
  heard.push({ ...data, origin });
  if (data.kind === 'focus') { document.getElementById('wheel').focus(); }
});
const tell = (drawn) => parent.postMessage({ crgame: 1, kind: 'stage', state: {
  seat: 'hv0', seated: true, connected: true, input_delay_ms: 33.4, drawn } }, '*');
setTimeout(() => tell(false), 100);
setTimeout(() => { window.drew = performance.timeOrigin + performance.now(); tell(true); }, 900);
</script>"""


@contextmanager
def stage(folder: Path) -> Iterator[str]:
    """Serve such a page at its own port."""
    (folder / 'index.html').write_text(STAGE, encoding='utf-8')
    handler = functools.partial(QuietHandler, directory=str(folder))
    with ThreadingHTTPServer(('127.0.0.1', 0), handler) as server:
        thread = threading.Thread(target=server.serve_forever)
        thread.start()
        yield f'http://127.0.0.1:{server.server_port}/?stage=hv0'
        server.shutdown()
        thread.join()


class QuietHandler(SimpleHTTPRequestHandler):
    """Serves files without log output."""

    def log_message(self, *_: Any) -> None:
        """Drop the log message."""


def give_order(person: Participant, name: str, reason: str = '') -> None:
    """Press an order's button and enter the required reason."""
    person.browser.wait('[...document.querySelectorAll("#orders button")].some((button) =>'
                        ' button.textContent === arguments[0] && !button.disabled)',
                        arguments=(name,))
    person.browser.run('[...document.querySelectorAll("#orders button")].find((button) =>'
                       ' button.textContent === arguments[0]).focus()', name)
    person.press(Keys.ENTER)
    if reason:
        give_reason(person, reason)


def give_reason(person: Participant, reason: str) -> None:
    """Type a reason into the open dialog."""
    person.browser.wait('document.querySelector("dialog[open] #reason")')
    person.browser.run('document.querySelector("#reason").focus()')
    person.press(reason, Keys.ENTER)
    person.browser.wait('!document.querySelector("#reason")')
