# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Parts around a session: the framed stage, the experimenter's page, answers by a wheel."""

from pathlib import Path

from browser_support import Browser
from crgame_ros.study.session_journal import read_journal
from desk_page_support import finished, give_order, give_reason, Participant, running, stage
import pytest
from selenium.webdriver.common.action_chains import ActionChains
from selenium.webdriver.common.keys import Keys

pytestmark = pytest.mark.exhaustive

# Stands for missing hardware: a wheel whose buttons a test presses.
WHEEL = """
const wheel = { id: 'Wheel (Vendor: 046d Product: c24f)', index: 0, connected: true, mapping: '',
  axes: [0, 0, 1, 1], timestamp: 0,
  buttons: Array.from({ length: 20 }, () => ({ pressed: false, touched: false, value: 0 })) };
navigator.getGamepads = () => [wheel];
window.wheel = wheel;
window.dispatchEvent(new Event('gamepadconnected'));
"""


def test_the_stage_stays_loaded_between_drives_and_knows_readiness(
        browser: Browser, tmp_path: Path) -> None:
    """The gate opens at the stage's first picture; the frame gets the focus and stays loaded."""
    person = Participant(browser)
    blocks = [{'name': 'main', 'settings': {'game': 'x.yaml'}, 'after_trial': [
        {'questions': 'van_der_laan'}]}]
    (tmp_path / 'stage').mkdir()
    with stage(tmp_path / 'stage') as link, running(
            tmp_path, link=link, step_s=1.5, languages=[], fields=[], before=[], blocks=blocks,
            after=[]) as desk:
        browser.open(desk.participant)
        browser.run('localStorage.setItem("crgame.gamepad.wheel", "{}")')
        person.shows('drive', 'Drive 1 of 2')
        assert browser.run('return document.querySelector(".gate button").disabled')
        assert browser.run('return document.querySelector("iframe").allow') \
            == 'gamepad; fullscreen; autoplay'
        opened = browser.wait("""!document.querySelector(".gate button").disabled
            && performance.timeOrigin + performance.now()""")
        browser.driver.switch_to.frame(0)
        assert browser.run('return drew') <= opened
        browser.driver.switch_to.default_content()
        person.press(Keys.ENTER)
        browser.wait('document.querySelector(".gate").hidden')
        browser.driver.switch_to.frame(0)
        kinds = browser.wait('heard.length >= 4 && heard.map(({ kind }) => kind)')
        assert kinds[:4] == ['calibrations', 'calibrations', 'ready', 'focus']
        assert browser.run('return heard[0].profiles') == {'wheel': '{}'}
        assert browser.run('return heard[2].ready') is True
        assert browser.wait('document.hasFocus() && document.activeElement.id === "wheel"')
        began = browser.run('return began')
        browser.driver.switch_to.default_content()
        person.shows('questions')
        assert browser.run('return getComputedStyle(document.getElementById("drive")).visibility'
                           ) == 'hidden'
        # The hidden frame below receives no keys.
        person.answer_all()
        person.go_on()
        person.shows('drive', 'Drive 2 of 2')
        browser.driver.switch_to.frame(0)
        assert browser.run('return began') == began
        # Messages of other pages are ignored.
        browser.driver.switch_to.default_content()
        browser.run('window.postMessage({crgame: 1, kind: "stage", state: {seated: false}}, "*")')
        assert not browser.run('return document.querySelector(".gate button").disabled')
        assert not browser.console_errors()


