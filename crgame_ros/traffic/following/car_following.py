# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Keeping a distance to the vehicle ahead (FS M2), vectorised over agents."""

from abc import ABC, abstractmethod
import math
from typing import ClassVar

from crgame_ros.errors import InputError
from crgame_ros.registry import ModelRegistry
from crgame_ros.traffic.compiling.compiled import compiled, vectorized
from crgame_ros.vehicle.idm_model import free_acceleration, IdmParameters, interaction
from crgame_ros.vehicle.state import STANDING
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

# A standing agent stays until its model wants this much [m/s^2].
START = 0.2
# The guard begins at this share of the hardest deceleration and demands all of it at 1: steady
# following needs less, and so do the gaps that are short by agreement after a lane change.
GUARD_SHARE = 0.8
# The gap that the guard leaves between bumpers, as a share of the gap at standstill.
GUARD_GAP = 0.5
LEAST_ROOM = 0.01
# While a leader is known not to brake harder than BRAKES_HARD, the guard demands no more than
# GUARD_DECELERATION or the needed deceleration, whichever is greater [m/s^2].
BRAKES_HARD, GUARD_DECELERATION = -2.0, 3.0
# Agents brake a little harder than needed at once, so that less is needed later.
FORESIGHT = 1.05
# Behind a slower leader far ahead, an agent brakes no harder than this, or than needed [m/s^2].
PATIENT = 3.5


@compiled
def _spared_of(relief: float, desired_gap: float, gap: float, standstill_gap: float) -> float:
    """Return the part of a relief that counts: it fades below the gap at standstill [m]."""
    patience = min(max(2.0 * gap / standstill_gap - 1.0, 0.0), 1.0)
    return min(relief, max(desired_gap - gap, 0.0)) * patience


@vectorized
def _spared(relief: float, desired_gap: float, gap: float, standstill_gap: float) -> float:
    return _spared_of(relief, desired_gap, gap, standstill_gap)


@compiled
def _guard_of(speed: float, gap: float, lead_speed: float, standstill_gap: float,
              hardest: float) -> float:
    """
    Return the braking that avoids contact in an emergency, whatever the law wants [m/s^2].

    Behind a leader that brakes its hardest, b_max, to a stop, constant braking with
    v^2 / (2 (gap - s0 / 2 + v_leader^2 / (2 b_max))) just avoids contact, as in Gipps (1981).
    The demand rises from 0 where that is 0.8 b_max to b_max where it is b_max.
    """
    stopping = gap - GUARD_GAP * standstill_gap + max(lead_speed, 0.0)**2 / (2.0 * hardest)
    share = speed**2 / (2.0 * hardest * max(stopping, LEAST_ROOM))
    return hardest * min(max((share - GUARD_SHARE) / (1.0 - GUARD_SHARE), 0.0), 1.0)


@compiled
def needed_deceleration(speed: float, room: float, lead_speed: float,
                        lead_acceleration: float) -> float:
    """
    Return the constant braking that just avoids contact if the leader keeps its acceleration.

    :param room: distance that may be used up [m]
    :param lead_acceleration: a leader that brakes may do so to a stop [m/s^2]
    :return: 0 or above [m/s^2]
    """
    room, lead_speed = max(room, LEAST_ROOM), max(lead_speed, 0.0)
    result = max(speed - lead_speed, 0.0)**2 / (2.0 * room)
    if lead_acceleration < -0.5:
        result = max(result, speed**2 / (2.0 * (room - lead_speed**2 / (2.0 * lead_acceleration))))
    return result


@compiled
def _limited_of(wanted: float, speed: float, gap: float, lead_speed: float,
                lead_acceleration: float, patience: float, standstill_gap: float, most: float,
                hardest: float) -> float:
    """Return the acceleration that a law wants, limited, with the braking of the guard."""
    guard = _guard_of(speed, gap, lead_speed, standstill_gap, hardest)
    if lead_acceleration > BRAKES_HARD:
        demanded = FORESIGHT * needed_deceleration(
            speed, gap - GUARD_GAP * standstill_gap, lead_speed, lead_acceleration)
        guard = min(guard, max(GUARD_DECELERATION, demanded))
        wanted = max(wanted, -max(patience, demanded))
    if guard > 0.0:
        wanted = min(wanted, -guard)
    if speed < STANDING and wanted < START:
        wanted = min(wanted, -START)
    return min(max(wanted, -hardest), most)


