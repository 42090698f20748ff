# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Status and alarms, made from the nodes' messages."""

from collections.abc import Mapping

from crgame_ros.cockpit.run_status import RunStatus
from crgame_ros.game.events import FiredEvent
from crgame_ros.messages.status_values import Status


def _kinds(status: RunStatus) -> list[str]:
    return [alarm.id for alarm in status.alarms]


def _take(status: RunStatus, name: str, level: int, text: str, values: Mapping[str, str],
          t: float) -> None:
    status.add(Status(name, level, text, dict(values)), t)


def _begun() -> RunStatus:
    status = RunStatus()
    status.begin(('hv0', 'av0'))
    return status


def test_collision_and_road_are_alarms_while_they_last() -> None:
    """Each alarm has its kind, the object that was hit and its start."""
    status = _begun()
    values = {'collision': 'true', 'road_compliance': 'false', 'hit': 'av0,o12', 'n': '70',
              'stop': 'false'}
    _take(status, 'hv0/drivability', 2, 'collision', values, 0.7)
    _take(status, 'hv0/drivability', 2, 'collision', values, 1.7)
    # A repeated message is no change; pages would hear of a change at once.
    assert status.verdicts == 1
    assert status.alarms_document()['active'] == [
        {'id': 'collision:hv0', 'kind': 'collision', 'subject': 'hv0',
         'text': 'collision with av0, o12', 'since_t': 0.7},
        {'id': 'off_road:hv0', 'kind': 'off_road', 'subject': 'hv0', 'text': 'off the road',
         'since_t': 0.7}]
    assert status.document()['drivability']['hv0'] == {
        'collision': True, 'off_road': True, 'hit': ['av0', 'o12']}
    _take(status, 'hv0/drivability', 0, 'valid', {
        'collision': 'false', 'road_compliance': 'true', 'hit': ''}, 2.0)
    assert _kinds(status) == []
    assert status.verdicts == 2


def test_checks_that_are_off_give_no_alarm() -> None:
    """`off` is neither true nor false."""
    status = _begun()
    _take(status, 'hv0/drivability', 0, 'valid',
          {'collision': 'off', 'road_compliance': 'off'}, 0.0)
    assert _kinds(status) == []


def test_plans_and_planner() -> None:
    """One row has the simulation's counts and the planner's times; braking is an alarm."""
    status = _begun()
    _take(status, 'sim_node: av0 plans', 2, 'no plan: braking', {
        'planner': 'idm', 'running': 'True', 'accepted': '7', 'refused': '1',
        'latency_ms': '10.0', 'age_ms': '', 'last_refusal': 'late'}, 3.0)
    _take(status, 'planner_node: av0', 1, 'braking: ValueError: no path', {
        'plan_time_ms': '9.5', 'fallbacks': '2', 'planner': 'reactive'}, 3.0)
    _take(status, 'planner_node: av0', 0, 'planning', {
        'plan_time_ms': '4.5', 'fallbacks': '2', 'planner': 'reactive'}, 3.0)
    _take(status, 'sim_node: av0 plans', 2, 'no plan: braking', {
        'planner': 'idm', 'running': 'True', 'accepted': '7', 'refused': '1', 'of_others': '3',
        'latency_ms': '10.0', 'age_ms': '', 'last_refusal': 'late'}, 4.0)
    assert status.document()['planners']['av0'] == {
        'running': True, 'stale': True, 'latency_ms': 10.0, 'age_ms': None, 'accepted': 7,
        'refused': 1, 'plan_time_ms': 4.5, 'fallbacks': 2.0, 'planner': 'reactive',
        'last_refusal': 'late', 'tracking': None, 'of_others': 3,
        'failure': 'ValueError: no path'}
    assert _kinds(status) == ['stale_plan:av0']


def test_tracking_errors_of_tracked_avs() -> None:
    """Each has its present and worst errors by name; an AV that follows perfectly has none."""
    status = _begun()
    errors = {f'{when}{name}_error': str(value) for value, (when, name) in enumerate(
        (when, name) for when in ('', 'worst_') for name in ('lane', 'lateral', 'along',
                                                             'heading', 'speed'))}
    _take(status, 'sim_node: av0 plans', 0, 'following its plan', errors, 1.0)
    assert status.document()['planners']['av0']['tracking'] == {
        'lane_error': 0.0, 'lateral_error': 1.0, 'along_error': 2.0, 'heading_error': 3.0,
        'speed_error': 4.0, 'worst_lane_error': 5.0, 'worst_lateral_error': 6.0,
        'worst_along_error': 7.0, 'worst_heading_error': 8.0, 'worst_speed_error': 9.0}
    _take(status, 'sim_node: av0 plans', 0, 'following its plan', {'accepted': '1'}, 2.0)
    assert status.document()['planners']['av0']['tracking'] is None


