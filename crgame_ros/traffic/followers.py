# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The car-following models of all agents: one for all, until some get another."""

from collections.abc import Mapping, Sequence
from typing import Any

from crgame_ros.traffic.car_following import Array, CAR_FOLLOWING, CarFollowing
from crgame_ros.traffic.lane_graph import FloatArray, IntArray
import numpy as np


class Followers:
    """
    Which car-following model moves which agent (A).

    :param name: of the model.
    :param options: of everybody's at first.
    :param count: of the agents.

    Attributes: `usual`, everybody's model at first; `max_acceleration` (A) [m/s^2]
    """

    def __init__(self, name: str, options: Mapping[str, Any], count: int) -> None:
        self._name = name
        self._options: list[dict[str, Any]] = [dict(options)]
        self.usual: CarFollowing = CAR_FOLLOWING.create(name, options, 'traffic')
        self._models = [self.usual]
        # The last row is for all who are no agents.
        self._number = np.zeros(count + 1, dtype=np.int64)
        self.max_acceleration: FloatArray = np.full(count, self.usual.max_acceleration)

    def of(self, slots: IntArray) -> 'CarFollowing | _Several':
        """Return the model of agents (N), to be asked about just these; of slot -1 the usual one."""
        if len(self._models) == 1:
            return self.usual
        return _Several(self._models, self._number[slots])

    def change(self, slots: IntArray, options: Mapping[str, Any]) -> None:
        """
        Let the models of agents have other options, besides those that they have.

        :raises InputError: for options that the model does not take.
        """
        number = self._number[slots]
        for before in np.unique(number).tolist():
            wanted = {**self._options[before], **options}
            if wanted not in self._options:
                self._options.append(wanted)
                self._models.append(CAR_FOLLOWING.create(self._name, wanted, 'traffic'))
            after = self._options.index(wanted)
            self._number[slots[number == before]] = after
            self.max_acceleration[slots[number == before]] = self._models[after].max_acceleration


class _Several:
    """
    Several models, each for some of the agents (N) that are asked about.

    :param models: all there are.
    :param number: (N) of each agent's.
    """

    def __init__(self, models: Sequence[CarFollowing], number: IntArray) -> None:
        self._parts = [(models[i], number == i) for i in np.unique(number).tolist()]
        self._count = len(number)

    def acceleration(self, *values: Array | float) -> Array:
        """Return `CarFollowing.acceleration`, of each agent by its own model."""
        result = np.empty(self._count)
        for model, rows in self._parts:
            result[rows] = model.acceleration(*(_rows(value, rows) for value in values))
        return result

    def desired_gap(self, speed: Array) -> Array:
        """Return `CarFollowing.desired_gap`, of each agent by its own model."""
        result = np.empty(self._count)
        for model, rows in self._parts:
            result[rows] = model.desired_gap(speed[rows])
        return result


def _rows(value: Any, rows: Any) -> Any:
    return value[rows] if np.ndim(value) else value
