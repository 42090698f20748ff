# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A session at the page: several runs in sequence, their result cards and files."""

from collections.abc import Iterator
import json
import math
from pathlib import Path
import re
import shutil
import signal
from typing import Any

from browser_support import Browser
import commonroad
from crgame_ros.analysis.scores.scored_run import scores_of
from crgame_ros.game.game import load_game
from crgame_ros.recording.reader import BagReader
from crgame_ros.recording.run_folder import run_folders
from crgame_ros.recording.run_record import read_run_record
from crgame_ros.simulation.setup import build_setup
from live_browser_support import Graph, live_graph, LivePage, SCENARIOS
from lxml import etree
import pytest
import yaml

pytestmark = pytest.mark.exhaustive

CUT_IN, TRAFFIC = 'ZAM_CutIn-1_1_T-1', 'ZAM_Intersection-1_1_T-1'
SCHEMA = Path(commonroad.__file__).parent.joinpath(
    'scenario_definition', 'xml_definition_files', 'XML_commonRoad_XSD.xsd')
SHORT_S = 3.0
# Notes the runs in which the card was hidden; the runs are short.
WATCH = """
window.cardless = [];
crgame.store.on('status', ({ run, epoch }) => requestAnimationFrame(() => {
  if (run === 'running' && document.querySelector('#outcome').hidden) {
    cardless.push(epoch);
  }
}));
"""
WITHOUT_CARD = 'window.cardless.some((epoch) => epoch > arguments[0])'


def write_games(folder: Path) -> Path:
    """Write the first game, one in which the AV hits the human's car, and one of only traffic."""
    games: dict[str, dict[str, Any]] = {
        'first': {'scenario': f'{CUT_IN}.xml', 'humans': [{'id': 'hv0', 'driver': 'idle'}]},
        'crash': {
            'title': 'A crash', 'scenario': f'{CUT_IN}.xml', 'duration': SHORT_S,
            'humans': [{'id': 'hv0', 'driver': 'idle', 'spawn': {
                'x': 60.0, 'y': 0.0, 'yaw': 0.0, 'speed': 0.0}}],
            'avs': [{'id': 'av0', 'planning_problem': 100, 'planner': 'constant-velocity'}]},
        'alone': {
            'title': 'Alone', 'scenario': f'{TRAFFIC}.xml', 'duration': SHORT_S,
            'humans': [], 'avs': [], 'traffic': {'agents': 8}}}
    for scenario in (CUT_IN, TRAFFIC):
        shutil.copy(SCENARIOS / f'{scenario}.xml', folder)
    for name, game in games.items():
        (folder / f'{name}.yaml').write_text(yaml.safe_dump(game))
    return folder / 'first.yaml'


@pytest.fixture(scope='module')
def graph(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Graph]:
    """Keep one graph, whose first game would go on for ten minutes."""
    folder = tmp_path_factory.mktemp('outcome')
    with live_graph(write_games(folder), folder / 'run', '--duration', '600') as running:
        yield running


@pytest.fixture(scope='module')
def page(graph: Graph, module_browser: Browser) -> LivePage:
    """Open the page once; the tests are one session, in their order."""
    return LivePage(graph, module_browser)


def start(page: LivePage, name: str) -> None:
    """Choose a game in the panel and start it."""
    epoch = page.run('return crgame.store.status.epoch')
    page.click(f'button.scenario[title="{name}"]')
    page.wait('document.querySelector("button.scenario[aria-checked=true]")?.title'
              ' === arguments[0]', 'the choice', name)
    page.click('.start-area button.primary')
    page.wait('crgame.store.status.epoch > arguments[0]', 'the next run', epoch)


def wait_for_card(page: LivePage) -> str:
    """Wait until the run is over and its files are written; return the card's text."""
    page.wait_for_run('ended')
    page.wait('document.querySelector(".outcome-files[data-complete]")', 'the files of the run')
    return page.text('#outcome')


def folder_on_card(page: LivePage) -> Path:
    """Return the folder that the card names."""
    return Path(page.text('.outcome-files code'))