def test_late_traffic_is_an_alarm_until_it_is_not_told_for_two_seconds() -> None:
    """The alarm must expire by itself, as no message says that agents are in time again."""
    status = _begun()
    for t in (1.0, 2.5):
        _take(status, 'sim_node: traffic', 1, 'agents are 2 scenario steps late',
              {'n': '100', 'k': '10', 'agents_k': '8'}, t)
    assert status.alarms_document()['active'] == [
        {'id': 'late_traffic:traffic', 'kind': 'late_traffic', 'subject': 'traffic',
         'text': 'agents are 2 scenario steps late', 'since_t': 1.0}]
    _take(status, 'sim_node: run', 0, 'running', {}, 4.4)
    assert _kinds(status) == ['late_traffic:traffic']
    _take(status, 'sim_node: run', 0, 'running', {}, 4.6)
    assert _kinds(status) == []
    _take(status, 'sim_node: traffic', 1, 'agents are 1 scenario steps late', {}, 5.0)
    status.begin(('hv0', 'av0'))
    assert _kinds(status) == []


def test_lost_driver_and_lost_device() -> None:
    """A silent seat is shown at the seat and as an alarm, with the device's own message."""
    status = _begun()
    _take(status, 'sim_node: hv0 seat', 1, 'driver lost', {'losses': '1'}, 5.0)
    assert status.document()['seats_lost'] == {'hv0': True}
    assert _kinds(status) == ['lost_device:hv0']
    _take(status, 'driver_node: hv0', 2, 'G29 is unplugged', {}, 5.1)
    assert status.alarms[0].text == 'G29 is unplugged'
    _take(status, 'driver_node: hv0', 0, 'device found', {}, 6.0)
    _take(status, 'sim_node: hv0 seat', 0, 'driven', {'losses': '1'}, 6.0)
    assert _kinds(status) == []


def test_recording() -> None:
    """It shows its size, or its last message if it fails; a new run doesn't hide a failure."""
    status = _begun()
    assert status.document()['recording']['state'] == 'none'
    _take(status, 'recorder_node: recording', 0, 'recording into bag',
          {'messages': '120', 'bytes': '2500000'}, 1.0)
    assert status.document()['recording'] == {
        'state': 'recording', 'messages': 120, 'megabytes': 2.5, 'text': 'recording into bag'}
    _take(status, 'recorder_node: recording', 2, 'no space left', {}, 2.0)
    status.begin(('hv0',))
    assert status.document()['recording']['state'] == 'failed'
    assert _kinds(status) == ['recording:recorder']


def test_timing_numbers() -> None:
    """Strings become numbers, other values null; skipped frames are an alarm."""
    status = _begun()
    _take(status, 'timesync_node: table I', 1, 'late', {
        'mean_step_error_ms': '0.05', 'real_time_ratio_min': 'nan', 'frame_skipping': 'True'}, 4.0)
    assert status.document()['timing'] == {
        'mean_step_error_ms': 0.05, 'real_time_ratio_min': None, 'frame_skipping': True}
    assert _kinds(status) == ['late:simulation']
    why = '7.0 ms late at 1.00 s (n = 100): 7.0 ms page faults'
    _take(status, 'timesync_node: table I', 0, '', {'late_steps': '1', 'worst_late_step': why},
          5.0)
    timing = status.document()['timing']
    assert (timing['late_steps'], timing['worst_late_step']) == (1.0, why)


def test_run_state() -> None:
    """The run state is the one that sim_node publishes."""
    status = _begun()
    _take(status, 'sim_node: run', 0, 'paused', {'real_time_factor': '0.5'}, 0.0)
    assert (status.document()['run'], status.document()['real_time_factor']) == ('paused', 0.5)


def test_others_are_ignored() -> None:
    """Messages of another game's vehicles and of unknown nodes change nothing."""
    status = _begun()
    before = status.document()
    for name in ('sim_node: av9 plans', 'my_node: hello', 'planner_node: av9', ''):
        _take(status, name, 2, 'broken', {}, 0.0)
    assert status.document() == before and _kinds(status) == []


def test_vehicles_that_take_no_part_leave_nothing() -> None:
    """Unknown and former vehicles are not stored: a peer's made-up names could fill the memory."""
    status = _begun()
    values = {'collision': 'true', 'road_compliance': 'false', 'hit': 'av0'}
    for name in ('hv1/drivability', '/drivability', 'hv0/x/drivability',
                 'x' * 500 + '/drivability'):
        _take(status, name, 2, 'collision', values, 0.0)
    assert status.document()['drivability'] == {} and _kinds(status) == []


