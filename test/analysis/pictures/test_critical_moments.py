# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Critical moments of runs, known by hand."""

from collections.abc import Callable

from crgame_ros.analysis.criticality.recorded import measure_log
from crgame_ros.analysis.pictures.critical_moments import critical_moments, Moment
from crgame_ros.game.events import FiredEvent
from crgame_ros.recording.run_record import RunRecord
from crgame_ros.recording.run_trajectories import RunTrajectories
from crgame_ros.simulation.contacts import ContactEntry
import numpy as np
import pytest

Make = Callable[..., RunTrajectories]


def _record(log: RunTrajectories, *fired: FiredEvent) -> RunRecord:
    return RunRecord(log, np.empty(0, dtype=np.int64), np.empty((0, 2, 4)), fired)


def _approach(straight: Make, steps: int, after: int) -> tuple[RunTrajectories, float]:
    """Drive the human at 10 m/s for some steps of 0.1 s, then stand, from 40 m behind the AV."""
    times_s = 0.1 * np.arange(steps + after)
    x = 300.0 + 10.0 * np.minimum(times_s, 0.1 * steps)
    log = straight(x.tolist(), [10.0] * steps + [0.0] * after, 300.0 + 40.0)
    human, av = log.vehicles
    gap = 40.0 + av.rear_to_center - human.rear_to_center - 0.5 * (
        human.shape.length + av.shape.length)
    return log, gap


def test_the_smallest_ttc_is_the_moment(straight: Make) -> None:
    """It is met at the last step at speed: (gap - 10 m/s 2.9 s) / 10 m/s; distances join it."""
    log, gap = _approach(straight, 30, 40)
    moments = critical_moments(_record(log), measure_log(log))
    ttc_s = (gap - 29.0) / 10.0
    assert 0.0 < ttc_s < 3.0
    first = moments[0]
    assert first.time_s == pytest.approx(2.9)
    assert f'Time to collision (TTC) of hv0 to av0 is {ttc_s:.2f} s' in first.why
    assert set(first.vehicles) == {'hv0', 'av0'}
    # They are nearest at 3.0 s: within a second of it, so it is one moment.
    assert f'hv0 and av0 are {gap - 30.0:.2f} m apart' in first.why and len(moments) == 1


def test_contacts_come_first_events_after_what_is_critical(straight: Make) -> None:
    """This holds for any times; within a second the more critical one includes the other."""
    log, _ = _approach(straight, 30, 40)
    fired = [FiredEvent('brake', 600, 60, 'trigger'), FiredEvent('gone', 300, 30, 'condition')]
    contact: ContactEntry = {
        'vehicle': 'hv0', 'with': 'o7', 'n': 450, 'side': 'front', 'kind': 'stopped_track',
        'speed': 10.0, 'other_speed': 0.0, 'avoidable_by': 'hv0'}
    moments = critical_moments(_record(log, *fired), measure_log(log), [contact])
    assert [each.time_s for each in moments] == pytest.approx([4.5, 2.9, 6.0])
    assert moments[0] == Moment(4.5, 'hv0 and o7 touch', ('hv0', 'o7'))
    assert moments[1].why.endswith('event gone; hv0 and av0 are '
                                   + moments[1].why.split(' are ')[-1])
    assert moments[2].why == 'event brake'


def test_a_touch_is_found_without_recorded_contacts(straight: Make) -> None:
    """It is at the first tick at which the gap is closed."""
    log, gap = _approach(straight, 50, 5)
    (first, *_) = critical_moments(_record(log), measure_log(log))
    assert first.time_s == pytest.approx(np.ceil(gap) / 10.0, abs=0.1)
    assert first.why.startswith('hv0 and av0 touch') and 'inf' not in first.why


def test_where_nothing_happens_there_is_no_moment(straight: Make) -> None:
    """Both stand: their initial distance is no moment."""
    log = straight([300.0] * 10, [0.0] * 10, 340.0)
    assert critical_moments(_record(log), measure_log(log)) == ()
