# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Markers out of a run's messages: each once, at the time of what happened."""

from dataclasses import replace

from crgame_ros.errors import InputError
from crgame_ros.game.documents import FiredEvents, RunState
from crgame_ros.game.events import FiredEvent
from crgame_ros.game.game import Game
from crgame_ros.game.instruments_spec import InstrumentsSpec, MARKER_KINDS
from crgame_ros.game.seat_documents import DrivingSpell, DrivingSpells
from crgame_ros.game.task_documents import PageTimes, TaskEntry, TaskLog
from crgame_ros.instruments.markers import Marker, RunMarkers
from crgame_ros.messages.status_values import OK, Status
from crgame_ros.schema.reading import read
import pytest
import yaml


def test_what_repeats_is_told_once() -> None:
    """Documents hold everything since the start, and those of another run are none of this."""
    run = RunMarkers(2)
    assert run.begun(1) == [Marker('trial/begin/2', 1)]
    assert run.begun(2) == []
    slow = FiredEvent('slow/er', 300, 30, 'trigger')
    fast = FiredEvent('fast', 400, 40, 'condition')
    assert run.of_events(FiredEvents(2, (slow,))) == [Marker('event/slow_er/trigger', 300)]
    assert run.of_events(FiredEvents(2, (slow, fast))) == [Marker('event/fast/condition', 400)]
    assert run.of_events(FiredEvents(1, (slow, fast, fast))) == []
    states = [RunState('', 2, name)
              for name in ('running', 'paused', 'paused', 'running', 'ended')]
    assert [marker.text for state in states for marker in run.of_state(state)] \
        == ['trial/pause/2', 'trial/resume/2', 'trial/end/2']


def test_an_answer_is_when_the_page_has_timed_it() -> None:
    """The message comes later: from the onset, picture and answer are told by the page."""
    run = RunMarkers(0)
    entries = (
        TaskEntry(500, 'drt', 'detection_response', 'hv0', 'stimulus', 1),
        TaskEntry(504, 'drt', 'detection_response', 'hv0', 'shown', 1,
                  times=PageTimes(delay_ms=20.0)),
        TaskEntry(560, 'drt', 'detection_response', 'hv0', 'answer', 1, 'hit',
                  PageTimes(response_ms=450.0, delay_ms=20.0)),
        TaskEntry(700, 'handover', 'take_over', 'av0', 'request', 1))
    assert run.of_tasks(TaskLog(0, entries)) == [
        Marker('stimulus/drt/hv0/1', 500), Marker('shown/drt/hv0/1', 500, 0.02),
        Marker('answer/drt/hv0/1/hit', 500, pytest.approx(0.47)),
        Marker('take_over/request/handover/av0/1', 700)]


def test_take_overs_and_contacts() -> None:
    """A seat that changes its driver, and a contact when it begins."""
    run = RunMarkers(0)
    alone = DrivingSpell('av0', 'planner', 'planner', None, 0, 800)
    taken = DrivingSpell('av0', 'cockpit', 'planner', None, 800, 900)
    back = DrivingSpell('av0', 'planner', 'planner', None, 900)
    assert run.of_drivers(DrivingSpells(0, (alone,))) == []
    assert run.of_drivers(DrivingSpells(0, (alone, taken))) == [
        Marker('take_over/driven/av0/cockpit', 800)]
    assert run.of_drivers(DrivingSpells(0, (alone, taken, back))) == [
        Marker('take_over/back/av0/planner', 900)]
    for hit, told in (('av0', 1), ('av0,o7', 1), ('', 0), ('av0', 1)):
        status = Status.of('hv0/drivability', OK, '', {'hit': hit, 'n': 12})
        assert len(run.of_drivability(status)) == told


def _spec(text: str) -> InstrumentsSpec:
    found: InstrumentsSpec = read(InstrumentsSpec, yaml.safe_load(text), 'instruments')
    return found


