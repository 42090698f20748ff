# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What a drive tells of its data, and which of it is beyond the bounds of a study."""

from crgame_ros.game.task_documents import TaskEntry
from crgame_ros.messages.status_values import Status
from crgame_ros.schema.reading import read
from crgame_ros.study.drive_watch import DriveWatch
from crgame_ros.study.quality import PAGE, QualityBounds


def view(**values: object) -> Status:
    """Return the status of a page that shows the driver's view in full screen."""
    return Status.of('cockpit_node: av0 view', 0, '', {
        'shown': 'driver', 'rate_hz': '60.0', 'away': '', 'full_screen': True,
        'device': 'wheel', **values})


def entry(n: int, what: str, number: int, by: str = '') -> TaskEntry:
    """Return an entry of the task `drt`."""
    return TaskEntry(n, 'drt', 'detection_response', 'av0', what, number, by)  # type: ignore


def test_times_are_between_statuses_and_a_pause_of_them_tells_nothing() -> None:
    """Away from 2.0 to 2.6 s and from 4.0 s on, when statuses stop; a second device."""
    watch = DriveWatch('av0')
    for time_s, told in (
            (0.0, view(away='focus')), (1.0, view()), (2.0, view(away='focus')), (2.6, view()),
            (3.0, view(full_screen=False)), (3.5, view(rate_hz='10.0')), (3.5, view(rate_hz='?')),
            (4.0, view(away='hidden', device='')), (60.0, view(device='keyboard'))):
        watch.add(told, time_s)
    watch.add(view()._replace(name='cockpit_node: hv0 view'), 61.0)
    assert watch.values() == {
        'stimuli': 0, 'unseen_stimuli': 0, 'view_rate_hz': 60.0, 'away_s': 2.1,
        'windowed_s': 0.5, 'device_changes': 1}


def test_the_link_is_told_by_its_median_and_its_worst_round_trip() -> None:
    watch = DriveWatch('av0')
    for time_s, delay_ms in ((0.0, '900.0'), (1.0, '40.0'), (2.0, '200.0'), (3.0, '180.0'),
                             (4.0, ''), (5.0, 'nan')):
        watch.add(Status.of('cockpit_node: av0 driver', 0, 'Anna', {'round_trip_ms': delay_ms}),
                  time_s)
    values = watch.values()
    assert (values['link_delay_s'], values['link_delay_max_s']) == (0.18, 0.2)
    assert QualityBounds().faults(values, PAGE) == [
        'round trip to the page 180 ms instead of at most 150 ms']
    assert QualityBounds(link_delay_s=None).faults(values, PAGE) == []


def test_a_stimulus_that_no_page_shows_is_unseen() -> None:
    """The second is answered, the third is cut off by the end of the task."""
    watch = DriveWatch('av0')
    watch.add_tasks([entry(1, 'stimulus', 1), entry(300, 'missed', 1, 'unseen')])
    watch.add_tasks([entry(400, 'stimulus', 2), entry(402, 'shown', 2),
                     entry(440, 'answer', 2, 'hit'), entry(700, 'stimulus', 3),
                     entry(800, 'over', 3, 'end')])
    values = watch.values()
    assert (values['stimuli'], values['unseen_stimuli']) == (3, 1)
    assert 'away_s' not in values, 'no page has told anything'
    assert QualityBounds().faults(values, PAGE) == [
        'stimuli that were not shown 1 instead of at most 0']


def test_bounds_are_those_of_the_study() -> None:
    """Null checks nothing; table I is taken in its own units."""
    watch = DriveWatch('av0')
    watch.add_timing(None)
    watch.add_timing({'max_cumulative_error_ms': 120.0, 'resets': 0.0, 'timeout_ratio': None})
    watch.add(view(), 1.0)
    watch.add(view(full_screen=False), 2.0)
    watch.add(view(full_screen=False), 3.0)
    values = watch.values()
    told = QualityBounds().faults(values)
    assert told == ['greatest cumulative error 120 ms instead of at most 100 ms']
    bounds = read(QualityBounds, {'max_cumulative_error_s': None, 'windowed_s': 0.5}, 'quality')
    assert bounds.faults(values) == [
        'page not in full screen 1.0 s instead of at most 0.5 s']
    assert ('greatest cumulative error', 'not checked') in bounds.told()


def test_what_is_beyond_a_bound_marks_repeats_or_stops() -> None:
    """A drive comes again twice at most."""
    kinds = {kind: QualityBounds(beyond=kind) for kind in ('mark', 'repeat', 'stop')}
    assert {bounds.next_step((), 0) for bounds in kinds.values()} == {'count'}
    assert kinds['mark'].next_step(('late',), 0) == 'count'
    assert kinds['stop'].next_step(('late',), 5) == 'stop'
    assert [kinds['repeat'].next_step(('late',), times) for times in range(4)] == [
        'repeat', 'repeat', 'count', 'count']