def test_the_experimenter_sees_and_directs(browser: Browser, tmp_path: Path) -> None:
    """The page has notes and markers by keys, hold, skip, repeat, and a confirmed end."""
    person = Participant(browser)
    with running(tmp_path, languages=[]) as desk:
        browser.open(f'{desk.participant}experimenter')
        assert 'terminal' in browser.run('return document.body.innerText')
        browser.open(desk.experimenter)
        browser.wait('document.querySelectorAll("#items tr").length === 13')
        assert 'token' not in browser.driver.current_url
        assert browser.run('return document.getElementById("page").textContent').endswith(
            'not connected')
        own = browser.driver.current_window_handle
        browser.driver.switch_to.new_window('tab')
        browser.open(desk.participant)
        person.shows('questions')
        there = browser.driver.current_window_handle
        browser.driver.switch_to.window(own)
        browser.wait('document.getElementById("page").textContent.includes("connected, ")')
        person.press(Keys.F2)
        person.tab_to('#note')
        person.press('<i>sleepy</i>')
        ActionChains(browser.driver).key_down(Keys.CONTROL).send_keys(Keys.ENTER).key_up(
            Keys.CONTROL).perform()
        browser.wait('document.getElementById("log").textContent.includes("<i>sleepy</i>")')
        browser.wait('document.getElementById("log").textContent.includes("marker: spoke")')
        give_order(person, 'Hold before the next item')
        browser.driver.switch_to.window(there)
        person.answer_all()
        person.go_on()
        person.shows('wait')
        browser.driver.switch_to.window(own)
        # Orders refer to the item on screen; one for the previous item is refused.
        browser.wait('document.querySelector("#items tr:nth-child(2)").dataset.state === "now"')
        give_order(person, 'Skip this item', 'asked elsewhere')
        browser.wait('document.querySelector("#items tr:nth-child(2)").dataset.state'
                     ' === "skipped"')
        give_order(person, 'Go on')
        browser.driver.switch_to.window(there)
        person.shows('page', 'Welcome')
        browser.driver.switch_to.window(own)
        browser.run('document.querySelector("#items tr button").click()')
        give_reason(person, 'typed by mistake')
        browser.driver.switch_to.window(there)
        person.shows('questions')
        browser.driver.switch_to.window(own)
        give_order(person, 'End the session', 'asked to stop')
        assert finished(tmp_path).keys() == {'fields'}
        browser.wait('document.querySelector("dialog h2").textContent === "Really end it?"')
        # A second Enter does not press the button that ends the session.
        person.tab_to('dialog button.primary')
        person.press(Keys.ENTER)
        browser.wait('document.getElementById("now-title").textContent.includes("ended")')
        browser.driver.switch_to.window(there)
        person.shows('over', 'has ended')
        assert [entry['entry'] for entry in read_journal(tmp_path / 'P07')] == [
            'begun', 'marker', 'note', 'held', 'finished', 'skipped', 'held', 'repeated', 'ended']


def test_the_experimenters_page_speaks_german(browser: Browser, tmp_path: Path) -> None:
    """A choice on the page holds in this browser; what was typed stays, and so does the study."""
    person = Participant(browser)
    with running(tmp_path) as desk:
        browser.open(desk.experimenter)
        browser.wait('document.querySelectorAll("#items tr").length === 13')
        assert browser.run('return document.documentElement.lang') == 'en'
        person.press(Keys.F2)
        browser.wait('document.getElementById("log").textContent.includes("marker: spoke")')
        person.tab_to('#language')
        person.press('d')
        browser.wait('document.documentElement.lang === "de"')
        browser.wait('document.getElementById("log").textContent.includes("Marker: spoke")')
        browser.open(desk.experimenter.partition('?')[0])
        browser.wait('document.querySelectorAll("#items tr").length === 13')
        assert browser.run('return document.getElementById("language").value') == 'de'
        assert browser.run(
            'return [...document.querySelectorAll("[data-word]")].map((node) => node.textContent)'
        ) == ['Journal herunterladen', 'Fahrt abbrechen', 'Schritt auslassen', 'Sitzung beenden',
              'Fahrt ansehen', 'Notizen und Marker', 'Notiz, mit der Zeit und der Uhr des Laufs',
              'Notiz speichern', 'Sitzung', 'Schritt', 'Was', 'Bedingung', 'Stand', 'Versuche',
              'Protokoll']
        assert browser.run('return document.getElementById("now-title").textContent'
                           ) == 'Jetzt: zur Person (fields)'
        give_order(person, 'Schritt auslassen', 'bekannt')
        browser.wait('document.querySelector("#items tr").innerText'
                     '.includes("ausgelassen: bekannt")')
        assert not browser.console_errors()
    # The participant's language is theirs.
    assert not any(entry['entry'] == 'language' for entry in read_journal(tmp_path / 'P07'))


