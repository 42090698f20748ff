# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The section of a report on the tasks that drivers had besides driving."""

from collections.abc import Iterator, Sequence

from crgame_ros.analysis.behaviour.detection_score import detection_scores
from crgame_ros.analysis.behaviour.task_events import task_events, TaskEvent
from crgame_ros.analysis.report.report_run import ReportRun
from crgame_ros.analysis.report.report_section import Section
from crgame_ros.analysis.report.report_text import free, note, number, table
from crgame_ros.analysis.report.run_section import named
from crgame_ros.analysis.report.story_section import moment


def task_section(run: ReportRun) -> Section | None:
    """Show answers to lights, requests and what else lasted; None of a game without tasks."""
    events = task_events(run.record)
    if not events:
        return None
    html = note('Response times are of the page that showed the light, from the picture in which '
                'it was first seen. Those of requests are of the run, until the first input.')
    for rows, caption, head in (
            (_scores(run, events), 'Detection response tasks (ISO 17488)', (
                'task', 'driver', 'hits', 'misses', 'premature', 'unrequested', 'hit rate',
                'response time, mean [s]', 'standard deviation [s]', 'median [s]')),
            (_requests(run, events), 'Requests to take over', (
                'task', 'vehicle', 'at [s]', 'seen after [ms]', 'first input after [s]')),
            (_spans(run, events), 'What lasted', ('task', 'driver', 'from [s]', 'for [s]'))):
        told = list(rows)
        if told:
            html += table(caption, head, told, 'numbers')
    return Section('tasks', 'Tasks besides driving', html)


def _scores(run: ReportRun, events: Sequence[TaskEvent]) -> Iterator[Sequence[str]]:
    for score in detection_scores(events):
        yield (free(score.task), named(run, score.seat), str(score.hits), str(score.misses),
               str(score.premature), str(score.unrequested), number(score.hit_rate),
               number(score.response_mean_s), number(score.response_sd_s),
               number(score.response_median_s))


def _requests(run: ReportRun, events: Sequence[TaskEvent]) -> Iterator[Sequence[str]]:
    for event in events:
        if event.what == 'request':
            yield (free(event.name), named(run, event.seat), moment(run, event.onset_s),
                   number(event.times.delay_ms, 0), number(event.response_time_s))


def _spans(run: ReportRun, events: Sequence[TaskEvent]) -> Iterator[Sequence[str]]:
    for event in events:
        if event.what == 'span':
            yield (free(event.name), named(run, event.seat), moment(run, event.onset_s),
                   number(event.duration_s, 1))
