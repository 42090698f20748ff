# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The report's page: its content, and that foreign text in it cannot run."""

import base64
from copy import copy
from dataclasses import replace
import hashlib
import json
from pathlib import Path
import re
from typing import Any

from crgame_ros.analysis.behaviour.measures import MEASURES
from crgame_ros.analysis.criticality.criticality import CHIEF
from crgame_ros.analysis.report.driving_section import driving_section
from crgame_ros.analysis.report.file import report_html
from crgame_ros.analysis.report.planners_section import planners_section
from crgame_ros.analysis.runs.run import Run
from crgame_ros.analysis.scores.scored_run import RunScores, scores_of
from crgame_ros.analysis.scores.vehicle import SCORE_MEASURES as MEASURES_OF_SCORES
import numpy as np
from page_reader import Page
import pytest


@pytest.fixture(scope='module')
def html(run: Run) -> str:
    """Write the page of the run."""
    return report_html([run])


@pytest.fixture(scope='module')
def page(html: str) -> Page:
    """Parse the page."""
    return Page(html)


def test_foreign_text_is_text(page: Page) -> None:
    """Title, folder, refusal, violation and notice, as they were written."""
    title = '</title><script>alert(1)</script> "quoted" \'too\' 🚗 ⟨U+202E⟩esrever & <b>bold</b>'
    assert page.text_of('h1') == [title] and page.text_of('title') == [f'{title} – report']
    texts = [text for _, text in page.texts]
    for text in ('a <b>run</b>', '<img src=x onerror=alert(2)>', 'off the <i>road</i>',
                 '<script>alert(3)</script>'):
        assert text in texts
    assert len(page.attributes('script')) == 3 and page.attributes('i') == []
    assert not any(name.startswith('on') or name in ('style', 'srcdoc', 'action')
                   for _, found in page.elements for name in found)


def test_only_its_own_scripts_and_styles_may_run(page: Page) -> None:
    """The hashes in the policy are those of its scripts and styles; it loads nothing else."""
    policy = next(found['content'] for found in page.attributes('meta')
                  if found.get('http-equiv') == 'Content-Security-Policy') or ''
    rules = dict(rule.split(' ', 1) for rule in policy.split('; '))
    assert rules['default-src'] == rules['base-uri'] == rules['form-action'] == "'none'"
    assert rules['img-src'] == 'data:'
    scripts, styles = page.text_of('script'), page.text_of('style')
    hashes = {kind: [_hash(text) for text in texts] for kind, texts in (
        ('script-src', scripts[1:]), ('style-src', [*styles, '']))}
    assert {kind: rules[kind].split() for kind in hashes} == hashes
    assert sum('plotly.js (basic' in text for text in scripts) == 1
    for tag in ('img', 'link', 'script', 'iframe', 'object'):
        for found in page.attributes(tag):
            address = found.get('src') or found.get('href') or 'data:'
            assert address.startswith('data:')


def _hash(text: str) -> str:
    return f"'sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}'"


def changed(run: Run, **values: Any) -> Run:
    """Return a copy of a run for which other values are known."""
    other = copy(run)
    other.__dict__.update(values)
    return other


def test_every_time_leads_to_its_frame(page: Page, run: Run) -> None:
    """Links of the page have targets; each worst value's frame is within a second."""
    ids = [found['id'] for _, found in page.elements if 'id' in found]
    assert len(ids) == len(set(ids))
    links = page.attributes('a')
    assert all((link['href'] or '').removeprefix('#') in ids for link in links)
    times = {found['id']: float(found['data-time'] or '') for found in page.attributes('figure')
             if found['class'] == 'frame'}
    led = [link for link in links if 'data-time' in link]
    for link in led:
        shown = times[(link['href'] or '')[1:]]
        assert abs(shown - float(link['data-time'] or '')) <= 1.0 + 1e-6
    worst = [each for vehicle in run.usual_criticality.report() for each in vehicle.worst.values()
             if each.value < 100.0]
    assert len(led) >= len(worst)
    for each in worst:
        assert any(abs(time - each.time_s) <= 1.0 + 1e-6 for time in times.values())