@vectorized
def _limited(wanted: float, speed: float, gap: float, lead_speed: float,
             lead_acceleration: float, patience: float, standstill_gap: float, most: float,
             hardest: float) -> float:
    return _limited_of(wanted, speed, gap, lead_speed, lead_acceleration, patience,
                       standstill_gap, most, hardest)


class CarFollowing(ABC):
    """
    A law for the acceleration of an agent behind its leader.

    The law itself is a subclass's `follow`. This class adds what each law needs on a road with
    people: limits, an emergency guard and a standstill that doesn't creep.

    :param standstill_gap: gap behind a standing leader s0, bumper to bumper [m]
    :param max_acceleration: of a driver in no hurry [m/s^2]
    :param max_deceleration: emergency braking on dry asphalt [m/s^2]
    """

    name: ClassVar[str]

    def __init__(self, standstill_gap: float, max_acceleration: float,
                 max_deceleration: float) -> None:
        self.standstill_gap = standstill_gap
        self.max_acceleration = max_acceleration
        self.max_deceleration = max_deceleration

    @abstractmethod
    def follow(self, speed: Array, desired_speed: Array, gap: Array, lead_speed: Array) -> Array:
        """
        Return the acceleration of the law, without limits; arguments as in `acceleration`.

        :param gap: may be inf, and 0 or negative once vehicles overlap [m]
        """

    @abstractmethod
    def desired_gap(self, speed: Array) -> Array:
        """Return the steady gap behind a leader of the same speed, (A,) [m]."""

    def acceleration(self, speed: Array, desired_speed: Array, gap: Array, lead_speed: Array,
                     relief: Array | float = 0.0,
                     lead_acceleration: Array | float = -np.inf) -> Array:
        """
        Return the acceleration for the next decision interval.

        It is integrated with v = max(0, v + a dt): a negative value holds a standing agent that
        should wait.

        :param speed: (A,) of the agents, at least 0 [m/s]
        :param desired_speed: (A,) on a free road [m/s]
        :param gap: (A,) to the leader, bumper to bumper; inf where there is none [m]
        :param lead_speed: (A,) of the leader along the lane; any value where there is none [m/s]
        :param relief: (A,) by how much the gap may fall short of the desired one for now
            (`courtesy`); the guard against collisions uses the true gap [m]
        :param lead_acceleration: (A,) of the leader; by default the leader may brake its hardest
            at any moment [m/s^2]
        :return: (A,) [m/s^2]
        """
        lead_speed = np.where(np.isposinf(gap), speed, lead_speed)
        spared = _spared(relief, self.desired_gap(speed), gap, self.standstill_gap)
        wanted = self.follow(speed, desired_speed, gap + spared, lead_speed)
        return np.asarray(_limited(
            wanted, speed, gap, lead_speed, lead_acceleration, self.patience(speed, gap + spared),
            self.standstill_gap, self.max_acceleration, self.max_deceleration))

    def patience(self, speed: Array, gap: Array) -> Array:
        """
        Return how hard the law may brake where less braking is needed [m/s^2].

        :param gap: to a leader that is known not to brake hard [m]
        """
        return np.full(np.broadcast_shapes(np.shape(speed), np.shape(gap)), np.inf)


@compiled
def _cruise_of(speed: float, desired: float, gap: float, lead_speed: float, time_gap: float,
               h: float, gain: float, standstill_gap: float, comfortable: float,
               speed_time: float) -> float:
    """Return FS 3 with timely braking, or the approach to the desired speed if that is less."""
    error = standstill_gap + time_gap * speed - gap
    following = -(speed - lead_speed + gain * error) / h
    room = max(gap - standstill_gap, 0.5 * standstill_gap)
    needed = max(speed - lead_speed, 0.0)**2 / (2.0 * room)
    if needed > comfortable:
        following = min(following, -needed)
    return min(following, max((desired - speed) / speed_time, -comfortable))


