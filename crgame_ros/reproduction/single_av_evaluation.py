# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Repeats one recorded human against two planners (CRG section IV-A, figures 8 to 11)."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
import time
from typing import NamedTuple

from crgame_ros.analysis.counterfactual import Alternative
from crgame_ros.geometry.curve import Curve
from crgame_ros.launcher.arguments import RunRequest
from crgame_ros.launcher.run_plan import effective_game, with_planners
from crgame_ros.recording.run_trajectories import RunTrajectories, trajectories_of
from crgame_ros.reproduction.expectation import Expectation, Finding, judge, Judgement
from crgame_ros.roads.network import RoadNetwork
from crgame_ros.scenario.loading import parse_scenario
from crgame_ros.simulation.offline import run_offline
from crgame_ros.simulation.setup import build_setup
from crgame_ros.vehicle.state import StateColumn
import numpy as np
from numpy.typing import NDArray

# A vehicle that stays within this of its lane's centre line neither changes lanes nor swerves: a
# car of 2 m in a lane of 3.75 m has 0.87 m on either side [m].
IN_LANE = 0.5
# Below this speed a vehicle counts as standing: a metre in ten seconds [m/s].
STANDING = 0.1
# An AV that deviates by more from its run without the human reacts to the human [m]. Without a
# reaction there is no difference at all, because runs are deterministic.
REACTS = 1.0
# Tolerance between a step's length and the distance by its speeds [m]: the step of a turning
# vehicle is a chord, and plans are sampled. A jump is a multiple of it.
JUMP = 0.05
# Length to which the lane is followed [m]: longer than any game.
_ALONG = 2000.0
# A vehicle has passed another with this lead [m].
_PASSED = 8.0


class DrivenLane:
    """
    The lane of a vehicle's start and its straightest continuation.

    :param log: a run.
    :param vehicle: index of the vehicle among the driven ones.
    :ivar width: width of the lane at the start [m]
    :ivar along: (K, V) arc lengths of the rear axles [m]
    :ivar across: (K, V) their lateral offsets from the centre line, left positive [m]
    :raises InputError: if the scenario in the log cannot be used.
    """

    def __init__(self, log: RunTrajectories, vehicle: int) -> None:
        loaded = parse_scenario(log.xml_text, '/scenario/xml')
        roads = RoadNetwork(loaded.scenario.lanelet_network)
        x, y, yaw = log.vehicle_states[0, vehicle, :StateColumn.YAW + 1].tolist()
        lanelet = roads.nearest_lanelet(x, y, yaw)
        self.width = roads.width_at(lanelet, roads.locate(lanelet, x, y)[0])
        line = Curve.from_polyline(roads.lane_path(lanelet, _ALONG))
        places = log.vehicle_states[:, :, :StateColumn.YAW]
        along, across = line.project(places.reshape(-1, 2))
        self.along: NDArray[np.float64] = along.reshape(places.shape[:2])
        self.across: NDArray[np.float64] = across.reshape(places.shape[:2])


FloatArray = NDArray[np.float64]


class Encounter:
    """
    The behaviour of one AV in a run with one human.

    :param alternative: the run.
    :param av: id of the AV.
    """

    def __init__(self, alternative: Alternative, av: str) -> None:
        self.alternative = alternative
        self.av = av
        ids = [item.id for item in alternative.log.vehicles]
        self._place = ids.index(av)
        self.human = ids[0]

    @cached_property
    def lane(self) -> DrivenLane:
        """Return the lane in which the AV started."""
        return DrivenLane(self.alternative.log, self._place)

    @property
    def speeds(self) -> FloatArray:
        """Return the speeds of the AV (K) [m/s]."""
        return self.alternative.log.vehicle_states[:, self._place, StateColumn.SPEED]

    @property
    def deviation(self) -> float:
        """Return the greatest distance of the AV's rear axle from its lane's centre line [m]."""
        return float(np.abs(self.lane.across[:, self._place]).max())

    @property
    def lead(self) -> float:
        """Return the AV's lead over the human at the end, by rear axles along the lane [m]."""
        last = self.lane.along[-1]
        return float(last[self._place] - last[0])

    @cached_property
    def steps(self) -> tuple[int, int]:
        """
        Return the rows of the encounter: from the human's cut-in to the AV's answer.

        It begins when the human's rear axle enters the AV's lane, and ends when the AV stands or
        is ahead again; without either it is the whole run.
        """
        inside = np.abs(self.lane.across[:, 0]) < 0.5 * self.lane.width
        begin = int(np.argmax(inside))
        lead = self.lane.along[:, self._place] - self.lane.along[:, 0]
        answered = (self.speeds < STANDING) | (lead > _PASSED)
        answered[:begin] = False
        return begin, int(np.argmax(answered)) if answered.any() else len(answered) - 1

    @property
    def least_gap(self) -> float | None:
        """Return the smallest bumper-to-bumper gap to the human ahead; None: never behind [m]."""
        return self._worst('gap')

    @property
    def least_distance(self) -> float | None:
        """Return the smallest distance of the outlines of AV and human; None: never near [m]."""
        return self._worst('min_distance')

    @property
    def contacts(self) -> int | None:
        """Return the number of contacts of the AV; None if it is unknown."""
        found = self.alternative.contacts
        return None if found is None else sum(
            self.av in (item['vehicle'], item['with']) for item in found)

    def as_dict(self) -> dict[str, float | int | str | None]:
        """Return the numbers as a JSON-compatible dictionary."""
        return {
            'av': self.av, 'final_speed': float(self.speeds[-1]),
            'least_speed': float(self.speeds.min()), 'lane_deviation': self.deviation,
            'lane_width': self.lane.width, 'final_lead': self.lead,
            'least_gap': self.least_gap, 'least_distance': self.least_distance,
            'contacts': self.contacts}

    def _worst(self, measure: str) -> float | None:
        report = self.alternative.usual_criticality.report()
        worst = next(item for item in report if item.vehicle_id == self.av).worst.get(measure)
        return worst.value if worst is not None and worst.other == self.human else None


