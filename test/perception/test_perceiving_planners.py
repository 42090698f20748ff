# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Planners on perceived requests: real scenarios, real planners, the engine's own requests."""

from dataclasses import replace
import math
from typing import NamedTuple

from crgame_ros.game.game import load_game
from crgame_ros.game.perception_spec import LocalisationSpec, PerceptionSpec, SensorSpec
from crgame_ros.messages.joints import JointSeries
from crgame_ros.paths import scenarios_directory
from crgame_ros.perception.perception import Perception
from crgame_ros.planner.request_reader import RequestReader
from crgame_ros.simulation.engine import Simulation
from crgame_ros.simulation.offline import offline_driver, PlannerRecord, PlannerSeat
from crgame_ros.simulation.setup import build_setup, Setup
import numpy as np
from perception_support import EXACT
import pytest

BLIND = PerceptionSpec(None, (SensorSpec('stub', horizon=0.1, rays=1),), memory=0.0)


class Drive(NamedTuple):
    """
    A run whose first AV plans on what it perceives.

    :param record: outcomes of its plans
    :param seen: (ticks, V + M) vehicles and objects that it knew
    :param requests: true and perceived, of each tick
    :param setup: the run
    """

    record: PlannerRecord
    seen: np.ndarray
    requests: list[tuple[JointSeries, JointSeries]]
    setup: Setup


def drive(game: str, planner: str, spec: PerceptionSpec, steps: int) -> Drive:
    setup = build_setup(load_game(scenarios_directory() / f'{game}.yaml'))
    setup = replace(setup, avs=tuple(
        replace(av, spec=replace(av.spec, planner=planner, options={})) for av in setup.avs))
    simulation, av = Simulation(setup), setup.avs[0]
    seat = PlannerSeat(setup, 0, simulation, 0, None)
    hands = [offline_driver(setup, index) for index in range(len(setup.humans))]
    dt_s, per_tick = setup.scheduler.dt_s, setup.scheduler.steps_per_tick
    perception = Perception(av.id, spec, setup.descriptions, av.vehicle, av.transform, av.state,
                            3, dt_s)
    result, seen, requests = simulation.begin(), [], []
    for n in range(steps):
        perception.observe(n, np.array(simulation.states), simulation.objects.poses,
                           simulation.objects.velocities, n % per_tick * dt_s)
        if av.id in result.requests:
            true = result.requests[av.id]
            perceived = perception.perceive(true)
            requests.append((true, perceived))
            seen.append(perception.seen)
            seat.ask(perceived)
        seat.deliver()
        result = simulation.step(dt_s, [*(hand.command(n, dt_s) for hand in hands),
                                        *[None] * len(setup.avs)])
    return Drive(seat.record(), np.array(seen), requests, setup)


@pytest.mark.matrix('crossing-reactive')
@pytest.mark.slow
@pytest.mark.parametrize('planner', ['idm', 'reactive', 'constant-velocity', 'idm-package'])
@pytest.mark.parametrize('game', ['traffic', 'crossing'])
def test_planners_accept_what_is_perceived(game: str, planner: str) -> None:
    """With the defaults no planner falls back, all plans are accepted, some vehicles unseen."""
    done = drive(game, planner, PerceptionSpec(), 150)
    assert done.record.statistics.reasons == {}
    assert done.record.counters.accepted == 15
    assert not done.seen.all()
    assert done.seen.sum(axis=1).max() > 1


@pytest.mark.parametrize('planner', ['idm', 'reactive', 'constant-velocity', 'idm-package'])
def test_planners_accept_an_empty_road(planner: str) -> None:
    """The human's vehicle is absent too, in all joints at all points."""
    done = drive('cut_in', planner, BLIND, 60)
    assert done.record.statistics.reasons == {}
    assert done.record.counters.accepted == 6
    assert done.setup.vehicle_ids == ('hv0', 'av0')
    assert done.seen[:, :2].tolist() == [[False, True]] * 6
    for true, perceived in done.requests:
        assert np.isfinite(true.positions[:, 4:8]).all()
        assert np.isnan(perceived.positions[:, 4:]).all()


def test_a_planner_brakes_only_for_what_it_sees() -> None:
    """The AV slows down for a human that cuts in and brakes only if it sees the human."""
    speeds = {}
    for name, spec in (('front', replace(PerceptionSpec(), localisation=None)),
                       ('blind', BLIND)):
        done = drive('cut_in', 'idm', spec, 1000)
        last = done.requests[-1][0]
        speeds[name] = math.hypot(*last.velocities[0, :2])
    assert speeds['front'] < speeds['blind'] - 5.0


def test_exact_sensors_show_recorded_cars_as_they_are() -> None:
    """Present poses and velocities are true for the cars that a scan of the same tick saw."""
    sensor = SensorSpec('roof', x=1.4, field_of_view=2 * math.pi, rays=1440, horizon=200.0,
                        **EXACT)
    done = drive('traffic', 'idm', PerceptionSpec(None, (sensor,), memory=0.0), 100)
    shown = 0
    for true, perceived in done.requests:
        present = np.isfinite(perceived.positions[0])
        shown += int(present[4:].sum())
        np.testing.assert_allclose(perceived.positions[0, present], true.positions[0, present],
                                   atol=1e-9)
        # Turn rates of recordings are clipped to a car's limits.
        present &= [not name.endswith('/yaw') for name in true.names]
        np.testing.assert_allclose(perceived.velocities[0, present],
                                   true.velocities[0, present], atol=1e-9)
    assert shown > 100


def test_ego_that_is_read_is_the_estimate() -> None:
    """`RequestReader` gives a planner the estimated state and the perceived obstacles."""
    done = drive('traffic', 'idm', PerceptionSpec(LocalisationSpec(position_noise=0.3)), 60)
    reader = RequestReader('av0', {item.id: item for item in done.setup.descriptions},
                           done.setup.scheduler)
    true, perceived = done.requests[-1]
    known, told = reader.read(true), reader.read(perceived)
    places = [known.obstacle_ids.index(name) for name in told.obstacle_ids]
    assert places == sorted(places)
    assert 1e-3 < math.hypot(told.ego.x - known.ego.x, told.ego.y - known.ego.y) < 1.0
    assert told.ego[4:] == pytest.approx(known.ego[4:], abs=0.02)
    # Known vehicles are present at all points; the others are left out.
    assert np.isfinite(told.obstacle_poses).all()
    assert 0 < len(places) < len(known.obstacle_ids)
