# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The list `events` of game files: every key, every refusal, written and read again."""

import json
from pathlib import Path

from crgame_ros.errors import InputError
from crgame_ros.game.documents import document_entry, EventEntries
from crgame_ros.game.events import (
    ACTIONS,
    AtStep,
    AtTime,
    Between,
    Brake,
    EventList,
    EventSpec,
    MAX_EVENTS,
    Near,
    PlanDisplay,
    PlannerRun,
    PlannerSwap,
    PutObstacle,
    Release,
    SpeedLimit,
    TrafficChange,
)
from crgame_ros.game.game import load_game
from crgame_ros.schema.reading import read
import pytest
import yaml

EVENTS = """\
scenario: map/road.xml
events:
  - name: pedestrian
    label: Release the pedestrian
    release: {object: 42}
    when: {time: 5}
  - name: leader_brakes
    brake: {object: 43}
    when: {between: [hv0, o42], distance: 20.0}
  - name: roadworks-2
    obstacle: {x: 1.0, y: 2.0, yaw: 0.5, length: 3.0, width: 0.5, type: parkedVehicle}
    when: {vehicle: hv0, x: 1.0, y: -2.0, radius: 30.0}
  - name: slow
    speed_limit: {speed: 8.3, lanelets: [3, 4]}
  - name: slow-everywhere
    speed_limit: {speed: 8.3}
  - name: blank
    plan_display: {av: av0, show: false}
  - name: swap
    planner: {av: av0, planner: own.py:Mine, options: {v0: 9.0}}
  - name: silence
    planner_run: {av: av0, run: false}
    when: {step: 77}
  - name: hurry
    traffic: {agent: t3, speed_factor: 1.3, options: {time_gap: 0.8}, politeness: 0,
              lane_changes: true, reaction_time: 0.5, imperfection: 0.1, red_runner: true,
              late_yielder: false}
  - name: crawl
    traffic: {agent: all, desired_speed: 3}
"""


def event(text: str, folder: Path = Path()) -> EventSpec:
    """Read one event from the flow form of its entry."""
    (found,) = read(EventList, [yaml.safe_load(text)], 'game.yaml: events', folder)
    return found


def test_every_key(tmp_path: Path) -> None:
    """Each value is read into its field; a planner's file is relative to the game file."""
    path = tmp_path / 'game.yaml'
    path.write_text(EVENTS)
    assert load_game(path).events == (
        EventSpec('pedestrian', Release(42), 'Release the pedestrian', AtTime(5.0)),
        EventSpec('leader_brakes', Brake(43, 4.0, 0.0), 'leader_brakes',
                  Between(('hv0', 'o42'), 20.0)),
        EventSpec('roadworks-2', PutObstacle(1.0, 2.0, 0.5, 3.0, 0.5, 'parkedVehicle'),
                  'roadworks-2', Near('hv0', 1.0, -2.0, 30.0)),
        EventSpec('slow', SpeedLimit(8.3, (3, 4)), 'slow'),
        EventSpec('slow-everywhere', SpeedLimit(8.3), 'slow-everywhere'),
        EventSpec('blank', PlanDisplay('av0', False), 'blank'),
        EventSpec('swap', PlannerSwap('av0', f'{tmp_path}/own.py:Mine', {'v0': 9.0}), 'swap'),
        EventSpec('silence', PlannerRun('av0', False), 'silence', AtStep(77)),
        EventSpec('hurry', TrafficChange('t3', 1.3, None, {'time_gap': 0.8}, 0.0, True, 0.5, 0.1,
                                         True, False), 'hurry'),
        EventSpec('crawl', TrafficChange('all', desired_speed=3.0), 'crawl'))


def test_dumped_game_has_the_same_events(tmp_path: Path) -> None:
    """`game.yaml` of a run's folder gives the same events from any folder."""
    path, again = tmp_path / 'game.yaml', tmp_path / 'elsewhere' / 'game.yaml'
    path.write_text(EVENTS)
    again.parent.mkdir()
    again.write_text(load_game(path).dump())
    assert load_game(again).events == load_game(path).events


def test_document_has_the_same_events(tmp_path: Path) -> None:
    """`/scenario/game` lists them flat, with name, label and kind, as JSON."""
    path = tmp_path / 'game.yaml'
    path.write_text(EVENTS)
    events = load_game(path).events
    entries = json.loads(json.dumps([document_entry(item) for item in events]))
    assert entries[0] == {'name': 'pedestrian', 'label': 'Release the pedestrian',
                          'kind': 'release', 'when': {'time': 5.0}, 'object': 42}
    assert entries[5] == {'name': 'blank', 'label': 'blank', 'kind': 'plan_display', 'when': None,
                          'av': 'av0', 'show': False}
    assert entries[9] == {'name': 'crawl', 'label': 'crawl', 'kind': 'traffic', 'when': None,
                          'agent': 'all', 'desired_speed': 3.0, 'options': {}}
    assert {entry['kind'] for entry in entries} == ACTIONS.keys()
    assert EventEntries(EventList).read(entries, '/scenario/game') == events