def _human_states(log: RunTrajectories) -> FloatArray:
    """Return the published states (K, H, 8) of the humans."""
    return log.published_states[:, :len(log.game.humans)]


class SameHuman(NamedTuple):
    """
    Runs in which the human must be identical.

    :param recorded: the run in which the inputs were recorded.
    :param runs: runs that repeat these inputs.
    """

    recorded: RunTrajectories
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
    """Return the finding on contacts of the AV."""
    if found.contacts is None:
        return Finding(False, 'contacts were not checked')
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
    first = _human_states(found.runs[0].log)
    for other in found.runs[1:]:
        states = _human_states(other.log)
        if states.shape != first.shape or states.tobytes() != first.tobytes():
            return Finding(False, f'differs between {found.runs[0].planner} and {other.planner}')
    recorded = _human_states(found.recorded)
    common = min(len(recorded), len(first))
    # Positions and headings are recorded as they were, speeds as components in x and y.
    apart = np.abs(recorded[:common] - first[:common]).max(axis=(0, 1))
    exact = bool((apart[:3] == 0.0).all())
    return Finding(exact, f'at {first.shape[0]} scenario steps the same to the last bit, and at '
                   f'most {apart[:3].max():.1e} from where the recording has it')


NO_CONTACT = Expectation(
    'no contact', 'The AV touches no other: both planners are said to keep clear.',
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
                'every planner, and its poses equal those of the recording: only then do '
                'differences result from the planners alone.',
                'the HV applies a consistent set of challenging maneuvers (IV-A)', _same),)


def judge_single_av(recorded: RunTrajectories, idm: Alternative, reactive: Alternative,
                    live: Alternative | None = None) -> tuple[Judgement, ...]:
    """
    Judge the expectations of the single-AV experiment.

    :param recorded: the run that was recorded.
    :param idm: the same human against the planner that replaces the IDM planner.
    :param reactive: the same human against the planner that replaces the reactive planner.
    :param live: the recorded run itself, if it was live; its planner is the first one.
    """
    av = recorded.game.avs[0].id
    return (
        *(() if live is None else
          judge('one AV, IDM, live', IDM_EXPECTATIONS, Encounter(live, av))),
        *judge('one AV, IDM', IDM_EXPECTATIONS, Encounter(idm, av)),
        *judge('one AV, reactive', REACTIVE_EXPECTATIONS, Encounter(reactive, av)),
        *judge('one AV, both', HUMAN_EXPECTATIONS, SameHuman(recorded, (idm, reactive))))


@dataclass(frozen=True)
class MultiAvRun:
    """
    A run of several AVs, and the same game without its human.

    :param run: run with the human.
    :param alone: without.
    """

    run: Alternative
    alone: RunTrajectories

    def reactions(self) -> dict[str, float]:
        """Return the greatest deviation of each AV from its run without the human [m]."""
        log, alone = self.run.log, self.alone
        _, here, there = np.intersect1d(log.ks, alone.ks, return_indices=True)
        places = {item.id: i for i, item in enumerate(log.vehicles)}
        return {item.id: float(np.hypot(*(
            log.vehicle_states[here, places[item.id], :2]
            - alone.vehicle_states[there, i, :2]).T).max())
            for i, item in enumerate(alone.vehicles)}


def run_alone(game: Path, planner: str, duration_s: float) -> RunTrajectories:
    """
    Drive the AVs of a game without its humans.

    :raises InputError: if game or planner cannot be used.
    """
    setup = build_setup(replace(effective_game(RunRequest(game=game)), humans=()))
    return trajectories_of(run_offline(with_planners(setup, (planner,)), duration_s=duration_s,
                                       clock_s=time.perf_counter))


def jumps(log: RunTrajectories) -> NDArray[np.float64]:
    """Return the differences (K - 1, V) of step lengths from the distances by speed [m]."""
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
        return Finding(False, 'contacts were not checked')
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
    Expectation('no contact', 'No vehicle touches another.',
                'shown as frames (fig. 12)', _no_contact),
    Expectation('one time line without a jump', 'Every vehicle has a state at every scenario '
                f'step, and a step is as long as its speeds say, within {JUMP} m.',
                'without temporal inconsistencies; consistent and smooth evolution (IV-B)',
                _one_time_line))


def judge_multi_av(runs: Sequence[tuple[str, MultiAvRun]]) -> tuple[Judgement, ...]:
    """Judge the expectations of the multi-AV experiment, for runs by their names."""
    return tuple(each for name, run in runs
                 for each in judge(f'two AVs, {name}', MULTI_AV_EXPECTATIONS, run))
