# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The multi-AV experiment has its expected results, and faults in a run are found."""

from dataclasses import replace

from crgame_ros.analysis.counterfactual import Alternative
from crgame_ros.paths import scenarios_directory
from crgame_ros.recording.run_trajectories import RunTrajectories
from crgame_ros.reproduction.recorded_human import record_offline
from crgame_ros.reproduction.single_av_evaluation import (
    judge_multi_av,
    jumps,
    MultiAvRun,
    run_alone,
)
import numpy as np
import pytest

pytestmark = pytest.mark.xdist_group('reproduction')
# The human brakes from the fifth second on.
DURATION_S = 9.0


def _run(planner: str) -> MultiAvRun:
    game = scenarios_directory() / 'two_avs.yaml'
    recorded = record_offline(game, planner, DURATION_S)
    return MultiAvRun(recorded.against(planner), run_alone(game, planner, recorded.duration_s))


@pytest.fixture(scope='module')
def idm() -> MultiAvRun:
    """Drive two AVs with the IDM planner."""
    return _run('idm')


def _unmet(run: MultiAvRun) -> list[str]:
    return [each.name for each in judge_multi_av([('', run)]) if not each.is_met]


@pytest.mark.exhaustive
def test_each_reacts(idm: MultiAvRun) -> None:
    """Both are elsewhere than in the game without the human."""
    assert _unmet(idm) == []
    assert [item.id for item in idm.alone.vehicles] == ['av0', 'av1']
    assert len(idm.alone.ks) == round(10 * DURATION_S) + 1


def test_without_reactions() -> None:
    """At constant velocity both AVs are in the same places without the human."""
    run = _run('constant-velocity')
    assert run.reactions() == {'av0': 0.0, 'av1': 0.0}
    assert 'each AV reacts' in _unmet(run)


@pytest.mark.parametrize('moved', [0.06, np.nan])
def test_jump_and_gap_are_found(idm: MultiAvRun, moved: float) -> None:
    """A state 6 cm ahead of the others, or none, is no time line."""
    states = idm.run.log.vehicle_states.copy()
    states[40, 2, :2] += moved
    log: RunTrajectories = replace(idm.run.log, vehicle_states=states)
    record = replace(idm.run.record, log=log)
    run = replace(idm, run=Alternative('idm', log, record=record, timing=idm.run.outcome))
    assert 'one time line without a jump' in _unmet(run)


def test_step_and_speed(idm: MultiAvRun) -> None:
    """Where the speed doubles without the way doing so, the step differs by its length."""
    log = idm.run.log
    states = log.vehicle_states.copy()
    states[:, 1, 3] *= 2.0
    lengths = np.hypot(*np.diff(states[:, 1, :2], axis=0).T)
    np.testing.assert_allclose(jumps(replace(log, vehicle_states=states))[:, 1], lengths,
                               atol=0.01)


def test_contact_is_found(idm: MultiAvRun) -> None:
    """Contacts are told with both names."""
    assert idm.run.outcome is not None
    touched = replace(idm, run=Alternative(
        'idm', idm.run.log, record=idm.run.record,
        timing={**idm.run.outcome, 'contacts': [{'vehicle': 'av1', 'with': 'av0'}]}))
    judged = judge_multi_av([('x', touched)])
    assert [each.line for each in judged if not each.is_met] == [
        'UNMET: two AVs, x: no contact: av1 with av0']
