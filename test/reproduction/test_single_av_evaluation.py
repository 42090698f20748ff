# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The single-AV experiment has its expected results, but not if the AV does not react."""

from dataclasses import replace

from crgame_ros.analysis.counterfactual import Alternative
from crgame_ros.paths import scenarios_directory
from crgame_ros.reproduction.expectation import judge
from crgame_ros.reproduction.recorded_human import record_offline, RecordedHuman
from crgame_ros.reproduction.single_av_evaluation import (
    DrivenLane,
    Encounter,
    HUMAN_EXPECTATIONS,
    IDM_EXPECTATIONS,
    judge_single_av,
    REACTIVE_EXPECTATIONS,
    SameHuman,
)
import numpy as np
import pytest

pytestmark = pytest.mark.xdist_group('reproduction')


def _unmet(run: Alternative, expectations: object) -> list[str]:
    judged = judge('', expectations, Encounter(run, 'av0'))  # type: ignore[arg-type]
    return [each.name for each in judged if not each.is_met]


@pytest.mark.slow
def test_idm(idm: Alternative) -> None:
    """The IDM stops behind the human; it does none of what the reactive planner must do."""
    assert _unmet(idm, IDM_EXPECTATIONS) == []
    assert _unmet(idm, REACTIVE_EXPECTATIONS) == [
        'leaves its lane', 'passes the human', 'does not stop']
    encounter = Encounter(idm, 'av0')
    begin, end = encounter.steps
    across = encounter.lane.across[:, 0]
    assert across[begin] < 0.5 * encounter.lane.width < across[begin - 1]
    assert encounter.speeds[end] < 0.1 <= encounter.speeds[end - 1]


def test_without_reactions(cut_in: RecordedHuman, unmoved: Alternative) -> None:
    """At its speed the AV runs into the human: only the human's part is met."""
    assert _unmet(unmoved, IDM_EXPECTATIONS) == [
        'comes to a stop', 'keeps a gap behind the human', 'no contact']
    assert _unmet(unmoved, REACTIVE_EXPECTATIONS) == ['leaves its lane', 'no contact']
    judged = judge_single_av(cut_in.log, unmoved, unmoved)
    assert [each.is_met for each in judged].count(False) == 5
    assert judged[-1].is_met
    assert next(each.line for each in judged if not each.is_met).startswith(
        'UNMET: one AV, IDM: comes to a stop: 20.0')


@pytest.mark.slow
def test_reactive() -> None:
    """The AV drives around the human, and has passed after 12.5 s."""
    recorded = record_offline(scenarios_directory() / 'cut_in.yaml', 'constant-velocity', 12.5)
    run = recorded.against('reactive')
    assert _unmet(run, REACTIVE_EXPECTATIONS) == []
    assert 'stays in its lane' in _unmet(run, IDM_EXPECTATIONS)
    # The road runs along x, the AV's lane in its middle is 3.75 m wide, and so is the next one.
    encounter = Encounter(run, 'av0')
    assert encounter.lane.width == pytest.approx(3.75)
    assert encounter.deviation == pytest.approx(3.75, abs=0.1)
    begin, end = encounter.steps
    lead = encounter.lane.along[:, 1] - encounter.lane.along[:, 0]
    assert lead[begin] < 0.0 and lead[end - 1] < 8.0 < lead[end]


def test_lane_is_measured(unmoved: Alternative) -> None:
    """On a straight road along x the offset is y and the arc length goes with x."""
    lane = DrivenLane(unmoved.log, 1)
    states = unmoved.log.vehicle_states
    np.testing.assert_allclose(lane.across, states[:, :, 1], atol=1e-9)
    np.testing.assert_allclose(lane.along - lane.along[0, 1], states[:, :, 0] - states[0, 1, 0],
                               atol=1e-9)


def test_human_to_the_last_bit(cut_in: RecordedHuman, idm: Alternative, unmoved: Alternative
                               ) -> None:
    """The human is the same in both; one state that differs in its last bit is found."""
    def met(other: Alternative, recorded: RecordedHuman) -> bool:
        return judge('', HUMAN_EXPECTATIONS, SameHuman(recorded.log, (idm, other)))[0].is_met

    assert met(unmoved, cut_in)
    states = unmoved.log.published_states.copy()
    states[50, 0, 0] = np.nextafter(states[50, 0, 0], np.inf)
    moved = replace(unmoved.log, published_states=states)
    assert not met(Alternative('', cut_in.log, record=replace(unmoved.record, log=moved)), cut_in)
    assert not met(unmoved, replace(cut_in, log=moved))
