# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A participant of a study in a real browser that always answers in the same way."""

import time
from typing import Any, Protocol

from selenium.common.exceptions import WebDriverException
from selenium.webdriver.common.action_chains import ActionChains
from selenium.webdriver.common.keys import Keys
from urllib3.exceptions import HTTPError

# The question's name determines the answer, so that a test knows the expected one; the chosen
# answers are returned. Radio buttons are clicked, other answers typed.
_ANSWER = """
const told = {};
for (const node of document.querySelectorAll('#sheet .question[data-name]')) {
  const { kind, name } = node.dataset;
  const inputs = [...node.querySelectorAll('input, textarea')];
  const sum = [...name].reduce((all, letter) => all + letter.codePointAt(0), 0);
  const chosen = inputs[sum % inputs.length];
  if (kind === 'likert' || kind === 'choice') {
    chosen.click();
    told[name] = kind === 'likert' ? inputs.indexOf(chosen) + 1
      : (chosen.type === 'checkbox' ? [chosen.value] : chosen.value);
  } else {
    const { min, max, step } = chosen;
    const value = kind === 'slider' ? Number(min) + Number(step) * (sum % Math.round(
      (Number(max) - Number(min)) / Number(step) + 1)) : kind === 'number' ? 30 : arguments[0];
    chosen.value = String(value);
    chosen.dispatchEvent(new Event('input', { bubbles: true }));
    told[name] = value;
  }
}
return told;
"""


# The page around the drive receives its clock; the first call subscribes.
_CLOCK = """
if (window.heard === undefined) {
  window.heard = {};
  addEventListener('message', ({ data }) => {
    if (data?.kind === 'stage') { window.heard = { state: data.state, at: performance.now() }; }
  });
}
const { state, at } = window.heard;
return document.body.dataset.show === 'drive' && state && state.run === 'running'
  && performance.now() - at < 150 ? state.time_s : null;
"""


# Steering, and the answers to a light and to a request that may be there.
_TOUCHED = (Keys.ARROW_RIGHT, Keys.ENTER, 't', Keys.ARROW_LEFT)


class Page(Protocol):
    """The operations that the robot needs of a browser."""

    driver: Any

    def run(self, script: str, *arguments: Any) -> Any:
        """Run a function body in the page."""


class StudyRobot:
    """
    A participant.

    :param browser: with the participant's page.
    :param text: the answer to every question that takes text.
    :ivar answers: last given answers, by item.
    :ivar drives: items that were begun, in order.
    """

    def __init__(self, browser: Page, text: str = '<b>"a"</b>\n😀') -> None:
        self._browser = browser
        self._text = text
        self.answers: dict[str, dict[str, Any]] = {}
        self.drives: list[str] = []
        self._refused = 0
        self._acts = 0

    def act(self) -> str:
        """
        Answer the page's present request, if any.

        :return: shown page; empty without a usable page.
        """
        try:
            shown = self._act()
            self._refused = 0
            return shown
        except (WebDriverException, HTTPError):
            # The page is changing or gone.
            self._refused += 1
            return ''

    @property
    def lost(self) -> bool:
        """Return whether the browser no longer answers."""
        return self._refused > 3

    def time_s(self) -> float | None:
        """Return the run's clock as reported by the drive's frame [s]; None between drives."""
        try:
            time_s = self._browser.run(_CLOCK)
        except (WebDriverException, HTTPError):
            return None
        return None if time_s is None else float(time_s)

    def _act(self) -> str:
        shown, what = self._browser.run(
            'return [document.body.dataset.show ?? "",'
            ' (document.querySelector("#step")?.textContent ?? "")'
            ' + (document.querySelector("#drive:not([hidden]) h2")?.textContent ?? "")]')
        if shown == 'device':
            self._move_everything()
        elif shown == 'questions':
            self.answers[what] = self._browser.run(_ANSWER, self._text)
        if shown == 'drive':
            self._drive(what)
            # A key sent to a frame during its reload may block for a minute.
            if self.time_s() is not None:
                self._tap(_TOUCHED[self._acts % len(_TOUCHED)])
        elif shown in ('language', 'page', 'questions', 'break', 'device', 'elsewhere'):
            self._browser.run(
                'const button = document.querySelector("#sheet button.primary:not([disabled])");'
                'button?.click();')
        return str(shown)

    def _tap(self, key: str) -> None:
        """Touch a key, as the input latency is measured at input only."""
        self._acts += 1
        ActionChains(self._browser.driver).key_down(key).pause(0.03).key_up(key).perform()

    def _move_everything(self) -> None:
        self._browser.run('document.activeElement?.blur()')
        for key in 'adws':
            ActionChains(self._browser.driver).send_keys(key).perform()

    def _drive(self, what: str) -> None:
        pressed = self._browser.run(
            'const button = document.querySelector(".gate:not([hidden]) button.primary");'
            'const can = button && !button.disabled; if (can) { button.click(); } return can;')
        if pressed:
            self.drives.append(what)
            time.sleep(0.3)
            self.hold(Keys.ARROW_UP)

    def hold(self, key: str) -> None:
        """Hold a key from now on, in the element with the focus."""
        ActionChains(self._browser.driver).key_down(key).perform()