@vectorized
def _cruise(speed: float, desired: float, gap: float, lead_speed: float, time_gap: float,
            h: float, gain: float, standstill_gap: float, comfortable: float,
            speed_time: float) -> float:
    return _cruise_of(speed, desired, gap, lead_speed, time_gap, h, gain, standstill_gap,
                      comfortable, speed_time)


@vectorized
def _cruise_behind(speed: float, desired: float, gap: float, lead_speed: float, relief: float,
                   lead_acceleration: float, time_gap: float, h: float, gain: float,
                   standstill_gap: float, comfortable: float, speed_time: float, most: float,
                   hardest: float) -> float:
    """Return the result of `CarFollowing.acceleration` with this law, computed in one loop."""
    if gap == math.inf:
        lead_speed = speed
    spared = gap + _spared_of(relief, standstill_gap + time_gap * speed, gap, standstill_gap)
    wanted = _cruise_of(speed, desired, spared, lead_speed, time_gap, h, gain, standstill_gap,
                        comfortable, speed_time)
    return _limited_of(wanted, speed, gap, lead_speed, lead_acceleration, max(
        PATIENT, gain * (standstill_gap + time_gap * speed - spared) / h), standstill_gap, most,
        hardest)


class AdaptiveCruise(CarFollowing):
    """
    The law of a constant time gap (FS 3; Rajamani 2011, chapter 6).

    S_desired = l_lead + T v, S_actual = x_lead - x_host, delta = S_desired - S_actual,
    a = -(1 / h) (-dS_actual/dt + lambda delta). Taken between centres, l_lead is their distance
    at contact plus the gap s0 at standstill (FS has the leader's length alone, so that vehicles
    stop bumper on bumper); then delta = s0 + T v - gap. On a free road the speed approaches the
    desired one; the smaller of both accelerations holds.

    A vehicle answers its leader's motion with (s + lambda) / (h s^2 + (1 + lambda T) s + lambda).
    Its gain is nowhere above 1, and a platoon string stable, if and only if
    h <= T + lambda T^2 / 2. With h = T, the default, it is 1 / (T s + 1): there is no overshoot
    either, and the speed of a follower is a plain average of its leader's.

    FS 3 brakes late and hard for a much slower leader, because only v / T and lambda decide when.
    Here an agent begins as soon as the constant deceleration (v - v_leader)^2 / (2 (gap - s0))
    reaches its comfortable one, and keeps to that (ours). A platoon never comes near it.

    :param time_gap: desired time gap T; with it and s0 a lane carries 2,040 cars an hour at
        50 km/h and 2,400 at 120 km/h, as in the Highway Capacity Manual (docs/traffic.md) [s]
    :param h: time gap of the control error (FS 3); None is T [s]
    :param gain: lambda, the rate at which spacing errors decay (ours) [1/s]
    :param standstill_gap: gap at standstill s0, as in Treiber et al. (2000) [m]
    :param max_acceleration: greatest acceleration [m/s^2]
    :param comfortable_deceleration: used to slow down to the desired speed, and from which braking
        for a slower leader begins (ours) [m/s^2]
    :param max_deceleration: hardest braking [m/s^2]
    :param speed_time: time constant of approaching the desired speed (ours) [s]
    """

    name: ClassVar[str] = 'acc'

    def __init__(self, time_gap: float = 1.3, h: float | None = None, gain: float = 0.4,
                 standstill_gap: float = 2.0, max_acceleration: float = 1.5,
                 comfortable_deceleration: float = 2.0, max_deceleration: float = 8.0,
                 speed_time: float = 2.0) -> None:
        super().__init__(standstill_gap, max_acceleration, max_deceleration)
        self.h = time_gap if h is None else h
        _check_positive(self.name, time_gap=time_gap, h=self.h, gain=gain,
                        standstill_gap=standstill_gap, max_acceleration=max_acceleration,
                        comfortable_deceleration=comfortable_deceleration,
                        max_deceleration=max_deceleration, speed_time=speed_time)
        self.time_gap = time_gap
        self.gain = gain
        self._comfortable_deceleration = comfortable_deceleration
        self._speed_time = speed_time

    def follow(self, speed: Array, desired_speed: Array, gap: Array, lead_speed: Array) -> Array:
        """Return FS 3 with timely braking, or the approach to the desired speed if less."""
        return np.asarray(_cruise(
            speed, desired_speed, gap, lead_speed, self.time_gap, self.h, self.gain,
            self.standstill_gap, self._comfortable_deceleration, self._speed_time))

    def acceleration(self, speed: Array, desired_speed: Array, gap: Array, lead_speed: Array,
                     relief: Array | float = 0.0,
                     lead_acceleration: Array | float = -np.inf) -> Array:
        """Return the acceleration for the next decision interval."""
        if type(self) is not AdaptiveCruise:
            return super().acceleration(speed, desired_speed, gap, lead_speed, relief,
                                        lead_acceleration)
        return np.asarray(_cruise_behind(
            speed, desired_speed, gap, lead_speed, relief, lead_acceleration, self.time_gap,
            self.h, self.gain, self.standstill_gap, self._comfortable_deceleration,
            self._speed_time, self.max_acceleration, self.max_deceleration))

    def patience(self, speed: Array, gap: Array) -> Array:
        """
        Return the braking for the missing distance alone, but at least `PATIENT`.

        The difference of speeds, which FS 3 divides by h, makes no agent brake harder than needed.
        """
        missing = self.desired_gap(speed) - gap
        return np.asarray(np.maximum(PATIENT, self.gain * missing / self.h))

    def desired_gap(self, speed: Array) -> Array:
        """Return s0 + T v."""
        return self.standstill_gap + self.time_gap * speed


