# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Uploaded scenarios, valid and invalid, and texts in them that could act as code."""

from collections.abc import Iterator
from pathlib import Path
import shutil

from browser_support import Browser
from live_browser_support import Graph, live_graph, LivePage, SCENARIOS, THROTTLE
import pytest
from selenium.webdriver.common.by import By
from selenium.webdriver.common.keys import Keys
from selenium.webdriver.support.select import Select
import yaml

SCENARIO = 'ZAM_CutIn-1_1_T-1.xml'
IMAGE = '<img src=x onerror="window.ran = true">'
SCRIPT = '<script>window.ran = true</script>'
# The server's entry.
CLEANED = IMAGE.strip('<>')
UPLOADED = 'ZAM_Brought-7_1_T-1'
GAME = {
    'title': f'{SCRIPT} {IMAGE}', 'scenario': SCENARIO, 'duration': 3600,
    'humans': [{'id': 'hv0', 'driver': 'idle',
                'spawn': {'lanelet': 13, 's': 234.0, 'd': 0.0, 'speed': 20.0}}],
    'avs': [{'id': 'av0', 'planning_problem': 100, 'planner': 'idm'}],
    'events': [{'name': 'box', 'label': f'A box {IMAGE}',
                'obstacle': {'x': 60.0, 'y': 0.0, 'length': 2.0, 'width': 1.0}}]}
BAD = {
    'no XML': (f'{SCRIPT} {IMAGE}', 'XML'),
    'entity expansion': ('<!DOCTYPE a [<!ENTITY b "hahaha"><!ENTITY c "&b;&b;&b;&b;&b;">]>'
                         '<commonRoad benchmarkID="&c;"/>', 'entities'),
    'outside entity': ('<!DOCTYPE a [<!ENTITY x SYSTEM "file:///etc/passwd">]>'
                       '<commonRoad benchmarkID="&x;"/>', 'entities'),
    'a web page': (f'<html><body>{SCRIPT.replace("script", "SCRIPT")}</body></html>', 'html'),
}


@pytest.fixture(scope='module')
def graph(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Graph]:
    """Keep one graph of a game whose texts would run as code in an unsafe page."""
    folder = tmp_path_factory.mktemp('scenarios')
    shutil.copy(SCENARIOS / SCENARIO, folder)
    (folder / 'game.yaml').write_text(yaml.safe_dump(GAME))
    with live_graph(folder / 'game.yaml', folder / 'run') as running:
        yield running


@pytest.fixture(scope='module')
def only_page(graph: Graph, module_browser: Browser) -> LivePage:
    """Open the page once."""
    return LivePage(graph, module_browser)


@pytest.fixture
def page(only_page: LivePage) -> Iterator[LivePage]:
    """Return the page at its scenario panel; check afterwards that no text ran as code."""
    only_page.tab('scenario')
    yield only_page
    assert only_page.run('return [window.ran ?? false, document.images.length]') == [False, 0]


def choose_file(page: LivePage, path: Path) -> None:
    """Choose a local file, as by the button of the panel."""
    page.driver.find_element(
        By.CSS_SELECTOR, '#panel-scenario input[type=file]').send_keys(str(path))


@pytest.mark.exhaustive
def test_texts_of_a_game_are_text(page: LivePage) -> None:
    """Its title in list, preview and header, and the label of its event are plain text."""
    title = str(GAME['title'])
    page.wait_for_text('#title', title)
    page.wait_for_text('button.scenario[title="game.yaml"]', CLEANED)
    page.click('button.scenario[title="game.yaml"]')
    page.wait_for_text('.preview-card h3', title)
    page.tab('events')
    page.wait_for_text('.event-list h3', f'A box {IMAGE}')
    page.click('.event-list button')
    page.wait_for_text('.event-log', f'A box {IMAGE}')
    assert page.run('return document.scripts.length') == 1
    assert page.browser.console_errors() == []


