# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A participant's whole session in a real browser, by keyboard alone, and its failures."""

import os
from pathlib import Path
import signal
from typing import Any

from browser_support import Browser
from desk_page_support import finished, Participant, running
import pytest
from selenium.webdriver.common.keys import Keys

TEXT = '<b>"it\'s" & \\ {age}</b>\n\n  second line\t😀 Grüße ' + 'ä😀' * 4970
TEXT += 'x' * (10_000 - len(TEXT))


@pytest.mark.matrix
@pytest.mark.parametrize(('language', 'agree', 'drive', 'thanks'), [
    ('en', 'I agree', 'Drive 2 of 2', 'Thank you'),
    ('de', 'Ich stimme zu', 'Fahrt 2 von 2', 'Vielen Dank')])
def test_a_whole_session_by_keyboard(browser: Browser, tmp_path: Path, language: str, agree: str,
                                     drive: str, thanks: str) -> None:
    """Every kind of item works; input is stored unchanged, with plausible times."""
    person = Participant(browser)
    with running(tmp_path) as desk:
        browser.open(desk.participant)
        person.shows('language')
        person.tab_to(f'button[lang={language}]')
        person.press(Keys.ENTER)
        person.shows('questions')
        assert browser.run('return document.documentElement.lang') == language
        assert browser.run('return document.querySelector("button.primary").textContent') == {
            'en': 'Next', 'de': 'Weiter'}[language]
        person.go_on()
        assert browser.wait('document.querySelectorAll(".question .problem:not([hidden])").length'
                            ) == 2
        person.question('age')
        person.press('17')
        person.go_on()
        browser.wait('document.querySelector("[data-name=age] .problem").textContent'
                     '.includes("18")')
        person.question('age')
        person.press(Keys.BACKSPACE, Keys.BACKSPACE, '42')
        person.question('licence')
        person.press(Keys.ARROW_DOWN)
        person.go_on()
        person.shows('page', agree)
        person.go_on()
        person.shows('page', 'Welcome')
        assert browser.run('return document.querySelectorAll("#sheet script").length') == 0
        assert browser.run('return [...document.querySelectorAll("#sheet a")].map((a) => a.href)'
                           ) == ['https://example.org/']
        browser.wait('document.querySelector("#sheet img").naturalWidth === 320')
        person.go_on()
        person.shows('device')
        browser.run('document.activeElement.blur()')
        person.press('a', 'd', 'w')
        person.go_on()
        browser.wait('document.querySelector(".device-check > .problem").textContent')
        browser.run('document.activeElement.blur()')
        person.press('s')
        person.go_on()
        person.shows('questions')
        answer_kinds(person)
        drive_and_rate(person, drive)
        person.shows('over', thanks)
        assert not browser.console_errors()
    check_told(finished(tmp_path), language)


def answer_kinds(person: Participant) -> None:
    """Answer one question of each kind."""
    person.question('trust')
    person.press(Keys.ARROW_RIGHT, Keys.ARROW_RIGHT)
    person.question('often')
    person.press(Keys.ARROW_LEFT)
    person.question('tired')
    person.press(Keys.HOME, Keys.ARROW_RIGHT)
    person.question('vehicles')
    person.press(' ', Keys.TAB, Keys.TAB, ' ')
    person.question('distance')
    person.press('12000,5')
    person.question('words')
    # Ten thousand characters, many without a key, come from the clipboard.
    person.browser.driver.execute_cdp_cmd('Input.insertText', {'text': TEXT})
    person.go_on()


def drive_and_rate(person: Participant, last: str) -> None:
    """Practise, drive twice with a break between, and answer the questionnaires."""
    person.shows('drive')
    person.go_on()
    person.browser.wait('document.querySelector(".gate h2").textContent.includes("1")'
                        ' && document.querySelector(".gate h2").textContent.includes("2")')
    person.go_on()
    person.shows('questions')
    assert person.browser.run('return document.querySelectorAll(".question").length') == 21
    person.answer_all()
    person.go_on()
    person.shows('break')
    person.browser.wait('!document.querySelector("#sheet button").disabled')
    person.go_on()
    person.shows('drive', last)
    person.go_on()
    for _ in range(3):
        person.shows('questions')
        title = person.browser.run('return document.querySelector("h2").textContent')
        person.answer_all()
        person.go_on()
        person.browser.wait('document.querySelector("h2")?.textContent !== arguments[0]',
                            arguments=(title,))


