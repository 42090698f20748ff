# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Two AVs at once against one human (CRG section IV-B, figures 12 and 13)."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
import time

from crgame_ros.analysis.counterfactual import Alternative
from crgame_ros.analysis.reproduction.expectation import (
    Expectation,
    Finding,
    judge,
    Judgement,
)
from crgame_ros.launcher.arguments import RunRequest
from crgame_ros.launcher.run_plan import effective_game, with_planners
from crgame_ros.recording.run_log import run_log_of, RunLog
from crgame_ros.simulation.offline import run_offline
from crgame_ros.simulation.setup import build_setup
from crgame_ros.vehicle.state import StateColumn
import numpy as np
from numpy.typing import NDArray

# Who is farther from where it would be without the human reacts to it [m]; without one there is
# no difference at all, for runs are deterministic.
REACTS = 1.0
# A step's length and its speeds may differ by this [m]: a vehicle that turns takes the chord, and
# plans are sampled; a jump is a multiple of it.
JUMP = 0.05


@dataclass(frozen=True)
class MultiAvRun:
    """
    A run of several AVs, and the same game without its human.

    :param run: with the human.
    :param alone: without.
    """

    run: Alternative
    alone: RunLog

    def reactions(self) -> dict[str, float]:
        """Return how far each AV got from where it would be without the human [m]."""
        log, alone = self.run.log, self.alone
        _, here, there = np.intersect1d(log.ks, alone.ks, return_indices=True)
        places = {item.id: i for i, item in enumerate(log.vehicles)}
        return {item.id: float(np.hypot(*(
            log.vehicle_states[here, places[item.id], :2]
            - alone.vehicle_states[there, i, :2]).T).max())
            for i, item in enumerate(alone.vehicles)}


def run_alone(game: Path, planner: str, duration_s: float) -> RunLog:
    """
    Drive the AVs of a game without its humans.

    :raises InputError: if game or planner cannot be used.
    """
    setup = build_setup(replace(effective_game(RunRequest(game=game)), humans=()))
    return run_log_of(run_offline(with_planners(setup, (planner,)), duration_s=duration_s,
                                  clock_s=time.perf_counter))


def jumps(log: RunLog) -> NDArray[np.float64]:
    """Return by how much each step's length differs from what its speeds say (K - 1, V) [m]."""
    lengths = np.hypot(*np.moveaxis(np.diff(log.vehicle_states[:, :, :2], axis=0), 2, 0))
    speeds = np.abs(log.vehicle_states[:, :, StateColumn.SPEED])
    expected = 0.5 * (speeds[1:] + speeds[:-1]) * log.game.scheduler.time_step_s
    return np.asarray(np.abs(lengths - expected))


def _reacts(found: MultiAvRun) -> Finding:
    apart = found.reactions()
    return Finding(all(each > REACTS for each in apart.values()), '; '.join(
        f'{av} {each:.1f} m from where it would be' for av, each in apart.items()))


def _no_contact(found: MultiAvRun) -> Finding:
    contacts = found.run.contacts
    if contacts is None:
        return Finding(False, 'nobody looked for contacts')
    return Finding(not contacts, '; '.join(
        f'{item["vehicle"]} with {item["with"]}' for item in contacts) or '0 contacts')


def _one_time_line(found: MultiAvRun) -> Finding:
    log = found.run.log
    whole = bool((np.diff(log.ks) == 1).all() and np.isfinite(log.vehicle_states).all())
    worst = float(jumps(log).max())
    return Finding(whole and worst < JUMP,
                   f'{len(log.ks)} steps of {log.vehicle_states.shape[1]} vehicles'
                   f'{"" if whole else ", some missing"}; a step differs from its speed by '
                   f'{worst:.4f} m at most')


MULTI_AV_EXPECTATIONS: tuple[Expectation[MultiAvRun], ...] = (
    Expectation('each AV reacts', f'Each AV gets more than {REACTS} m from where it is in the '
                'same game without the human: each has a planner of its own, and sees the human.',
                'each AV is controlled by an independent planner instance (IV-B)', _reacts),
    Expectation('no contact', 'Nobody touches anybody.',
                'shown as frames (fig. 12)', _no_contact),
    Expectation('one time line without a jump', 'Every vehicle has a state at every scenario '
                f'step, and a step is as long as its speeds say, within {JUMP} m.',
                'without temporal inconsistencies; consistent and smooth evolution (IV-B)',
                _one_time_line))


def judge_multi_av(runs: Sequence[tuple[str, MultiAvRun]]) -> tuple[Judgement, ...]:
    """Look for what must come out of the multi-AV experiment, in runs with their names."""
    return tuple(each for name, run in runs
                 for each in judge(f'two AVs, {name}', MULTI_AV_EXPECTATIONS, run))
