# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Contacts in the timing report of a recording, against those of the same run offline."""

from pathlib import Path
from typing import Any

from crgame_ros.game.game import AvSpec, Game, HumanSpec, PoseSpawn, TimingSpec
from crgame_ros.paths import scenarios_directory
from crgame_ros.recording.timing_report import timing_report
from crgame_ros.simulation.contacts import contacts_of
from crgame_ros.simulation.offline import OfflineResult, run_offline
from crgame_ros.simulation.setup import build_setup
import pytest

Message = tuple[str, str, int, bytes]
DIAGNOSTICS = 'diagnostic_msgs/msg/DiagnosticArray'
START = 1_700_000_000_000_000_000


def _crash(rate: float = 100.0) -> OfflineResult:
    """Drive blindly at a human's car that stands 60 m along the road."""
    game = Game(scenarios_directory() / 'ZAM_CutIn-1_1_T-1.xml',
                humans=(HumanSpec('hv0', 'idle', spawn=PoseSpawn(60.0, 0.0, 0.0, 0.0)),),
                avs=(AvSpec('av0', 'constant-velocity'),), timing=TimingSpec(rate=rate))
    return run_offline(build_setup(game), duration_s=5.0)


def _recorded(recorder: Any, result: OfflineResult) -> list[Message]:
    """Return the messages of a run with its verdicts, as the monitor's node sends them."""
    messages: list[Message] = recorder.messages(result, log_ns=START)
    for verdict in result.violations:
        stamp_ns = result.setup.scheduler.stamp_ns(verdict.n)
        status = recorder.status(
            stamp_ns, f'{verdict.vehicle_id}/drivability', 'x', 2 * (not verdict.is_valid),
            collision=verdict.collision, hit=','.join(verdict.hit), n=verdict.n)
        messages.append((f'/{verdict.vehicle_id}/drivability', DIAGNOSTICS,
                         START + stamp_ns + 2_000_000, status))
    return sorted(messages, key=lambda message: message[2])


def test_a_recorded_car_that_runs_into_the_av(tmp_path: Path, recorder: Any,
                                              shared_scenarios: Path) -> None:
    """The entries are those of `crgame offline`: vehicles, place, time, and o6 had to brake."""
    game = Game(shared_scenarios / 'DEU_Test-1_1_T-1.xml', humans=(HumanSpec('hv0', 'idle'),),
                avs=(AvSpec('av0', 'idm'),))
    result = run_offline(build_setup(game), duration_s=4.0)
    bag = recorder.ours(tmp_path / 'bag', _recorded(recorder, result))
    report = timing_report(bag)
    assert report['contacts'] == [item.as_dict() for item in contacts_of(result)]
    rear = next(item for item in report['contacts'] if item['with'] == 'o6')
    assert (rear['vehicle'], rear['side']) == ('av0', 'rear')
    assert rear['avoidable_by'].startswith('o6')
    assert report['notices'] == []


@pytest.mark.matrix('500.0')
@pytest.mark.parametrize('rate', [100.0, 500.0])
def test_a_human_is_told_as_the_av_s_contact(rate: float, tmp_path: Path, recorder: Any) -> None:
    """One entry for both has the AV's front; above 100 Hz only each fifth state is recorded."""
    result = _crash(rate)
    every = round(rate / 100.0)
    messages = _recorded(recorder, result)
    states = [item for item in messages if item[0] == '/vehicles/state']
    kept = [item for item in messages if item[0] != '/vehicles/state'] + states[::every]
    bag = recorder.ours(tmp_path / 'bag', sorted(kept, key=lambda message: message[2]))
    (contact,) = timing_report(bag)['contacts']
    assert [contact] == [item.as_dict() for item in contacts_of(result)]
    assert (contact['vehicle'], contact['with'], contact['side'], contact['kind']) == (
        'av0', 'hv0', 'front', 'stopped track')
    assert contact['avoidable_by'] == 'av0'


def test_what_humans_touch_without_an_av(tmp_path: Path, recorder: Any) -> None:
    """One rolls into the back of another at 15 m/s; the entry of each has its own side."""
    humans = tuple(HumanSpec(f'hv{index}', 'idle', spawn=PoseSpawn(x, 0.0, 0.0, speed))
                   for index, (x, speed) in enumerate(((60.0, 0.0), (30.0, 15.0))))
    result = run_offline(build_setup(Game(
        scenarios_directory() / 'ZAM_CutIn-1_1_T-1.xml', humans=humans, avs=())), duration_s=3.0)
    report = timing_report(recorder.ours(tmp_path / 'bag', _recorded(recorder, result)))
    assert {(item['vehicle'], item['side']) for item in report['contacts']} == {
        ('hv0', 'rear'), ('hv1', 'front')}
    # 25 m of gap at 15 m/s: braking with 8 m/s^2 after 1 s needs 15 + 14 m, all of it counted
    # from where the other came into the way at the start.
    assert {item['avoidable_by'] for item in report['contacts']} == {'not avoidable by braking'}


def test_contacts_without_the_motion_that_led_to_them(tmp_path: Path, recorder: Any) -> None:
    """They stay among the violations; the report names the missing data."""
    messages = _recorded(recorder, _crash())
    result_states = [item for item in messages if item[0] == '/vehicles/state']
    late = [item for item in messages if item not in result_states] + result_states[:100]
    report = timing_report(recorder.ours(
        tmp_path / 'bag', sorted(late, key=lambda message: message[2])))
    assert report['contacts'] is None
    assert report['drivability']['violations'] > 0
    assert 'no states of step' in report['notices'][0]