def test_tables_say_what_was_measured(page: Page, run: Run) -> None:
    """Worst values to two digits, counts of plans, table I."""
    cells = [text.strip() for path, text in page.texts if 'td' in path]
    for vehicle in run.usual_criticality.report():
        for name in ('gap', 'thw', 'min_distance'):
            if name in vehicle.worst:
                assert f'{vehicle.worst[name].value:.2f}' in cells
    assert {'20', '17', '85.0 %', '9.2', '0.2500'} <= set(cells)
    captions = page.text_of('caption')
    assert 'Timing (table I of the CommonRoad-Game paper)' in captions
    assert all(found.get('scope') in ('col', 'row') for found in page.attributes('th'))
    assert all(found['alt'] for found in page.attributes('img'))


def test_plots_hold_the_series(page: Page, run: Run) -> None:
    """Each plot of the page has its data, which are those of the run, with thresholds."""
    data = json.loads(page.text_of('script')[0])
    places = [found['id'] for found in page.attributes('div') if found.get('class') == 'plot']
    assert sorted(data) == sorted(map(str, places)) and len(places) > 10
    speed = data['run1-motion-speed']['lines'][0]
    np.testing.assert_array_equal(_numbers(speed['y']), run.log.vehicle_states[:, 0, 3])
    gap = data['run1-criticality-gap']['lines'][1]
    worst = run.usual_criticality.report()[1].worst['gap'].value
    assert np.nanmin(_numbers(gap['y'])) == worst
    assert [limit['value'] for limit in data['run1-criticality-drac']['limits']] == [3.0]
    throttle = data['run1-inputs-throttle']['lines'][0]
    assert throttle['name'] == 'hv0' and len(_numbers(throttle['y'])) == 1000


def _numbers(text: str) -> np.ndarray:
    return np.frombuffer(base64.b64decode(text), '<f8')


def test_the_course_agrees_with_the_worst(run: Run) -> None:
    """The plotted line of a measure has its worst value at its time."""
    for i, vehicle in enumerate(run.usual_criticality.report()):
        for name in CHIEF:
            known = vehicle.worst.get(name)
            values = run.course[name][i]
            assert np.isfinite(values).any() == (known is not None)
            if known is not None:
                extreme = np.nanmax(values) if name == 'drac' else np.nanmin(values)
                assert extreme == known.value
                row = np.flatnonzero(values == extreme)[0]
                assert run.times_s[row] == pytest.approx(known.time_s)


def test_the_same_run_gives_the_same_bytes(run: Run, html: str) -> None:
    """The page has no time of writing."""
    assert report_html([run]) == html


def test_reverse_and_take_overs_stand_out(run: Run) -> None:
    """Their times are known by hand: the human in reverse, a driver in the AV's seat."""
    commands = run.record.commands.copy()
    commands[100:200, 0, 3] = 1.0
    commands[300:450, 1] = 0.25
    driven = changed(run, record=replace(run.record, commands=commands))
    page = Page(report_html([driven]))
    spans = json.loads(page.text_of('script')[0])['run1-inputs-brake']['spans']
    found = [(span['label'], span['from'], span['to']) for span in spans]
    assert found == [('hv0 in reverse', pytest.approx(1.01), pytest.approx(2.0)),
                     ('av0 taken over', pytest.approx(3.01), pytest.approx(4.5))]
    assert 'av0 taken over' in [text for path, text in page.texts if 'th' in path]


def test_late_steps_are_told_by_their_causes(page: Page, run: Run) -> None:
    """It has each cause with its time, the worst in words; or that there are none or unknown."""
    cells = [text for path, text in page.texts
             if path and path[-1] in ('td', 'th', 'bdi', 'caption')]
    assert '2 steps were late by more than 0.5 ms' in cells
    place = cells.index('garbage collection')
    assert cells[place:place + 4] == ['garbage collection', '310.0', '1', '1']
    assert 'own work' not in cells
    assert '310.0 ms late, <b>they</b> said' in cells
    assert run.timing is not None
    for late, words in ((None, 'an earlier version made it'),
                        ({'count': 0, 'threshold_ms': 0.5}, 'No step was late')):
        other = changed(run, _timed=({**run.timing, 'late_steps': late}, ()))
        notes = Page(report_html([other])).text_of('p')
        assert any(words in text for text in notes)


