# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The offline runner: ideal planners at every latency, exact repetition, replay."""

from dataclasses import replace
import math
from typing import ClassVar

from crgame_ros.driver.source import DriverSource, ReplayDriver
from crgame_ros.errors import InputError
from crgame_ros.game.game import AvSpec, DrivabilitySpec, HumanSpec, load_game
from crgame_ros.messages.plan import Plan, PlanRequest
from crgame_ros.paths import scenarios_directory
from crgame_ros.planner.interface import Planner, PlannerContext
from crgame_ros.scenario.loading import LoadedScenario
from crgame_ros.simulation.offline import OfflineResult, run_offline
from crgame_ros.simulation.setup import build_setup, Setup
from crgame_ros.vehicle.driver_command import DriverCommand
import numpy as np
import pytest
import simulation_support as support
from simulation_support import Array


class IdealPlanner(Planner):
    """
    A planner that continues from the request without any error.

    :param acceleration: held, when negative down to a stop [m/s^2]
    :param curvature: of the circle that it drives on [1/m]
    """

    name: ClassVar[str] = 'ideal'

    def __init__(self, acceleration: float = 0.0, curvature: float = 0.0) -> None:
        self._acceleration = acceleration
        self._curvature = curvature

    def setup(self, context: PlannerContext) -> None:
        """Do nothing."""

    def plan(self, request: PlanRequest) -> Plan:
        """Continue for 4 s."""
        return Plan(request.stamp_ns, support.arc(request.ego, self._acceleration,
                                                  self._curvature))


IDEAL = f'{__file__}:IdealPlanner'
COURSES = {
    'constant': {}, 'accelerating': {'acceleration': 1.0},
    'circle': {'curvature': 0.02}, 'braking': {'acceleration': -1.0}}


class Weaving(DriverSource):
    """A driver whose commands change at every cycle and are no float32 numbers."""

    def command(self, n: int, dt_s: float) -> DriverCommand:
        """Return the command of cycle n."""
        return DriverCommand(0.3 + 0.2 * math.sin(0.1 * n), 0.0, 0.1 * math.sin(0.037 * n))


def ideal_setup(loaded: LoadedScenario, course: str, **timing: object) -> Setup:
    """Make a run of one AV that starts at 10 m/s behind the ideal planner."""
    return support.setup_of(support.moved(loaded, 10.0),
                            avs=support.av_of(IDEAL, options=COURSES[course]),
                            # The circle leaves the road, which must not be a reason to refuse it.
                            drivability=DrivabilitySpec(road=False), **timing)


def ways(result: OfflineResult) -> Array:
    """Return the distance of each step along the heading, negative backwards [m]."""
    states = result.states_of('av0')
    moves = np.diff(states[:, :2], axis=0)
    heading = np.stack((np.cos(states[:-1, 2]), np.sin(states[:-1, 2])), axis=1)
    return np.copysign(np.hypot(*moves.T), np.einsum('ij,ij->i', moves, heading))


@pytest.mark.matrix(
    'constant-200.0-0', 'accelerating-400.0-1', 'circle-200.0-3', 'braking-50.0-12')
@pytest.mark.slow
@pytest.mark.parametrize('latency', range(13))
@pytest.mark.parametrize(('course', 'distance'), [
    ('constant', 200.0), ('accelerating', 400.0), ('circle', 200.0), ('braking', 50.0)])
def test_av_covers_the_right_distance(cut_in: LoadedScenario, course: str, distance: float,
                                      latency: int) -> None:
    """
    In 20 s from 10 m/s within 1 % of v t + a t^2 / 2, without a backward step.

    While braking, the last request before the stop is answered late; the bound allows for it.
    """
    result = run_offline(ideal_setup(cut_in, course), duration_s=20.0, latency_steps=latency,
                         check_drivability=False)
    steps = ways(result)
    assert len(steps) == 2000
    assert steps.min() >= 0.0
    assert steps.sum() == pytest.approx(distance, rel=0.01)
    counters = result.planners['av0'].counters
    assert counters.refused == 0
    assert counters.steps_without_plan == 0
    # No step is longer than the speed allows: no jump makes up for lost distance.
    assert steps.max() <= result.states_of('av0')[:, 3].max() * support.DT * 1.001


