# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""One recorded human against two planners of one AV (CRG section IV-A, figures 8 to 11)."""

from collections.abc import Sequence
from typing import NamedTuple

from crgame_ros.analysis.counterfactual import Alternative
from crgame_ros.analysis.reproduction.encounter import Encounter, human_states
from crgame_ros.analysis.reproduction.expectation import (
    Expectation,
    Finding,
    judge,
    Judgement,
)
from crgame_ros.recording.run_log import RunLog
import numpy as np

# Who stays within this of the middle of a lane neither changes it nor swerves: a car of 2 m in a
# lane of 3.75 m has 0.87 m on either side [m].
IN_LANE = 0.5
# Slower is standing: a metre in ten seconds [m/s].
STANDING = 0.1


class SameHuman(NamedTuple):
    """
    Runs in which the human must be the same.

    :param recorded: the run from which its inputs are.
    :param runs: those that repeat them.
    """

    recorded: RunLog
    runs: Sequence[Alternative]


def _in_lane(found: Encounter) -> Finding:
    return Finding(found.deviation < IN_LANE,
                   f'at most {found.deviation:.2f} m from the middle of its lane')


def _stops(found: Encounter) -> Finding:
    return Finding(abs(found.speeds[-1]) < STANDING, f'{found.speeds[-1]:.2f} m/s at the end')


def _behind(found: Encounter) -> Finding:
    gap = found.least_gap
    if gap is None:
        return Finding(False, 'was never behind the human')
    return Finding(gap > 0.0 and found.lead < 0.0,
                   f'smallest gap {gap:.2f} m; {-found.lead:.2f} m behind at the end')


def no_contact(found: Encounter) -> Finding:
    """Find contacts of the AV with anybody."""
    if found.contacts is None:
        return Finding(False, 'nobody looked for contacts')
    near = '' if found.least_distance is None else f', {found.least_distance:.2f} m at least'
    return Finding(found.contacts == 0, f'{found.contacts} contacts{near}')


def _leaves_lane(found: Encounter) -> Finding:
    return Finding(found.deviation > 0.5 * found.lane.width,
                   f'{found.deviation:.2f} m across, half a lane being '
                   f'{0.5 * found.lane.width:.2f} m')


def _passes(found: Encounter) -> Finding:
    where = 'ahead' if found.lead > 0.0 else 'behind'
    return Finding(found.lead > 0.0, f'{abs(found.lead):.1f} m {where} at the end')


def _goes_on(found: Encounter) -> Finding:
    least = float(found.speeds.min())
    return Finding(least > STANDING, f'never below {least:.1f} m/s')


def _same(found: SameHuman) -> Finding:
    first = human_states(found.runs[0].log)
    for other in found.runs[1:]:
        states = human_states(other.log)
        if states.shape != first.shape or states.tobytes() != first.tobytes():
            return Finding(False, f'differs between {found.runs[0].planner} and {other.planner}')
    recorded = human_states(found.recorded)
    common = min(len(recorded), len(first))
    # A recording holds joints: positions and heading as they were, speeds in x and y.
    apart = np.abs(recorded[:common] - first[:common]).max(axis=(0, 1))
    exact = bool((apart[:3] == 0.0).all())
    return Finding(exact, f'at {first.shape[0]} scenario steps the same to the last bit, and at '
                   f'most {apart[:3].max():.1e} from where the recording has it')


NO_CONTACT = Expectation(
    'no contact', 'The AV touches nobody: both planners are said to keep clear.',
    'to maintain a safe gap (fig. 8); closer and more dynamic interaction (IV-A2)', no_contact)
IDM_EXPECTATIONS: tuple[Expectation[Encounter], ...] = (
    Expectation('stays in its lane', f'The AV comes no farther than {IN_LANE} m from the middle '
                'of its lane: an IDM has no other degree of freedom than along it.',
                'the AV decelerates (fig. 8), no lane change', _in_lane),
    Expectation('comes to a stop', f'At the end the AV is slower than {STANDING} m/s: the human '
                'stands in its lane.', 'driven to decelerate and come to a stop (IV-A1)', _stops),
    Expectation('keeps a gap behind the human', 'The gap to the human is positive throughout, and '
                'the AV is behind it at the end.', 'stops to maintain a safe gap (fig. 8)',
                _behind),
    NO_CONTACT)
REACTIVE_EXPECTATIONS: tuple[Expectation[Encounter], ...] = (
    Expectation('leaves its lane', 'The AV comes farther from the middle of its lane than half '
                "the lane's width: its rear axle is in another lane.",
                'executes a lane-change maneuver in this scenario (IV-A2)', _leaves_lane),
    Expectation('passes the human', 'At the end the AV is ahead of the human, which stands.',
                'the AV executing a lane change while interacting with the HV (fig. 10)', _passes),
    Expectation('does not stop', f'The AV is always faster than {STANDING} m/s: it went around '
                'what the other planner waits behind.', 'shown as a velocity profile (fig. 11)',
                _goes_on),
    NO_CONTACT)
HUMAN_EXPECTATIONS: tuple[Expectation[SameHuman], ...] = (
    Expectation('the same human', 'The states of the human are the same to the last bit against '
                'every planner, and its poses those of the recording: only then is what differs '
                "the planners' doing.",
                'the HV applies a consistent set of challenging maneuvers (IV-A)', _same),)


def judge_single_av(recorded: RunLog, idm: Alternative, reactive: Alternative,
                    live: Alternative | None = None) -> tuple[Judgement, ...]:
    """
    Look for what must come out of the single-AV experiment.

    :param recorded: the run that was recorded.
    :param idm: the same human against the planner in the place of the IDM planner.
    :param reactive: and against that in the place of the reactive planner.
    :param live: the recorded run itself, if it was live; it is one against the first planner.
    """
    av = recorded.game.avs[0].id
    return (
        *(() if live is None else
          judge('one AV, IDM, live', IDM_EXPECTATIONS, Encounter(live, av))),
        *judge('one AV, IDM', IDM_EXPECTATIONS, Encounter(idm, av)),
        *judge('one AV, reactive', REACTIVE_EXPECTATIONS, Encounter(reactive, av)),
        *judge('one AV, both', HUMAN_EXPECTATIONS, SameHuman(recorded, (idm, reactive))))