def test_what_people_in_the_seats_heard_is_told(run: Run) -> None:
    assert run.timing is not None
    sound = {'hv0': {'on_share': 0.75, 'volume': 0.8, 'rumble': 0.5},
             'av0': {'on_share': 0.0, 'volume': None, 'rumble': 0.0}}
    for told, row in ((sound, ['hv0', ' on for 75 % of the time, volume 80 %, rumble 50 %; ',
                               'av0', ' off, rumble 0 %']), ({}, [])):
        page = Page(report_html([changed(run, _timed=({**run.timing, 'sound': told}, ()))]))
        texts = [text for _, text in page.texts]
        assert ('sound' in texts) == bool(told)
        if told:
            place = texts.index('sound')
            assert ''.join(texts[place + 1:place + 5]).split() == ''.join(row).split()


def test_what_people_in_the_seats_saw_is_told(run: Run) -> None:
    assert run.timing is not None
    period = {'from_s': 0.0, 'to_s': 4.0, 'shown': 'map', 'inset': False, 'plans': True,
              'across_deg': None, 'screen_width_m': None, 'eye_distance_m': None,
              'rate_hz': None, 'renderer': '', 'software': False}
    driver = period | {
        'from_s': 4.0, 'to_s': 9.5, 'shown': 'driver', 'inset': True, 'plans': False,
        'across_deg': 75.2, 'screen_width_m': 0.6, 'eye_distance_m': 0.7, 'rate_hz': 29.7,
        'renderer': '<b>SwiftShader', 'software': True}
    words = ['hv0 map from 0.0 to 4.0 s, with the plans of AVs; hv0 driver from 4.0 to 9.5 s, '
             '75° across, true to scale on a screen of 0.60 m, 0.70 m from the eyes, with the '
             'small map, 30 pictures/s, drawn by the processor (<b>SwiftShader)']
    page = Page(report_html([changed(run, _timed=({
        **run.timing, 'view': {'hv0': [period, driver]}}, ()))]))
    texts = [text for _, text in page.texts]
    place = texts.index('view')
    assert ''.join(texts[place + 1:place + 7]).split() == ''.join(words).split()


def test_what_a_recording_does_not_tell_is_left_out(run: Run) -> None:
    """Without cycles there are no inputs and no timing, and the page says so."""
    bare = changed(run, _timed=(None, ()), outcome=None, bag=Path('bag'), began_ns=None,
                   record=replace(run.record, ns=run.record.ns[:0],
                                  commands=run.record.commands[:0]))
    page = Page(report_html([bare]))
    assert 'The recording does not tell of its cycles.' in [text for _, text in page.texts]
    assert 'Driver inputs' not in page.text_of('h2')


def test_several_runs_stand_side_by_side(run: Run) -> None:
    """A column each, plots with a letter for each, and no address twice."""
    other = changed(run, name='another')
    page = Page(report_html([run, other]))
    ids = [found['id'] for _, found in page.elements if 'id' in found]
    assert len(ids) == len(set(ids))
    heads = [text for path, text in page.texts if path[-2:] == ('tr', 'th') or 'thead' in path]
    assert any(text.startswith('A: ') for text in heads)
    assert any(text.startswith('B: ') for text in heads)
    data = json.loads(page.text_of('script')[0])
    assert [line['name'] for line in data['all-comparison-speed']['lines']] == [
        'A hv0', 'A av0', 'B hv0', 'B av0']
    assert re.findall(r'run2-story', ' '.join(map(str, ids)))
    assert sum('plotly.js (basic' in text for text in page.text_of('script')) == 1


def test_how_people_drove_is_told_with_its_variants(page: Page, run: Run) -> None:
    """It has the human's values and the measures' definitions; the undriven AV has none."""
    human, av = run.usual_behaviour
    texts = [text for _, text in page.texts]
    assert 'How people drove' in page.text_of('h2')
    place = texts.index('Deviation of lateral position (SDLP)')
    assert texts[place + 1:place + 3] == ['m', f'{human.values["sdlp"]:.2f}']
    titles = [each.get('title') or '' for each in page.attributes('span')]
    assert any(title.startswith(MEASURES['sdlp'].definition) and 'N - 1' in title
               for title in titles)
    section = driving_section(run)
    assert section is not None and [line.name for line in section.plots[0].lines] == ['hv0']
    assert not av.human