@pytest.mark.matrix('1-1000.0', '12-5.0')
@pytest.mark.slow
@pytest.mark.parametrize('rate', [5.0, 10.0, 20.0, 30.0, 1000.0])
@pytest.mark.parametrize('latency', [0, 1, 12])
def test_distance_at_other_rates(cut_in: LoadedScenario, rate: float, latency: int) -> None:
    """Down to one simulation step a scenario step, where a step is longer than 0.5 m."""
    result = run_offline(ideal_setup(cut_in, 'constant', rate=rate), duration_s=10.0,
                         latency_steps=latency, check_drivability=False)
    steps = ways(result)
    assert steps.min() >= 0.0
    assert steps.sum() == pytest.approx(100.0, rel=0.01)


def test_as_printed_the_av_never_moves(cut_in: LoadedScenario) -> None:
    """CRG 15 and 16 as printed, behind an ideal planner that answers every tick."""
    setup = ideal_setup(cut_in, 'constant', realign='nearest', sample='floor')
    result = run_offline(setup, duration_s=20.0, check_drivability=False)
    assert result.planners['av0'].counters.accepted == 200
    assert (ways(result) == 0.0).all()


def test_latency_skips_the_ticks_in_between(cut_in: LoadedScenario) -> None:
    """
    An answer 12 steps late leaves the planner busy at every second tick.

    An answer at the next tick also comes after that tick's decision.
    """
    for latency, asked in ((0, 101), (9, 101), (10, 51), (12, 51), (19, 51), (25, 34)):
        result = run_offline(ideal_setup(cut_in, 'constant'), duration_s=10.0,
                             latency_steps=latency, check_drivability=False)
        counters = result.planners['av0'].counters
        assert counters.requests + counters.skipped == 101
        assert abs(counters.requests - asked) <= 1
        # Delivered `latency` steps after the request, followed from the step after.
        assert counters.last_latency_steps == latency + 1


def test_equal_inputs_give_equal_states() -> None:
    """The whole cut-in game twice: the same hash and the same bits."""
    game = load_game(scenarios_directory() / 'cut_in.yaml')
    first, second = (run_offline(build_setup(game), duration_s=8.0) for _ in range(2))
    assert first.state_hash == second.state_hash
    assert first.vehicle_states.tobytes() == second.vehicle_states.tobytes()
    assert first.commands.tobytes() == second.commands.tobytes()


def test_hash_tells_any_difference(cut_in: LoadedScenario) -> None:
    """One command differs by a float32 rounding step, in one cycle."""
    setup = support.setup_of(cut_in, [support.BESIDE], avs=())
    commands = np.zeros((100, 4))
    commands[:, 0] = 0.5
    other = commands.copy()
    other[57, 0] = np.nextafter(np.float32(0.5), np.float32(1.0))
    hashes = [run_offline(setup, duration_s=1.0, drivers={'hv0': ReplayDriver(values)},
                          check_drivability=False).state_hash
              for values in (commands, commands, other)]
    assert hashes[0] == hashes[1]
    assert hashes[0] != hashes[2]


def test_latency_and_planner_change_the_hash(cut_in: LoadedScenario) -> None:
    """The AV's states count as well as the human's."""
    hashes = {run_offline(ideal_setup(cut_in, course), duration_s=2.0, latency_steps=latency,
                          check_drivability=False).state_hash
              for course, latency in (('constant', 0), ('accelerating', 0), ('accelerating', 7))}
    assert len(hashes) == 3


def test_replay_of_commands_and_intervals_is_exact(cut_in: LoadedScenario) -> None:
    """Commands as consumed and measured intervals repeat the human's states bit for bit."""
    setup = support.setup_of(cut_in, [support.BESIDE], avs=())
    intervals = np.random.default_rng(51).uniform(0.0001, 0.05, 500)
    original = run_offline(setup, duration_s=5.0, drivers={'hv0': Weaving()},
                           intervals_s=intervals, check_drivability=False)
    consumed = original.commands[1:]
    replay = run_offline(setup, duration_s=5.0, intervals_s=intervals, check_drivability=False,
                         drivers={'hv0': ReplayDriver(consumed[:, 0])})
    assert replay.states_of('hv0').tobytes() == original.states_of('hv0').tobytes()
    # The commands were rounded to what a message holds, and the intervals were used.
    assert (consumed == consumed.astype(np.float32)).all()
    nominal = run_offline(setup, duration_s=5.0, check_drivability=False,
                          drivers={'hv0': ReplayDriver(consumed[:, 0])})
    assert nominal.states_of('hv0').tobytes() != original.states_of('hv0').tobytes()