def test_a_run_is_over_at_its_own_duration_and_says_how_it_went(page: LivePage) -> None:
    """The card has the crash at the time given by the gap; no alarm stays, no node ends."""
    page.tab('scenario')
    start(page, 'crash.yaml')
    text = wait_for_card(page)
    assert page.run('return crgame.store.status.t') == SHORT_S
    assert 'The run is over' in text and f'Its duration of {SHORT_S:.1f} s is over' in text
    setup = build_setup(load_game(page.graph.launcher.out.parent / 'crash.yaml'))
    human, av = setup.humans[0].state, setup.avs[0].state
    gap = math.dist((human.x, human.y), (av.x, av.y)) - setup.avs[0].vehicle.shape.length
    (told,) = re.findall(r'hv0 with av0 at ([0-9.]+) s|av0 with hv0 at ([0-9.]+) s', text)
    # The page rounds to 0.1 s and learns of it within the next 0.1 s.
    assert float(told[0] or told[1]) == pytest.approx(gap / av.speed, abs=0.3)
    # The report names each vehicle's part, as for offline runs.
    assert '(front of av0; could have avoided it: av0)' in text
    # As many as were in time: their number depends on the machine.
    accepted = int(re.search(r'(\d+) plans accepted', text)[1])
    report = json.loads((page.graph.launcher.out / 'run_2' / 'timing.json').read_text())
    assert 0 < accepted == report['planners']['av0']['accepted'] <= 10 * SHORT_S
    assert {'Mean step error', 'Largest lag', 'Precision ratio'} <= set(page.run(
        'return [...document.querySelectorAll("#outcome dt")].map((node) => node.textContent)'))
    assert folder_on_card(page) == Path('run/run_2')
    page.wait('crgame.store.alarms.length === 0', 'the alarms of a busy machine to go')
    assert page.text('#recording').startswith('Recorded')
    assert page.text('.clock-state') == 'Ended'
    assert page.browser.console_errors() == []


def test_the_card_has_score_links_and_the_last_seconds(page: LivePage) -> None:
    """The score is that of `crgame score`, the files are the run's, the end can be replayed."""
    page.wait('document.querySelector(".score[data-state=told]")', 'the score')
    folder = page.graph.launcher.out / 'run_2'
    expected = scores_of(read_run_record(folder / 'bag'), {}, drives_only=True)
    told = page.run("""return [...document.querySelectorAll('.score-vehicle')].map((node) => [
        node.dataset.vehicle, node.querySelector('.score-points').textContent]);""")
    assert told == [[each.vehicle_id, f'{100 * each.nuplan.score:.0f}']
                    for each in expected.vehicles if each.nuplan is not None]
    sizes = page.run_async("""const found = {};
        for (const link of document.querySelectorAll('.outcome-files a[download]')) {
          const answer = await fetch(link.href);
          found[link.textContent] = [answer.status, (await answer.arrayBuffer()).byteLength];
        }
        return found;""")
    (scenario,) = folder.glob('*.xml')
    for path in (scenario, folder / 'game.yaml', folder / 'timing.json'):
        assert sizes[path.name] == [200, path.stat().st_size]
    assert sizes['Everything as ZIP'][1] > (folder / 'bag' / 'bag_0.mcap').stat().st_size
    # Noted frame by frame: the replay goes on meanwhile.
    page.run("""window.past = new Promise((done) => {
        const look = () => (crgame.lastSeconds.isOpen && crgame.world.shown.t < 2
          && !document.querySelector('#outcome').checkVisibility()
          ? done() : requestAnimationFrame(look));
        look(); });""")
    page.click('#outcome [data-action=look]')
    page.run_async('await window.past;')
    page.click('#last-seconds [data-action=end]')
    page.wait('crgame.world.shown.t === crgame.store.latest.t')


@pytest.mark.exhaustive
def test_runs_are_listed_replayed_compared_and_deleted(page: LivePage) -> None:
    """The previous run is replayed in another tab and deleted; the last one stays."""
    out = page.graph.launcher.out
    page.tab('runs')
    page.wait('document.querySelectorAll(".run").length === 2'
              ' && [...document.querySelectorAll("img.run-picture")].every('
              '(image) => image.complete && image.naturalWidth > 0)', 'pictures of two runs')
    keys = page.run('return [...document.querySelectorAll(".run")].map((n) => n.dataset.run)')
    assert page.run('return [...document.querySelectorAll(".run")].map((n) => n.dataset.name)'
                    ) == ['run/run_2', 'run']
    for key in keys:
        page.click(f'[data-run="{key}"] input[type=checkbox]')
    page.wait_for_text('#panel-runs button.wide', 'Compare 2 runs')
    page.run('window.open = (address) => { window.opened = address; };')
    page.click('#panel-runs button.wide')
    status, text = page.run_async("""const answer = await fetch(window.opened);
        return [answer.status, await answer.text()];""")
    assert status == 200 and 'run/run_2' in text
    own = page.driver.current_window_handle
    page.driver.switch_to.new_window('tab')
    try:
        page.browser.open(f'{page.graph.address}replay/{keys[0]}/')
        page.wait('window.crgame?.ready && crgame.store.mode === "replay" && crgame.world.shown'
                  ' && crgame.store.scene.title === "A crash"', 'the replay')
    finally:
        page.driver.close()
        page.driver.switch_to.window(own)
    # The first run is complete only after the end of another one.
    page.wait('!document.querySelector(`[data-run="${arguments[0]}"] [data-action=delete]`)'
              '.disabled || (crgame.runs.refresh(), false)', 'the first run to be finished',
              keys[1])
    page.click(f'[data-run="{keys[1]}"] [data-action=delete]')
    page.click('dialog.confirm[open] .danger')
    page.wait('document.querySelectorAll(".run").length === 1', 'one run')
    assert (out / 'run_2' / 'bag').is_dir() and (out / 'cockpit').is_dir()
    assert not (out / 'bag').exists() and not (out / 'game.yaml').exists()
    assert page.browser.console_errors() == []


