# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Policies for tests, named in games as policy:…/policies.py:FUNCTION."""

from collections.abc import Mapping
from pathlib import Path

from crgame_ros.policy.policy_file import Policy
import numpy as np
from numpy.typing import NDArray

HERE = Path(__file__)


def follow_lane(seen: Mapping[str, NDArray[np.float32]]) -> NDArray[np.float32]:
    """Steer back to the route and hold 0.8 of the speed limit; brake for the leader."""
    speed, _, _, _, offset, heading, curvature, limit, _ = seen['state'].tolist()
    wanted = curvature - 0.02 * offset - 0.3 * heading
    share = wanted / min(0.6, 5.0 / max(speed * speed, 1e-6))
    pedal = 0.2 * (0.8 * limit - speed)
    ahead = seen['objects']
    near = (ahead[:, 0] > 0.5) & (ahead[:, 1] > 0.0) & (np.abs(ahead[:, 2]) < 2.0)
    if near.any():
        gap = float(ahead[near, 1].min()) - 8.0
        pedal = min(pedal, 0.1 * (gap - 1.5 * speed))
    return np.clip(np.array((pedal, share), np.float32), -1.0, 1.0)


def acceleration() -> Policy:
    """Drive by acceleration and curvature."""
    return Policy(follow_lane)


def every_third() -> Policy:
    """Decide at every third scenario step."""
    return Policy(follow_lane, ticks=3)


def by_pedals() -> Policy:
    """Hold half the throttle and the wheel a little to the left."""
    return Policy(lambda seen: np.array((0.5, 0.01), np.float32), 'pedals')


def by_plans() -> Policy:
    """Plan straight on at the present speed."""
    def act(seen: Mapping[str, NDArray[np.float32]]) -> NDArray[np.float32]:
        speed = float(seen['state'][0])
        plan = np.zeros((10, 4), np.float32)
        plan[:, 0] = speed * 0.1 * np.arange(1, 11)
        plan[:, 3] = speed
        return plan
    return Policy(act, 'plan')


def with_lidar() -> Policy:
    """Drive by the lidar alone."""
    return Policy(lambda seen: np.array((float(seen['lidar'].min() > 20.0), 0.0), np.float32),
                  observation={'parts': ['lidar'], 'rays': 12})


LANES = {'parts': ['state', 'objects'], 'scaled': True, 'history': {'state': 3}}


def change_lanes(seen: Mapping[str, NDArray[np.float32]]) -> int:
    """Change to the left where there is a lane, else get faster while it gets faster."""
    speeds = seen['state'][:, 0]
    return 1 if seen['mask'][1] else 3 if speeds[-1] >= speeds[0] else 0


def manoeuvres() -> Policy:
    """Decide on a manoeuvre every half second."""
    return Policy(change_lanes, 'manoeuvre', LANES, ticks=5)


def failing() -> Policy:
    """Fail at the first action."""
    def act(seen: Mapping[str, NDArray[np.float32]]) -> None:
        raise RuntimeError('no weights')
    return Policy(act)


def failing_later() -> Policy:
    """Fail at the fourth decision and from then on."""
    decided = 0

    def begin() -> None:
        nonlocal decided
        decided = 0

    def act(seen: Mapping[str, NDArray[np.float32]]) -> NDArray[np.float32]:
        nonlocal decided
        decided += 1
        if decided > 3:
            raise RuntimeError('no weights')
        return follow_lane(seen)
    return Policy(act, ticks=3, begin=begin)


def no_keys() -> Policy:
    """List parts where keys of the observation are needed."""
    return Policy(follow_lane, observation=['state'])  # type: ignore[arg-type]


def nothing() -> int:
    """Return a value that is no policy."""
    return 3