def test_replayed_human_is_the_same_against_another_planner(cut_in: LoadedScenario) -> None:
    """The counterfactual run: same human, other AV."""
    runs = [run_offline(support.setup_of(cut_in, [support.BESIDE], avs=support.av_of(
        IDEAL, options=options)), duration_s=3.0, drivers={'hv0': Weaving()})
        for options in ({}, {'acceleration': 1.5})]
    assert (runs[0].states_of('hv0') == runs[1].states_of('hv0')).all()
    assert runs[1].states_of('av0')[-1, 0] - runs[0].states_of('av0')[-1, 0] == pytest.approx(
        0.5 * 1.5 * 9.0, rel=0.01)


def test_objects_are_where_they_were_recorded(traffic: LoadedScenario) -> None:
    """At every tick the pose of the CommonRoad scenario at k, to the last bit."""
    setup = support.setup_of(traffic, [support.BESIDE], avs=())
    result = run_offline(setup, duration_s=4.0, check_drivability=False)
    assert result.object_poses.shape == (41, len(setup.obstacles.descriptions), 3)
    checked = 0
    for index, description in enumerate(setup.obstacles.descriptions):
        obstacle = traffic.scenario.obstacle_by_id(int(description.id[1:]))
        for k in range(41):
            state = obstacle.state_at_time(k)
            if state is not None:
                assert result.object_poses[k, index].tolist() == [
                    *state.position, state.orientation]
                checked += 1
    assert checked > 100


def test_human_reaches_its_result_without_a_planning_problem(cut_in: LoadedScenario) -> None:
    """Coasting from 15 m/s the human covers a little less than 15 m in the first second."""
    alone = replace(cut_in, planning_problems=())
    result = run_offline(support.setup_of(alone, [support.BESIDE]), duration_s=1.0)
    assert result.setup.vehicle_ids == ('hv0',)
    assert result.planners == {}
    travelled = result.states_of('hv0')[-1, 0] - result.states_of('hv0')[0, 0]
    assert 14.8 < travelled < 15.0


@pytest.mark.parametrize('driver', ['evdev', 'joy', 'replay:bag'])
def test_driver_that_needs_a_person_is_refused(cut_in: LoadedScenario, driver: str) -> None:
    """The message says what works offline."""
    human = HumanSpec('hv0', driver, spawn=support.BESIDE.spawn)
    with pytest.raises(InputError, match='hv0: driver.*offline, use keys:FILE'):
        run_offline(support.setup_of(cut_in, [human], avs=()), duration_s=1.0)


@pytest.mark.parametrize('duration', [0.0, -1.0, math.nan])
def test_duration_must_be_positive(cut_in: LoadedScenario, duration: float) -> None:
    """Empty and endless runs are refused."""
    with pytest.raises(InputError, match='duration'):
        run_offline(support.setup_of(cut_in, [support.BESIDE], avs=()), duration_s=duration)


def test_an_av_put_on_its_lane_drives_where_its_planner_believes(cut_in: LoadedScenario) -> None:
    """
    Declared 1.5 m to the left of the lane that the simulator puts it on (CRG 6-10 and 28).

    Its planner leads it to the middle of the lane. In the shared coordinates it is then 1.5 m to
    the right, with its wheels off the road. In the planner's coordinates, and by CRG 28, it is on
    the road. In these coordinates both spawns give the same drive.
    """
    declared = support.moved(cut_in, 15.0, (0.0, 1.5))
    runs = {spawn: run_offline(support.setup_of(declared, avs=(
        AvSpec('av0', spawn=spawn),)), duration_s=8.0) for spawn in ('problem', 'lanelet')}
    states = runs['lanelet'].states_of('av0')
    assert states[0, 1] == pytest.approx(0.0, abs=1e-9)
    assert states[-1, 1] == pytest.approx(-1.5, abs=0.05)
    assert not any(item.off_road for item in runs['lanelet'].violations)
    transform = runs['lanelet'].setup.avs[0].transform
    np.testing.assert_allclose(transform.to_scenario(states[:, :3]),
                               runs['problem'].states_of('av0')[:, :3], atol=1e-6)
    assert any('1.50 m and 0.0 deg apart' in item for item in runs['lanelet'].setup.notices)
