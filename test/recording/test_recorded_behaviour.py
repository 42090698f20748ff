# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Driving behaviour from a recording: the same as from the run; take-overs; the command."""

from dataclasses import replace
import json
from pathlib import Path
from typing import Any

from crgame_ros.analysis.behaviour.driver import measure_behaviour
from crgame_ros.cli import main
from crgame_ros.driver.source import ReplayDriver
from crgame_ros.game.game import load_game
from crgame_ros.paths import scenarios_directory
from crgame_ros.recording.run_record import (
    read_run_record,
    run_record_of,
    SeatOrder,
)
from crgame_ros.simulation.offline import OfflineResult, run_offline
from crgame_ros.simulation.setup import build_setup
import numpy as np
import pytest

DURATION_S, LOG_NS = 8.0, 1_700_000_000_000_000_000
FROM, TO, HANDS_ON = 300, 700, 350


@pytest.fixture(scope='module')
def taken_over() -> OfflineResult:
    """Run the crossing with two events; the AV is driven by hand from n = 300 to 700."""
    setup = build_setup(load_game(scenarios_directory() / 'crossing.yaml'))
    hands = np.full((800, 4), np.nan)
    hands[FROM:TO] = 0.0
    hands[HANDS_ON:TO, 0] = 0.2
    human = np.zeros((800, 4))
    human[:500, 0] = 0.3
    human[530:, 1] = 0.4
    return run_offline(
        setup, duration_s=DURATION_S, check_drivability=False,
        drivers={'hv0': ReplayDriver(human), 'av0': ReplayDriver(hands)},
        triggers=((200, 'slow-zone'), (450, 'pedestrian')))


@pytest.fixture(scope='module')
def bag(taken_over: OfflineResult, recorder: Any, samples: Any,
        tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Record it, with the commands of the AV and the orders of the seats."""
    messages = recorder.messages(taken_over)
    for n, text in ((180, '{"seat": "av0", "source": "game"}'), (230, 'no order'),
                    (240, '{"seat": 7, "source": "cockpit"}'),
                    (250, '{"seat": "av0", "source": "cockpit"}'),
                    (700, '{"seat": "av0", "source": "game"}')):
        messages.append(('/seats/order', 'std_msgs/msg/String', LOG_NS + 10_000_000 * n
                         + 2_000_000, samples.string(text)))
    return Path(recorder.ours(tmp_path_factory.mktemp('run') / 'bag',
                              sorted(messages, key=lambda each: each[2])))


def test_orders_of_seats_are_read(bag: Path, recorder: Any, tmp_path: Path,
                                  taken_over: OfflineResult) -> None:
    """They are at the step of the newest state; invalid orders and runs without have none."""
    assert read_run_record(bag).orders == (
        SeatOrder(180, 'av0', 'game'), SeatOrder(250, 'av0', 'cockpit'),
        SeatOrder(700, 'av0', 'game'))
    plain = recorder.ours(tmp_path / 'bag', recorder.messages(taken_over))
    assert read_run_record(plain).orders == ()


def test_a_recording_says_the_same_as_the_run(bag: Path,
                                              taken_over: OfflineResult) -> None:
    """All numbers agree to the last bit; only a recording has the requests for seats."""
    here = measure_behaviour(run_record_of(taken_over))
    record = read_run_record(bag)
    there = measure_behaviour(record)
    unasked = measure_behaviour(replace(record, orders=()))
    for each, other in zip(here, unasked, strict=True):
        assert json.dumps(each.as_dict()) == json.dumps(other.as_dict())
        for name in ('times_s', 'tlc_s', 'tlc_linear_s'):
            assert getattr(each, name).tobytes() == getattr(other, name).tobytes()
    assert there[0].reactions[1].reaction.brake_s == pytest.approx(0.81)
    assert there[0].reactions[1].reaction.throttle_s == pytest.approx(0.51)
    take_over, = there[1].take_overs
    assert take_over.request == (2.5, 'order')
    # The row n holds the command that the step to n consumed.
    assert take_over.seat_s == pytest.approx(0.01 * (FROM + 1))
    assert take_over.to_hands_on_s == pytest.approx(0.01 * (HANDS_ON + 1) - 2.5)
    assert there[1].values['throttle_share'] == pytest.approx((TO - HANDS_ON) / (TO - FROM))


def test_the_command_tells_it(bag: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """It prints text, or JSON beside the earlier keys, also with an event as request."""
    assert main(['measure', str(bag), '--json']) == 0
    found = json.loads(capsys.readouterr().out)
    assert set(found) == {'thresholds', 'vehicles', 'rules', 'behaviour'}
    assert set(found['behaviour']) == {'hv0', 'av0'}
    assert found['behaviour']['av0']['take_overs'][0]['take_over_hands_on'] == pytest.approx(1.01)
    assert main(['measure', str(bag), '--request', 'slow-zone']) == 0
    text = capsys.readouterr().out
    assert 'hv0 as it was driven' in text and '  sdlp ' in text
    assert '  reaction_brake            0.81 s      after pedestrian at 4.5 s' in text
    assert 'asked for by slow-zone' in text
    assert '  take_over_hands_on        1.51 s      after the request' in text


def test_an_event_that_there_is_not_is_refused(bag: Path,
                                               capsys: pytest.CaptureFixture[str]) -> None:
    """The error is one line that names the existing events."""
    assert main(['measure', str(bag), '--request', 'nothing']) == 2
    error = capsys.readouterr().err
    assert "--request: the run has no event 'nothing'" in error and 'slow-zone' in error


def test_without_commands_motion_is_left(bag: Path) -> None:
    """A recording without cycles has no pedals and no wheel; the rest is unchanged."""
    record = read_run_record(bag)
    bare = replace(record, ns=record.ns[:0], commands=record.commands[:0])
    human = measure_behaviour(bare)[0]
    assert human.driven_s == 0.0 and not human.reactions
    assert np.isnan(human.values['srr_visual']) and np.isfinite(human.values['sdlp'])