def test_what_comes_again_is_asked_anew(browser: Browser, tmp_path: Path) -> None:
    """A questionnaire repeated from the gate after it has no answers and has new times."""
    person = Participant(browser)
    before = [{'questions': 'van_der_laan'}]
    with running(tmp_path, languages=[], fields=[], before=before) as desk:
        browser.open(desk.experimenter)
        own = browser.driver.current_window_handle
        browser.driver.switch_to.new_window('tab')
        browser.open(desk.participant)
        there = browser.driver.current_window_handle
        person.shows('questions')
        person.answer_all()
        person.go_on()
        person.shows('drive')
        assert not browser.run('return Object.keys(sessionStorage).filter((key) =>'
                               ' key.startsWith("crgame.draft."))')
        browser.driver.switch_to.window(own)
        browser.wait('document.querySelector("#items tr button")')
        browser.run('document.querySelector("#items tr button").click()')
        give_reason(person, 'was disturbed')
        browser.driver.switch_to.window(there)
        person.shows('questions')
        assert browser.run('return document.querySelectorAll("input:checked").length') == 0
        # A reload in the middle keeps the present input.
        person.question('useful')
        person.press(Keys.ARROW_RIGHT)
        browser.driver.refresh()
        person.shows('questions')
        assert browser.wait('document.querySelectorAll("input:checked").length') == 1
        person.answer_all()
        person.go_on()
        person.shows('drive')
    entries = read_journal(tmp_path / 'P07')
    again = next(entry['at'] for entry in entries if entry['entry'] == 'repeated')
    told = [entry for entry in entries if entry['entry'] == 'finished']
    assert [entry['item'] for entry in told] == ['before/1'] * 2
    assert told[0]['shown_at'] < again < told[1]['shown_at'] + 0.1


def test_questions_are_answered_by_a_wheel(browser: Browser, tmp_path: Path) -> None:
    """The paddles choose, the first button confirms; moved controls pass the check."""
    person = Participant(browser)
    before = [{'questions': 'van_der_laan'}, {'device_check': {}}]

    def press(button: int) -> None:
        for pressed in (True, False):
            browser.run_async(
                'wheel.buttons[arguments[0]] = {pressed: arguments[1], value: +arguments[1]};'
                'await new Promise((done) => requestAnimationFrame(() =>'
                ' requestAnimationFrame(done)));', button, pressed)

    with running(tmp_path, languages=[], fields=[], before=before) as desk:
        browser.open(desk.participant)
        person.shows('questions')
        browser.run(WHEEL)
        for _ in range(8):
            press(4)
            press(4)
            press(0)
        press(4)
        press(5)
        press(0)
        press(0)
        person.shows('device')
        assert [*finished(tmp_path)['before/1']['answers'].values()] == [2] * 8 + [1]
        browser.wait('document.querySelectorAll(".device-check input").length === 2')
        # The device whose button led to this page is chosen.
        for axes in ([-1, 0, 1, 1], [1, 0, 1, 1], [0, 0, -1, 1], [0, 0, 1, -1], [0, 0, 1, 1]):
            browser.run_async('wheel.axes = arguments[0]; await new Promise((done) =>'
                              ' requestAnimationFrame(() => requestAnimationFrame(done)));', axes)
        assert browser.run('return document.querySelector(".device-check input:checked").value'
                           ) == '0'
        person.go_on()
        person.shows('drive')
        assert finished(tmp_path)['before/2']['device'].startswith('Wheel')


@pytest.mark.parametrize('moved', [
    'wheel.buttons[9] = {pressed: arguments[0], value: +arguments[0]}',
    'wheel.axes = [0.7 * arguments[0], 0, 1, 1]'])
def test_a_touched_wheel_is_chosen_but_not_against_a_choice(
        browser: Browser, tmp_path: Path, moved: str) -> None:
    """A chosen keyboard stays chosen when another device is touched."""
    person = Participant(browser)
    touch = (f'{moved}; await new Promise((done) => requestAnimationFrame(() =>'
             ' requestAnimationFrame(done)));'
             'return document.querySelector(".device-check input:checked").value;')
    with running(tmp_path, languages=[], fields=[], before=[{'device_check': {}}]) as desk:
        browser.open(desk.participant)
        person.shows('device')
        browser.run(WHEEL)
        browser.wait('document.querySelectorAll(".device-check input").length === 2')
        assert browser.run_async(touch, False) == 'keyboard'
        assert browser.run_async(touch, True) == '0'
        assert browser.run_async(touch, False) == '0'
        browser.run('document.querySelector(".device-check input").click()')
        assert browser.run_async(touch, True) == 'keyboard'
