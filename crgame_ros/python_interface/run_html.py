# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Shows a run, or a comparison, as HTML in a notebook."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from html import escape
from typing import Any

from crgame_ros.analysis.counterfactual import Alternative
from crgame_ros.analysis.criticality.criticality import Criticality
from crgame_ros.analysis.measure_command import HEAD, replay_rows
from crgame_ros.analysis.pictures.critical_moments import critical_moments, Touch
from crgame_ros.analysis.pictures.scene_frame import FrameScene
from crgame_ros.analysis.report.story_section import moment_image
from crgame_ros.analysis.report.text import free, NOTHING, number, share, table
from crgame_ros.analysis.scores.plan_record import PlanRecord
from crgame_ros.recording.run_record import RunRecord
from crgame_ros.vehicle.state import StateColumn

_HEAD = ('', 'driven by', 'greatest speed [m/s]', 'least TTC [s]', 'least distance [m]',
         'contacts', 'plans accepted')


@dataclass(frozen=True)
class ShownRun:
    """
    The parts of a run that a notebook shows.

    :param caption: one line.
    :param record: the run.
    :param criticality: of the run.
    :param contacts: as in `timing.json`; None if unknown.
    :param answers: known answers of planners, by AV.
    """

    caption: str
    record: RunRecord
    criticality: Criticality
    contacts: Sequence[Mapping[str, Any]] | None
    answers: Mapping[str, PlanRecord]

    def html(self) -> str:
        """Return the most critical moment from above, and a row for each driven vehicle."""
        return f'<div>{self._picture()}{table(free(self.caption), _HEAD, self._rows())}</div>'

    def _picture(self) -> str:
        vehicles = tuple(item.id for item in self.record.log.vehicles)
        touches = [Touch.from_entry(item) for item in self.contacts or ()
                   if item['n'] is not None]
        moments = critical_moments(self.record, self.criticality, touches) if vehicles else ()
        if not moments:
            return ''
        image = moment_image(FrameScene(self.record.log), moments[0], vehicles)
        return (f'<figure>{image}<figcaption>{number(moments[0].time_s, 1)} s: '
                f'{free(moments[0].why)}</figcaption></figure>')

    def _rows(self) -> Iterator[Sequence[str]]:
        log = self.record.log
        drivers = {item.id: item.driver for item in log.game.humans}
        drivers |= {item.id: item.planner for item in log.game.avs}
        for place, found in enumerate(self.criticality.report()):
            name = found.vehicle_id
            worst = [found.worst.get(key) for key in ('ttc', 'min_distance')]
            touched = None if self.contacts is None else sum(
                name in (item['vehicle'], item['with']) for item in self.contacts)
            answers = self.answers.get(name)
            yield (free(name), free(drivers[name]),
                   number(float(log.vehicle_states[:, place, StateColumn.SPEED].max()), 1),
                   *(number(None if each is None else each.value) for each in worst),
                   NOTHING if touched is None else str(touched),
                   NOTHING if answers is None else share(answers.accepted_share, 1.0))


def replays_html(recorded: Criticality, alternatives: Sequence[Alternative]) -> str:
    """Return the runs of one human against several planners, below the recorded one."""
    found = [{'planner': 'recorded', 'criticality': recorded.as_dict()},
             *(each.as_dict() for each in alternatives)]
    rows = [tuple(map(escape, row)) for row in replay_rows(found)]
    return table('The same human against other planners', HEAD, rows)
