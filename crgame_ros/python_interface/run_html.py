# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Shows a run, or a comparison, as HTML in a notebook."""

from collections.abc import Iterator, Sequence
from html import escape

from crgame_ros.analysis.counterfactual import Alternative
from crgame_ros.analysis.criticality.criticality import Criticality, MEASURES
from crgame_ros.analysis.measure_command import HEAD, replay_rows
from crgame_ros.analysis.pictures.scene_frame import FrameScene
from crgame_ros.analysis.report.section import free, NOTHING, number, share, table
from crgame_ros.analysis.report.story_section import moment_image
from crgame_ros.analysis.runs.run import Run
from crgame_ros.vehicle.state import StateColumn

_SHOWN = ('ttc', 'min_distance')
_HEAD = ('', 'driven by', 'greatest speed [m/s]', *(MEASURES[name].head for name in _SHOWN),
         'contacts', 'plans accepted')


def run_html(run: Run, caption: str) -> str:
    """
    Return the most critical moment from above, and a row for each driven vehicle.

    :param caption: one line.
    """
    return f'<div>{_picture(run)}{table(free(caption), _HEAD, _rows(run))}</div>'


def _picture(run: Run) -> str:
    if not run.vehicles or not run.moments:
        return ''
    moment = run.moments[0]
    image = moment_image(FrameScene(run.log), moment)
    return (f'<figure>{image}<figcaption>{number(moment.time_s, 1)} s: '
            f'{free(moment.why)}</figcaption></figure>')


def _rows(run: Run) -> Iterator[Sequence[str]]:
    drivers = {item.id: item.driver for item in run.game.humans}
    drivers |= {item.id: item.planner for item in run.game.avs}
    for place, found in enumerate(run.usual_criticality.report()):
        name = found.vehicle_id
        worst = [found.worst.get(key) for key in _SHOWN]
        touched = None if run.contacts is None else sum(
            name in (item['vehicle'], item['with']) for item in run.contacts)
        answers = run.answers.get(name)
        yield (free(name), free(drivers[name]),
               number(float(run.log.vehicle_states[:, place, StateColumn.SPEED].max()), 1),
               *(number(None if each is None else each.value) for each in worst),
               NOTHING if touched is None else str(touched),
               NOTHING if answers is None else share(answers.accepted_share, 1.0))


def replays_html(recorded: Criticality, alternatives: Sequence[Alternative]) -> str:
    """Return the runs of one human against several planners, below the recorded one."""
    found: list[dict[str, object]] = [
        {'planner': 'recorded', 'criticality': recorded.as_dict()},
        *(each.as_dict() for each in alternatives)]
    rows = [tuple(map(escape, row)) for row in replay_rows(found)]
    return table('The same human against other planners', HEAD, rows)