def _rows(page: Page, caption: str) -> dict[str, list[str]]:
    """Return the non-empty cells of a table, by the names of its rows."""
    rows: dict[str, list[str]] = {}
    inside, name = False, ''
    for path, text in page.texts:
        if 'caption' in path:
            inside = text == caption
        elif inside and 'tbody' in path and 'th' in path:
            name, rows[text] = text, []
        elif inside and 'tbody' in path and 'td' in path:
            rows[name].append(text)
    return rows


def test_how_planners_drove_is_told_in_numbers(page: Page, run: Run) -> None:
    """The AV first, the human beside it, as the scores have them; why it is not valid."""
    human, av = run.usual_scores.vehicles
    assert (human.role, av.planner) == ('human', 'idm')
    assert 'How planners drove' in page.text_of('h2')
    rows = _rows(page, 'How planners drove')
    assert av.nuplan is not None and human.nuplan is not None
    assert rows['nuPlan score, of 1'] == [f'{av.nuplan.score:.3f}', f'{human.nuplan.score:.3f}']
    for place, each in enumerate((av, human)):
        assert each.commonroad is not None and each.goal is not None
        values = {name: cells[-2:][place] for name, cells in rows.items()}
        for cost in each.commonroad.costs:
            assert values[f'CommonRoad cost {cost.name}'] == f'{cost.total:.4g}'
        assert values['Feasible'] == ('yes' if each.commonroad.feasibility.feasible else 'no')
        assert values['Distance to the goal at the end'] == f'{each.goal.last_distance:.1f}'
    # 17 accepted, 3 of them braking, of 20.
    assert rows['Plans accepted that are no braking plans'] == ['0.700', '–']
    texts = ' '.join(text for _, text in page.texts)
    assert 'fails goal_reached' in texts and 'free drive at the speed limit' in texts
    # Ages were not measured: there is no row of dashes.
    assert 'Age of the plan in use, median' not in rows
    titles = [each.get('title') or '' for each in page.attributes('span')]
    assert any(title.startswith(MEASURES_OF_SCORES['SM1'].definition) for title in titles)


def test_at_the_end_of_a_run_what_takes_long_is_left_out(run: Run) -> None:
    """No cost, no check; the page names the command that adds them. Without scores it says why."""
    quick = changed(run, usual_scores=scores_of(run.record, {}, drives_only=True))
    section = planners_section(quick)
    assert section is not None and 'crgame report</code> adds them' in section.html
    rows = _rows(Page(section.html), 'How planners drove')
    assert 'nuPlan score, of 1' in rows and 'Feasible' not in rows
    assert not any(name.startswith('CommonRoad') for name in rows)
    av = run.usual_scores.vehicles[1]
    assert av.commonroad is not None
    costs = tuple(replace(cost, total=None, reason='no <i>lane</i>')
                  for cost in av.commonroad.costs)
    lost = replace(av, commonroad=replace(av.commonroad, costs=costs))
    without = planners_section(changed(run, usual_scores=RunScores((lost,))))
    assert without is not None and 'TR1: <bdi>no &lt;i&gt;lane&lt;/i&gt;</bdi>' in without.html
    refused = planners_section(changed(run, usual_scores=RunScores((), 'the run: <b>no</b> step')))
    assert refused is not None and '&lt;b&gt;no&lt;/b&gt; step' in refused.html


def test_planners_of_several_runs_stand_side_by_side(run: Run) -> None:
    """A column for the AV of each run, with its letter."""
    page = Page(report_html([run, changed(run, name='another')]))
    rows = _rows(page, 'How planners drove, the runs side by side')
    score = run.usual_scores.vehicles[1].nuplan
    assert score is not None and rows['nuPlan score, of 1'] == [f'{score.score:.3f}'] * 2
    heads = [text for path, text in page.texts if 'thead' in path]
    assert 'A: ' in heads and 'B: ' in heads
