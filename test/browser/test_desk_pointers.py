# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A questionnaire answered by mouse and by touch events of the browser."""

from pathlib import Path

from browser_support import Browser
from desk_page_support import finished, Participant, running
import pytest
from selenium.webdriver.common.action_chains import ActionChains
from selenium.webdriver.common.actions.action_builder import ActionBuilder
from selenium.webdriver.common.actions.interaction import POINTER_TOUCH
from selenium.webdriver.common.actions.pointer_input import PointerInput

pytestmark = pytest.mark.exhaustive

QUESTIONS = ['trust', 'often', 'tired', 'vehicles']
ANSWERS = {'trust': 7, 'often': 4, 'tired': 50, 'vehicles': ['truck']}


class Pointer:
    """
    Presses elements where they are drawn, not by a script.

    :param browser: with the participant's page.
    :param kind: of the pointer, `mouse` or `touch`.
    """

    def __init__(self, browser: Browser, kind: str) -> None:
        self._browser, self._kind = browser, kind

    def press(self, selector: str) -> None:
        """Press the middle of the last element that fits, once it is visible."""
        x, y = self._browser.run(
            'const [node] = [...document.querySelectorAll(arguments[0])].reverse();'
            'node.scrollIntoView({block: "center", behavior: "instant"});'
            'const box = node.getBoundingClientRect();'
            'return [Math.round(box.x + box.width / 2), Math.round(box.y + box.height / 2)];',
            selector)
        if self._kind == 'touch':
            actions = ActionBuilder(self._browser.driver,
                                    mouse=PointerInput(POINTER_TOUCH, 'finger'))
        else:
            actions = ActionChains(self._browser.driver).w3c_actions
        actions.pointer_action.move_to_location(x, y).pointer_down().pointer_up()
        actions.perform()


@pytest.mark.parametrize('kind', ['mouse', 'touch'])
def test_a_questionnaire_is_answered_by_a_pointer(browser: Browser, tmp_path: Path,
                                                  kind: str) -> None:
    """Every kind of field without keys can be answered by presses at its drawn place."""
    person, pointer = Participant(browser), Pointer(browser, kind)
    with running(tmp_path, languages=[], fields=[],
                 before=[{'questions': 'kinds.yaml'}]) as desk:
        browser.open(desk.participant)
        person.shows('questions')
        browser.run('window.kinds = new Set(); addEventListener("pointerdown",'
                    ' (event) => kinds.add(event.pointerType + event.isTrusted), true);')
        for name in QUESTIONS:
            pointer.press(f'[data-name={name}] :is(.option, input[type=range])')
        # A line without a mark gets one in its middle; texts need keys.
        for name, text in (('distance', '12'), ('words', 'x')):
            pointer.press(f'[data-name={name}] :is(input, textarea)')
            person.press(text)
        assert browser.run('return [...kinds]') == [f'{kind}true']
        pointer.press('#sheet button.primary')
        person.shows('drive')
        answers = finished(tmp_path)['before/1']['answers']
        assert {name: answers[name] for name in QUESTIONS} == ANSWERS
        assert (answers['distance'], answers['words']) == (12, 'x')