@pytest.mark.exhaustive
def test_again_another_and_the_next_game(page: LivePage) -> None:
    """The same game runs again, then only traffic; each run hides the card."""
    page.run(WATCH)
    epoch = page.run('return crgame.store.status.epoch')
    page.click('#outcome [data-action=again]')
    page.wait(WITHOUT_CARD, 'the run, without the card', epoch)
    wait_for_card(page)
    assert folder_on_card(page).name == 'run_3'
    page.click('#outcome [data-action=close]')
    page.click('#outcome [data-action=reopen]')
    page.tab('drive')
    page.click('#outcome [data-action=another]')
    start(page, 'alone.yaml')
    page.wait('crgame.world.shown.epoch === crgame.store.status.epoch'
              ' && crgame.world.shown.objects.length > 0', 'agents of traffic')
    assert 'only traffic' in page.text('#panel-drive')
    assert 'traffic was alone' in wait_for_card(page)
    assert folder_on_card(page).name == 'run_4'
    epoch = page.run('return crgame.store.status.epoch')
    page.click('#outcome [data-action=next]')
    page.wait(f'{WITHOUT_CARD} && crgame.store.scene.title === "A crash"',
              'the game after the last of the list', epoch)
    wait_for_card(page)
    assert folder_on_card(page).name == 'run_5'
    # An alarm stays visible for some seconds.
    page.wait('crgame.alarms.kinds().length === 0', 'the alarms of the run to go')
    assert page.browser.console_errors() == []


def test_the_end_of_the_program_is_no_alarm(page: LivePage) -> None:
    """When the program is ended at the terminal, the page keeps the last state and says so."""
    launcher = page.graph.launcher
    launcher.signal(signal.SIGINT)
    page.wait_for_text('#outcome', 'program has ended')
    assert page.run('return [crgame.alarms.kinds(), crgame.driving.seat]') == [[], None]
    assert page.text('.clock-state') == 'Ended'
    assert page.run('return document.querySelector("#outcome [data-action=again]").disabled')
    assert launcher.wait() == 0, launcher.text


@pytest.mark.exhaustive
def test_each_run_has_its_own_files(graph: Graph) -> None:
    """Each run has its own bag, scenario, timing report and game, and no file of another."""
    folders = run_folders(graph.launcher.out)
    assert [folder.name for folder in folders] == ['run', 'run_2', 'run_3', 'run_4', 'run_5']
    # The first one was deleted.
    folders = folders[1:]
    schema = etree.XMLSchema(etree.parse(str(SCHEMA)))
    for folder, scenario in zip(folders, (CUT_IN, CUT_IN, TRAFFIC, CUT_IN), strict=True):
        game = load_game(folder / 'game.yaml')
        assert game.scenario.name == f'{scenario}.xml'
        (xml,) = folder.glob('*.xml')
        root = etree.parse(str(xml))
        schema.assertValid(root)
        assert root.getroot().get('benchmarkID').removeprefix('C-') == scenario
        driven = len(game.humans) + len(game.avs or ())
        assert len(root.findall('planningProblem')) == max(1, driven)
        contacts = json.loads((folder / 'timing.json').read_text())['contacts']
        assert [(item['vehicle'], item['with'], item['kind']) for item in contacts] == [
            ('av0', 'hv0', 'stopped track')] * (scenario == CUT_IN)
        assert not (folder / '.finished').exists()
        with BagReader(folder / 'bag') as reader:
            assert reader.complete
            last = max(item.message.header.stamp.sec for item in reader.decoded(
                ['/vehicles/state']))
            first = min(item.message.header.stamp.sec for item in reader.decoded(
                ['/vehicles/state']))
        assert last - first <= SHORT_S