def check_told(told: dict[str, dict[str, Any]], language: str) -> None:
    """Check the journal of such a session."""
    assert told['fields']['answers'] == {'age': 42, 'licence': 'no'}
    assert told['before/1']['agreed'] is True
    assert told['before/3']['device'] == 'keyboard'
    assert sorted(told['before/3']['moved']) == ['brake', 'left', 'right', 'throttle']
    answers = told['before/4']['answers']
    assert answers.pop('words') == TEXT and len(TEXT) == 10_000
    assert answers == {'trust': 3, 'often': 4, 'tired': 5, 'vehicles': ['car', 'truck'],
                       'distance': 12000.5}, language
    for entry in told.values():
        if 'shown_at' in entry:
            assert entry['shown_at'] <= entry['answered_at'] <= entry['at'] + 1.0
            assert entry['taken_s'] == pytest.approx(
                entry['answered_at'] - entry['shown_at'], abs=0.01)
            assert all(0.0 <= after_s <= entry['taken_s'] for after_s in entry['after_s'].values())
    assert set(told['before/4']['after_s']) == {*answers, 'words'}
    assert len(told) == 13


@pytest.mark.exhaustive
def test_nothing_is_lost_or_asked_twice_after_a_kill_and_a_reload(browser: Browser,
                                                                  tmp_path: Path) -> None:
    """The page returns by itself with the typed input; stored answers are not asked again."""
    person = Participant(browser)
    with running(tmp_path) as desk:
        browser.open(desk.participant)
        person.shows('language')
        person.go_on()
        person.shows('questions')
        person.question('age')
        person.press('42')
        os.kill(desk.process.pid, signal.SIGKILL)
        desk.process.wait()
        browser.wait('!document.getElementById("lost").hidden', 'the page to see it')
        person.question('licence')
        person.press(Keys.ARROW_DOWN)
        person.go_on()
        port = desk.port
    with running(tmp_path, port) as desk:
        assert desk.port == port
        browser.wait('document.getElementById("lost").hidden', 'the page to come back')
        browser.driver.refresh()
        person.shows('questions')
        assert browser.wait('document.querySelector("[data-name=age] input")?.value') == '42'
        assert browser.run('return document.querySelectorAll("input:checked").length') == 1
        person.go_on()
        person.shows('page', 'I agree')
        os.kill(desk.process.pid, signal.SIGKILL)
        desk.process.wait()
    with running(tmp_path, port):
        browser.wait('document.getElementById("lost").hidden', 'the page to come back again')
        person.shows('page', 'I agree')
        assert list(finished(tmp_path)) == ['fields']
        shown = finished(tmp_path)['fields']
        assert shown['taken_s'] > 0.0


@pytest.mark.exhaustive
def test_a_second_tab_and_a_double_click_do_nothing_twice(browser: Browser,
                                                          tmp_path: Path) -> None:
    """The tab opened last is used; the first one takes over on request."""
    person = Participant(browser)
    with running(tmp_path, languages=[]) as desk:
        browser.open(desk.participant)
        person.shows('questions')
        first = browser.driver.current_window_handle
        browser.driver.switch_to.new_window('tab')
        browser.open(desk.participant)
        person.shows('questions')
        second = browser.driver.current_window_handle
        browser.driver.switch_to.window(first)
        person.shows('elsewhere')
        person.go_on()
        person.shows('questions')
        browser.driver.switch_to.window(second)
        person.shows('elsewhere')
        browser.driver.close()
        browser.driver.switch_to.window(first)
        person.answer_all()
        browser.run('const button = document.querySelector("button.primary");'
                    'button.click(); button.click(); button.click();')
        person.shows('page', 'I agree')
        browser.run('const button = document.querySelector("button.primary");'
                    'button.click(); button.click();')
        person.shows('page', 'Welcome')
        assert list(finished(tmp_path)) == ['fields', 'before/1']