@pytest.mark.parametrize(('text', 'message'), [
    ('7', 'is no mapping'),
    ('{release: {object: 1}}', '"name" is missing; give 1 to 40'),
    ('{name: Big, release: {object: 1}}', "\"name\" is 'Big'; give 1 to 40"),
    ('{name: a b, release: {object: 1}}', '"name" is'),
    ('{name: ' + 'x' * 41 + ', release: {object: 1}}', '"name" is'),
    ('{name: a, label: 7, release: {object: 1}}', '"label" is 7'),
    ('{name: a}', 'has no action; give exactly one of release, brake, obstacle'),
    ('{name: a, release: {object: 1}, brake: {object: 1}}', r'has 2 actions \(release, brake\)'),
    ('{name: a, explode: {}}', '"explode" is unknown; known are name'),
    ('{name: a, release: 1}', 'is no mapping'),
    ('{name: a, release: {}}', '"object" is missing'),
    ('{name: a, release: {object: one}}', "\"object\" is 'one'; give a whole number"),
    ('{name: a, brake: {object: 1, deceleration: 0}}',
     '"deceleration" is 0; give a number above 0'),
    ('{name: a, brake: {object: 1, speed: -1}}', '"speed" is -1; give a number from 0 to 100'),
    ('{name: a, obstacle: {x: 0}}', '"y" is missing'),
    ('{name: a, obstacle: {x: 0, y: 0, width: 0}}', '"width" is 0'),
    ('{name: a, obstacle: {x: 0, y: .nan}}', '"y" is nan'),
    ('{name: a, obstacle: {x: 0, y: 0, type: cow}}', "\"type\" is 'cow'; use one of"),
    ('{name: a, speed_limit: {speed: 0}}', '"speed" is 0; give a number above 0'),
    ('{name: a, speed_limit: {speed: 5, lanelets: 3}}',
     '"lanelets" is 3; give a list of whole numbers'),
    ('{name: a, speed_limit: {speed: 5, lanelets: [a]}}', '"lanelets" holds .a.; give a list'),
    ('{name: a, plan_display: {av: av0, show: 1}}', '"show" is 1; give true or false'),
    ('{name: a, planner: {av: av0, planner: ""}}', '"planner" is ..; give the name of a planner'),
    ('{name: a, planner_run: {av: av0}}', '"run" is missing'),
    ('{name: a, traffic: {speed_factor: 1}}', '"agent" is missing'),
    ('{name: a, traffic: {agent: 3, speed_factor: 1}}', '"agent" is 3; give a text'),
    ('{name: a, traffic: {agent: t3}}', 'changes nothing; give what is to change'),
    ('{name: a, traffic: {agent: t3, speed: 9}}',
     '"speed" is unknown; .*known are agent, speed_f'),
    ('{name: a, traffic: {agent: t3, speed_factor: 9}}',
     '"speed_factor" is 9; give a number from 0.1 to 3'),
    ('{name: a, traffic: {agent: t3, desired_speed: -1}}', 'from 0 to 100'),
    ('{name: a, traffic: {agent: t3, reaction_time: 2.1}}', 'from 0 to 2'),
    ('{name: a, traffic: {agent: t3, late_yielder: 0.5}}',
     '"late_yielder" is 0.5; give true or false'),
    ('{name: a, traffic: {agent: all, speed_factor: 1, desired_speed: 9}}', 'has both "speed_fac'),
    ('{name: a, release: {object: 1}, when: 5}',
     '"when" is 5; give {time:} or {step:} or {vehicle:, x:'),
    ('{name: a, release: {object: 1}, when: {}}',
     'when: has none of "time", "step", "vehicle", "between"; give {time:}'),
    ('{name: a, release: {object: 1}, when: {time: 1, step: 2}}',
     'when: has "time", "step" at once; give {time:}'),
    ('{name: a, release: {object: 1}, when: {vehicle: hv0, x: 0, y: 0, radius: 0}}',
     '"radius" is 0'),
    ('{name: a, release: {object: 1}, when: {between: [hv0, hv0], distance: 1}}', 'name two ids'),
    ('{name: a, release: {object: 1}, when: {between: [hv0], distance: 1}}', 'name two ids'),
], ids=range(39))
def test_refusals_name_the_entry(text: str, message: str) -> None:
    """Each refusal names the entry, the mistake and the valid values."""
    with pytest.raises(InputError, match=message) as caught:
        event(text)
    assert str(caught.value).startswith('game.yaml: events[0]')


def test_names_are_unique_and_lists_short() -> None:
    """A trigger names one event; an oversized list is refused before it is read."""
    entry = {'name': 'a', 'release': {'object': 1}}
    with pytest.raises(InputError, match=r'events\[1\]: "a" is there already'):
        read(EventList, [entry, entry], 'events')
    with pytest.raises(InputError, match=f'give {MAX_EVENTS} at most'):
        read(EventList, [entry] * (MAX_EVENTS + 1), 'events')
    with pytest.raises(InputError, match='events: is no list'):
        read(EventList, entry, 'events')


@pytest.mark.parametrize('entries', [7, [7], [{'name': 'a'}], [{'name': 'a', 'kind': 'x'}]],
                         ids=range(4))
def test_spoilt_document_is_refused(entries: object) -> None:
    """Malformed content of `/scenario/game` from another process is refused."""
    with pytest.raises(InputError, match='/scenario/game'):
        EventEntries(EventList).read(entries, '/scenario/game')