def test_the_longest_words_choose_the_byte() -> None:
    """Each kind of marker may have one, and those with more words another."""
    spec = _spec('triggers: {port: /dev/ttyUSB0, codes: {stimulus: 1, stimulus/drt/hv0: 2}}')
    assert spec.triggers is not None
    assert [spec.triggers.code_of(text) for text in (
        'stimulus/drt/hv0/3', 'stimulus/drt/hv01/3', 'event/stimulus')] == [2, 1, None]
    assert 'instruments' in Game.__dataclass_fields__
    assert len(set(MARKER_KINDS)) == len(MARKER_KINDS)


@pytest.mark.parametrize(('text', 'said'), [
    ('inlets: [{}]', 'names no stream'),
    ('inlets: ["a\'b"]', 'without quotes'),
    ('triggers: {codes: {stimulus: 1}}', 'give either port or address'),
    ('triggers: {port: /dev/a, address: "b:1", codes: {stimulus: 1}}', 'two lines'),
    ('triggers: {port: COM1, codes: {stimulus: 1}}', 'name a device'),
    ('triggers: {address: "b:99999", codes: {stimulus: 1}}', '1 to 65535'),
    ('triggers: {port: /dev/a, codes: {stimulus: 256}}', 'from 1 to 255'),
    ('triggers: {port: /dev/a, codes: {stimulus: true}}', 'from 1 to 255'),
    ('triggers: {port: /dev/a, codes: {gaze: 1}}', 'begin with one of'),
    ('triggers: {port: /dev/a, codes: {}}', '"codes" is empty'),
    ('gaze: [{x: x}]', 'stream'),
    ('gaze: [Eyes, {stream: Eyes, seat: av0}]', 'Eyes'),
    ('gaze: [{stream: Eyes, unit: cm}]', 'pixels, screen, view'),
    ('gaze: [{stream: Eyes, margin: -1}]', 'margin'),
    ('scope: world', 'machine, network')])
def test_what_cannot_be_meant_is_refused(text: str, said: str) -> None:
    with pytest.raises(InputError, match=said):
        _spec(text)


def test_the_query_finds_what_has_all_that_is_given() -> None:
    spec = _spec('inlets: [Gaze, {type: ECG, source_id: a1}]')
    assert [inlet.predicate() for inlet in spec.inlets] == [
        "name='Gaze'", "type='ECG' and source_id='a1'"]


def test_a_page_that_knows_the_clock_places_its_marker_itself() -> None:
    """The picture at 1000.5 s of the steady clock, the answer 0.4 s and a pause of 1 s later."""
    run = RunMarkers(0)
    shown = PageTimes(delay_ms=40.0, steady_s=1000.5, clock_error_ms=0.2)
    answer = replace(shown, response_ms=400.0, paused_ms=1000.0)
    found = run.of_tasks(TaskLog(0, (
        TaskEntry(100, 'drt', 'detection_response', 'hv0', 'stimulus', 1),
        TaskEntry(105, 'drt', 'detection_response', 'hv0', 'shown', 1, '', shown),
        TaskEntry(250, 'drt', 'detection_response', 'hv0', 'answer', 1, 'hit', answer))))
    assert [(each.text, each.steady_s) for each in found] == [
        ('stimulus/drt/hv0/1', None), ('shown/drt/hv0/1', 1000.5),
        ('answer/drt/hv0/1/hit', 1001.9)]


def test_a_study_names_its_trials_and_markers() -> None:
    """A slash in an item's name would make two words of it."""
    run = RunMarkers(0)
    told = Status.of('study_node: trial', 0, 'text', {
        'item': 'main/2', 'condition': 'idm/dense', 'attempt': 1})
    assert run.of_study(told) == [Marker('trial/main_2/idm_dense/1')]
    assert run.of_study(Status.of('study_node: marker', 0, 'brakes late', {})) == [
        Marker('marker/brakes late')]
    assert run.of_study(Status.of('study_node: note', 0, 'private', {})) == []