class IntelligentDriver(CarFollowing):
    """
    The Intelligent Driver Model (Treiber, Hennecke and Helbing 2000).

    The paper has T = 1.6 s, a = 0.73 and b = 1.67 m/s^2 on a motorway. Near its desired speed v0
    the law keeps much more than s0 + T v; with T = 1.0 s a lane carries as much as with `acc`, and
    some vehicles stop 0.1 m nearer than s0.

    :param time_gap: desired time gap T [s]
    :param standstill_gap: gap at standstill s0 [m]
    :param max_acceleration: greatest acceleration a [m/s^2]
    :param comfortable_deceleration: comfortable deceleration b [m/s^2]
    :param max_deceleration: hardest braking [m/s^2]
    """

    name: ClassVar[str] = 'idm'

    def __init__(self, time_gap: float = 1.3, standstill_gap: float = 2.0,
                 max_acceleration: float = 1.5, comfortable_deceleration: float = 2.0,
                 max_deceleration: float = 8.0) -> None:
        super().__init__(standstill_gap, max_acceleration, max_deceleration)
        _check_positive(self.name, time_gap=time_gap, standstill_gap=standstill_gap,
                        max_acceleration=max_acceleration, max_deceleration=max_deceleration,
                        comfortable_deceleration=comfortable_deceleration)
        self._model = IdmParameters(time_gap, standstill_gap, max_acceleration,
                                    comfortable_deceleration, max_deceleration)

    def follow(self, speed: Array, desired_speed: Array, gap: Array, lead_speed: Array) -> Array:
        """Return a (1 - (v / v0)^4 - (s* / s)^2)."""
        desired = np.maximum(desired_speed, STANDING)
        return (free_acceleration(speed, desired, self._model, np.maximum)
                + interaction(speed, gap, lead_speed, self._model, np.maximum))

    def desired_gap(self, speed: Array) -> Array:
        """Return s0 + T v, where the interaction term equals a."""
        return self._model.s0 + self._model.time_headway * speed


def _check_positive(model: str, **values: float) -> None:
    for key, value in values.items():
        if not 0.0 < value < np.inf:
            raise InputError(f'"{key}" is {value:g}', f'options of car-following model {model}',
                             'give a number above 0')


CAR_FOLLOWING = ModelRegistry('car_following', 'car-following model', {
    'acc': 'crgame_ros.traffic.following.car_following:AdaptiveCruise',
    'idm': 'crgame_ros.traffic.following.car_following:IntelligentDriver',
}, CarFollowing, 'docs/traffic.md')
