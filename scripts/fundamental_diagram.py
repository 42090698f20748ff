# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Speed, flow and density of traffic on circular roads, measured by virtual detectors."""

from collections.abc import Sequence
from dataclasses import dataclass
import math

from crgame_ros.game.objects import ObjectDescription, Role
from crgame_ros.game.traffic_spec import TrafficSpec
from crgame_ros.geometry.shape import Shape
from crgame_ros.roads.network import RoadNetwork
from crgame_ros.traffic.fleet.world_view import WorldView
from crgame_ros.traffic.spawning import Adopted
from crgame_ros.traffic.traffic import Traffic
import numpy as np
from numpy.typing import NDArray
from scenario_traffic import loaded, rings

FloatArray = NDArray[np.float64]

LENGTH = 4.5
# Of both models: s0 [m] and T.
STANDSTILL_GAP, TIME_GAP_S = 2.0, 1.3
STEP_S, SUBSTEPS = 0.1, 10
# Detectors on every ring, evenly spaced.
DETECTORS = 8
NOBODY = np.zeros((0, 3))
# Enough for full speed on rings: they must behave like straight roads [m/s^2].
LATERAL = 6.0


@dataclass(frozen=True)
class Flow:
    """
    The detectors' measurements on rings (R).

    :param density: vehicles over circumference, as set up [1/m]
    :param flow: vehicles that pass a detector in a second, mean of all detectors [1/s]
    :param speed: their harmonic mean [m/s]
    """

    density: FloatArray
    flow: FloatArray
    speed: FloatArray


def measure(model: str, counts: Sequence[int], circumference: float, limit: float,
            settle_s: float, measure_s: float) -> Flow:
    """
    Run vehicles of one length and one desired speed on rings until steady, and count them.

    :param model: of car following.
    :param counts: vehicles on each ring.
    :param circumference: [m]
    :param limit: desired speed [m/s]
    """
    scenario = loaded('Rings', rings(len(counts), circumference, limit)).scenario
    radius = circumference / math.tau
    ring = np.repeat(np.arange(len(counts)), counts)
    middles = ring * (2.0 * radius + 50.0)
    traffic = Traffic(
        TrafficSpec(recorded='reactive', model=model, lateral_acceleration=LATERAL),
        RoadNetwork(scenario.lanelet_network), scenario, (),
        _starts(counts, radius, limit), STEP_S, SUBSTEPS, 0, 0)
    settle, ticks = round(settle_s / STEP_S), round((settle_s + measure_s) / STEP_S)
    angles = np.empty((ticks - settle + 1, len(ring)))
    for k in range(ticks + 1):
        if k >= settle:
            poses = traffic.states.poses
            angles[k - settle] = np.arctan2(poses[:, 1], poses[:, 0] - middles)
        traffic.advance(WorldView(k, NOBODY, NOBODY))
    if not np.isfinite(angles).all():
        raise RuntimeError('a vehicle got lost')
    seen = [_detect(np.unwrap(angles[:, ring == i], axis=0), radius) for i in range(len(counts))]
    return Flow(np.array(counts) / circumference, np.array([x[0] for x in seen]),
                np.array([x[1] for x in seen]))


def _starts(counts: Sequence[int], radius: float, limit: float) -> list[Adopted]:
    """Place vehicles with uneven gaps, slower than they will be."""
    rng = np.random.default_rng(0)
    starts = []
    for ring, count in enumerate(counts):
        gap = math.tau * radius / count - LENGTH
        shift = np.arange(count) * (gap + LENGTH) + rng.uniform(-0.15, 0.15, count) * gap
        for angle in (0.01 + shift / radius).tolist():
            pose = (radius * math.cos(angle) + ring * (2.0 * radius + 50.0),
                    radius * math.sin(angle), angle + 0.5 * math.pi)
            speed = min(0.9 * limit, 0.4 * max(gap - 2.0, 0.0))
            way = (-math.sin(angle), math.cos(angle), 0.0)
            # The highest speed in a recording is the driver's desired speed.
            starts.append(Adopted(
                ObjectDescription(f'o{len(starts)}', 'car', Role.RECORDED,
                                  Shape.rectangle(LENGTH, 1.8)), 0, np.array([pose, pose]),
                np.multiply.outer((speed, limit), way)))
    return starts


def _detect(angles: FloatArray, radius: float) -> tuple[float, float]:
    """Return flow [1/s] and harmonic mean speed [m/s] of continuous angles (ticks, vehicles)."""
    # In numbers of detectors passed.
    passed = angles * DETECTORS / math.tau
    number = np.floor(passed)
    k, who = np.nonzero(np.diff(number, axis=0) > 0.0)
    pace = passed[k + 1, who] - passed[k, who]
    time = (k + (number[k + 1, who] - passed[k, who]) / pace) * STEP_S
    speed = pace / STEP_S * math.tau * radius / DETECTORS
    detector = number[k + 1, who].astype(np.int64) % DETECTORS
    flows = []
    for place in range(DETECTORS):
        times = np.sort(time[detector == place])
        if len(times) > 1:
            flows.append((len(times) - 1) / (times[-1] - times[0]))
    return float(np.mean(flows)), float(1.0 / np.mean(1.0 / speed))


def equilibrium_density(model: str, speed: FloatArray, limit: float) -> FloatArray:
    """
    Return the density at which vehicles follow each other steadily, in closed form.

    A vehicle takes its length and its gap: s0 + T v where FS 3 is zero (acc), and
    (s0 + T v) / sqrt(1 - (v / v0)^4) where the IDM is (idm; Treiber et al. 2000, equation 5).

    :param speed: (N) below the limit [m/s]
    :return: (N) [1/m]
    """
    gap = STANDSTILL_GAP + TIME_GAP_S * speed
    if model == 'idm':
        gap = gap / np.sqrt(1.0 - (speed / limit) ** 4)
    return np.asarray(1.0 / (LENGTH + gap))


def equilibrium_speed(model: str, density: FloatArray, limit: float) -> FloatArray:
    """Return the steady speed at densities (N); the limit where the road is free [m/s]."""
    speed = np.linspace(0.0, limit * (1.0 - 1e-9), 20001)
    dense = equilibrium_density(model, speed, limit)
    return np.asarray(np.interp(-density, -dense, speed))
