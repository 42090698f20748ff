# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What people in the seats see, hear and feel, told on /diagnostics and so recorded."""

from collections.abc import Iterable, Mapping
import time
from typing import NamedTuple

from crgame_ros.cockpit.client import Client, Sound
from crgame_ros.cockpit.held_seat import HeldSeat
from crgame_ros.cockpit.seen_view import SeenView
from crgame_ros.ros.diagnostics import Diagnostics
from diagnostic_msgs.msg import DiagnosticStatus

PERIOD_S = 1.0


class _Told(NamedTuple):
    state: Sound | SeenView
    at_s: float


class PageReport:
    """
    Tells of the page of each held seat how it sounds and what it shows: each second, at a change.

    :param diagnostics: of the node.
    """

    def __init__(self, diagnostics: Diagnostics) -> None:
        self._diagnostics = diagnostics
        self._told: dict[str, _Told] = {}

    def tell(self, seats: Iterable[HeldSeat], clients: Mapping[str, Client],
             stamp_ns: int) -> None:
        """
        Publish what has changed, and what has not been told for a second.

        :param clients: by id.
        :param stamp_ns: simulation time [ns]
        """
        now_s = time.monotonic()
        told = {}
        for seat in seats:
            client = clients.get(seat.holder)
            if client is None:
                continue
            for subject, state in ((f'{seat.id} sound', client.sound),
                                   (f'{seat.id} view', client.view)):
                before = self._told.get(subject)
                if before is not None and state == before.state \
                        and now_s - before.at_s < PERIOD_S:
                    told[subject] = before
                    continue
                told[subject] = _Told(state, now_s)
                text, values = _words(state)
                self._diagnostics.publish(f'cockpit_node: {subject}', DiagnosticStatus.OK, text,
                                          values, stamp_ns)
        self._told = told


def _words(state: Sound | SeenView) -> tuple[str, dict[str, object]]:
    if isinstance(state, Sound):
        return 'sounds' if state.on else 'is silent', {
            'on': state.on, 'volume': f'{state.volume:.2f}', 'rumble': f'{state.rumble:.2f}'}
    return f'shows {state.shown or "nothing yet"}', {
        'shown': state.shown, 'inset': state.inset, 'plans': state.plans,
        'mirrors': state.mirrors, 'bare': state.bare, 'across_deg': _number(state.across_deg, 1),
        'screen_width_m': _number(state.screen_width_m, 3),
        'eye_distance_m': _number(state.eye_distance_m, 3),
        'width_px': _number(state.width_px, 0), 'height_px': _number(state.height_px, 0),
        'ratio': _number(state.ratio, 3), 'rate_hz': _number(state.rate_hz, 1),
        'renderer': state.renderer, 'software': state.software}


def _number(value: float | None, digits: int) -> str:
    return '' if value is None else f'{value:.{digits}f}'