@pytest.mark.matrix
@pytest.mark.parametrize(('content', 'reason'), BAD.values(), ids=BAD.keys())
def test_bad_files_are_refused_in_words(page: LivePage, tmp_path: Path, content: str,
                                        reason: str) -> None:
    """The panel shows the mistake, no file is kept, and the run goes on."""
    path = tmp_path / f'{IMAGE}.xml'
    path.write_text(content)
    page.run_async('await crgame.scenario.refresh();')
    before = page.run('return document.querySelectorAll("button.scenario").length')
    choose_file(page, path)
    shown = page.wait("""[...document.querySelectorAll('#panel-scenario .field-error')]
        .map((node) => node.textContent).find((text) => text !== '')""", 'a message')
    assert reason in shown
    page.run_async('await crgame.scenario.refresh();')
    assert page.run('return document.querySelectorAll("button.scenario").length') == before
    page.graph.wait_for_steps(20)
    # The browser also logs the server's refusal.
    errors = page.browser.console_errors()
    page.browser.forget_errors()
    assert all('/api/upload' in error and '400' in error for error in errors)


def test_a_file_is_uploaded_started_and_driven(page: LivePage, tmp_path: Path) -> None:
    """Its name is shown as text and not run as code; the buttons start a drive in it."""
    path = tmp_path / f'{IMAGE}.xml'
    path.write_text((SCENARIOS / 'ZAM_LaneChange-1_1_T-1.xml').read_text().replace(
        'ZAM_LaneChange-1_1_T-1', UPLOADED))
    choose_file(page, path)
    page.wait_for_text('button.scenario[aria-checked=true]', CLEANED)
    page.wait_for_text('.preview-card', UPLOADED)
    epoch = page.run('return crgame.store.scene.time.epoch')
    driver = page.driver.find_element(By.CSS_SELECTOR, '.who select[aria-label^="hv0"]')
    assert Select(driver).first_selected_option.get_attribute('value') == 'cockpit'
    options = page.driver.find_element(By.CSS_SELECTOR, '.planner-options summary')
    options.send_keys(Keys.ENTER)
    page.wait_for_text('.planner-options', 'desired speed')
    page.driver.find_element(By.CSS_SELECTOR, '.planner-option input').send_keys('12.5')
    page.click('.start-area button.primary')
    page.wait('crgame.store.scene.time.epoch > arguments[0]'
              ' && crgame.store.scene.benchmark_id === arguments[1]', 'the uploaded scenario',
              epoch, UPLOADED)
    page.wait('crgame.world.shown?.epoch === crgame.store.scene.time.epoch', 'its picture')
    page.wait("crgame.driving.seat === 'hv0'", 'the seat of who has brought it')
    page.wait_for_run('running')
    page.wait('crgame.store.status.planners.av0?.accepted > 3', 'plans of its AV')
    written, = (page.graph.launcher.out / 'cockpit' / 'games').iterdir()
    assert yaml.safe_load(written.read_text())['avs'][0]['options'] == {'v0': 12.5}
    speed = page.vehicle(0)[3]
    page.hold('w')
    page.graph.wait_for_command('hv0', THROTTLE, 1.0, 1.0)
    page.wait('crgame.world.shown.vehicles[3] > arguments[0] + 1', 'a faster car', speed)
    page.release('w')
    assert page.browser.console_errors() == []


@pytest.mark.exhaustive
def test_an_upload_is_deleted_after_a_question(page: LivePage) -> None:
    """Its delete button asks first and is refused during its run; then the file is deleted."""
    row = '#panel-scenario [data-action="delete"]'
    page.wait('document.querySelectorAll(arguments[0]).length === 1', 'the upload', row)
    page.click(row)
    page.click('dialog.confirm[open] .drive-button:not(.danger)')
    page.wait('!document.querySelector("dialog.confirm[open]")')
    assert page.run('return document.querySelectorAll(arguments[0]).length', row) == 1
    page.click(row)
    page.click('dialog.confirm[open] .danger')
    page.wait_for_text('#panel-scenario', 'is the scenario of the present run')
    errors = page.browser.console_errors()
    page.browser.forget_errors()
    assert all('/api/upload/delete' in error and '400' in error for error in errors)
    page.click('button.scenario[title="game.yaml"]')
    page.click('.start-area button.primary')
    page.wait('crgame.store.scene.benchmark_id !== arguments[0]', 'another run', UPLOADED)
    page.wait_for_run('running')
    page.click(row)
    page.click('dialog.confirm[open] .danger')
    page.wait('document.querySelectorAll(arguments[0]).length === 0', 'it to be gone', row)
    page.run('location.reload();')
    page.open()
    page.tab('scenario')
    page.wait('document.querySelector("button.scenario")', 'the list')
    assert page.run('return document.querySelectorAll(arguments[0]).length', row) == 0
    assert page.browser.console_errors() == []
