# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A run to report: offline, with a malicious title."""

from dataclasses import replace
import json
from typing import Any

from crgame_ros.analysis.runs.run import Run
from crgame_ros.game.game import Game, load_game
from crgame_ros.paths import scenarios_directory
from crgame_ros.recording.recorded_game import recorded_inputs
from crgame_ros.recording.run_record import run_record_of
from crgame_ros.simulation.offline import run_offline
from crgame_ros.simulation.setup import build_setup
from crgame_ros.timing.measures import TIMING_MEASURES
import pytest

HOSTILE = '</title><script>alert(1)</script> "quoted" \'too\' 🚗 \u202eesrever & <b>bold</b>'
# Possible output of `timing_report`: strings from a recording are not trusted.
TIMING: dict[str, Any] = {
    **dict.fromkeys((key for key in TIMING_MEASURES if not key.startswith('real_time_ratio')),
                    0.5),
    'late_steps': {
        'threshold_ms': 0.5, 'count': 2, 'late_ms': 340.0, 'resets_from_outside': 0,
        'resets_of_ours': 1, 'by_cause': {
            'processor': {'ms': 30.0, 'steps': 1, 'resets': 0},
            'gc': {'ms': 310.0, 'steps': 1, 'resets': 1}, 'work': {'ms': 0.0, 'steps': 0,
                                                                   'resets': 0}},
        'worst': [{'late_ms': 310.0, 'text': '310.0 ms late, <b>they</b> said'}]},
    'real_time_ratio': {'final': 1.0, 'mean': 1.0, 'min': 0.25},
    'planners': {'av0': {
        'requests': 20, 'accepted': 17, 'refused': 2, 'timed_out': 1, 'skipped': 0, 'fallback': 3,
        'realigned': 0, 'plans': 20, 'fallback_reasons': None, 'age_ms': None,
        'worst_tracking_errors': None, 'steps_without_plan': 0,
        'last_refusal': '<img src=x onerror=alert(2)>',
        'latency_ms': {'p50': 4.5, 'p99': 9.25, 'max': 11.0}, 'plan_time_ms': None,
        'first_latency_ms': 100.0}},
    'drivability': {'violations': 1, 'list': [
        {'n': 510, 'vehicle': 'hv0', 'what': 'off the <i>road</i>'}]},
    'contacts': [], 'notices': ['<script>alert(3)</script>']}


@pytest.fixture(scope='session')
def game() -> Game:
    """Return the cut-in."""
    return load_game(scenarios_directory() / 'cut_in.yaml')


@pytest.fixture(scope='session')
def run(game: Game) -> Run:
    """Drive it for 10 s: the human cuts in after 5, and brakes."""
    setup = build_setup(replace(game, title=HOSTILE))
    drivers, _ = recorded_inputs(setup)
    record = run_record_of(run_offline(setup, drivers=drivers, duration_s=10.0))
    return Run('a <b>run</b>', record=record, timing=json.loads(json.dumps(TIMING)))
