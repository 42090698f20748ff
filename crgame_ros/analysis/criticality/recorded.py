# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The criticality of a finished run, from its log."""

from collections.abc import Callable

from crgame_ros.analysis.criticality.criticality import Criticality
from crgame_ros.analysis.criticality.thresholds import Thresholds, USUAL
from crgame_ros.game.objects import ObjectStates
from crgame_ros.recording.run_trajectories import RunTrajectories
from crgame_ros.scenario.loading import parse_scenario
from crgame_ros.simulation.observer import documented_run


def measure_log(log: RunTrajectories, thresholds: Thresholds = USUAL,
                progress: Callable[[float], object] = lambda _: None,
                on_tick: Callable[[Criticality], object] = lambda _: None) -> Criticality:
    """
    Measure every scenario step of a run.

    :param log: log of a recording (`read_trajectories`) or an offline run (`trajectories_of`).
    :param progress: called with the share measured so far, 0 to 1.
    :param on_tick: called with the observer after each step, to read its results.
    :raises InputError: if the scenario in the log cannot be used.
    """
    game = log.game
    loaded = parse_scenario(log.xml_text, '/scenario/xml')
    run = documented_run(game, loaded, log.descriptions)
    criticality = Criticality(run, thresholds)
    for row, k in enumerate(log.ks.tolist()):
        n = (k - game.scheduler.k0) * game.scheduler.steps_per_tick
        criticality.observe(n, 0.0, log.published_states[row],
                            ObjectStates(log.object_poses[row], log.object_velocities[row]))
        on_tick(criticality)
        progress((row + 1) / len(log.ks))
    return criticality