def _verdict(status: RunStatus, vehicle: str, hit: str, off_road: bool, t: float) -> None:
    _take(status, f'{vehicle}/drivability', 2 if hit or off_road else 0, '', {
        'collision': str(bool(hit)).lower(), 'road_compliance': str(not off_road).lower(),
        'hit': hit}, t)


def test_contacts_and_departures_are_kept_until_the_next_run() -> None:
    """Each is kept once, even if both vehicles report it, and again after it has ended."""
    status = _begun()
    _verdict(status, 'hv0', 'av0', False, 1.0)
    _verdict(status, 'av0', 'hv0', False, 1.0)
    _verdict(status, 'hv0', 'av0,o7', True, 2.0)
    _verdict(status, 'hv0', 'av0,o7', True, 3.0)
    _verdict(status, 'hv0', '', False, 4.0)
    _verdict(status, 'av0', '', False, 4.0)
    _verdict(status, 'av0', 'hv0', False, 5.0)
    document = status.document()
    assert [(item['vehicle'], item['with'], item['t']) for item in document['contacts']] == [
        ('hv0', 'av0', 1.0), ('hv0', 'o7', 2.0), ('av0', 'hv0', 5.0)]
    assert document['departures'] == [{'vehicle': 'hv0', 't': 2.0}]
    status.begin(('hv0', 'av0'))
    assert status.document()['contacts'] == status.document()['departures'] == []


def test_the_end_of_a_run_leaves_no_alarm_but_a_failed_recording() -> None:
    """The result keeps its last state; drivers that fall silent afterwards raise no alarm."""
    status = _begun()
    _verdict(status, 'hv0', 'av0', True, 1.0)
    _take(status, 'recorder_node: recording', 2, 'disk full', {}, 1.0)
    _take(status, 'sim_node: run', 0, 'ended', {'reason': 'duration'}, 2.0)
    _take(status, 'sim_node: hv0 seat', 1, 'driver lost', {}, 2.1)
    _verdict(status, 'av0', 'hv0', False, 2.1)
    assert _kinds(status) == ['recording:recorder']
    document = status.document()
    assert (document['run'], document['reason'], document['seats_lost']) == (
        'ended', 'duration', {})
    status.begin(('hv0', 'av0'))
    assert (status.run, status.reason) == ('waiting', '')


def test_a_recording_that_is_done_says_so() -> None:
    """Its size stays visible."""
    status = _begun()
    _take(status, 'recorder_node: recording', 0, 'recorded', {
        'messages': '12', 'bytes': '2500000', 'closed': 'True'}, 1.0)
    assert status.recording == {
        'state': 'recorded', 'text': 'recorded', 'messages': 12, 'megabytes': 2.5}


def test_a_silent_simulation_is_no_end_that_it_told_itself() -> None:
    """The page distinguishes a silent simulation from one that reported its end."""
    status = _begun()
    _take(status, 'sim_node: run', 0, 'running', {}, 2.0)
    status.lose()
    assert (status.run, status.reason) == ('ended', 'silence')
    _take(status, 'sim_node: run', 0, 'ended', {'reason': 'stop'}, 2.0)
    status.lose()
    assert status.reason == 'stop'


def test_a_contact_that_stops_a_driver_is_counted_once() -> None:
    """The contact comes as event alone, as event then verdict, or as verdict then event."""
    status = _begun()
    stops = [FiredEvent.contact('hv0', 'av0', 70, 7), FiredEvent.put_back('hv0', 200, 20),
             FiredEvent.contact('hv0', 'av0', 500, 50), FiredEvent.contact('hv0', 'o12', 900, 90)]
    free = {'collision': 'false', 'road_compliance': 'true', 'hit': ''}
    touches = free | {'collision': 'true', 'hit': 'hv0'}
    status.add_events(stops[:1], 0.01)
    status.add_events(stops[:2], 0.01)
    assert status.contacts == [{'vehicle': 'hv0', 'with': 'av0', 't': 70 * 0.01}]
    assert status.verdicts == 1
    # The AV keeps pushing against the vehicle.
    _take(status, 'av0/drivability', 2, 'collision', touches, 0.9)
    _take(status, 'av0/drivability', 0, 'valid', free, 2.0)
    assert len(status.contacts) == 1
    _take(status, 'av0/drivability', 2, 'collision', touches, 4.9)
    status.add_events(stops[:3], 0.01)
    assert [item['t'] for item in status.contacts] == [70 * 0.01, 4.9]
    status.add_events(stops, 0.01)
    assert status.contacts[-1] == {'vehicle': 'hv0', 'with': 'o12', 't': 9.0}
    status.begin(('hv0', 'av0'))
    assert status.contacts == []
