# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The spaces of an agent, as Gymnasium's types."""


from crgame_ros.policy.actions import action_bounds, ActionKind, MANOEUVRES
from crgame_ros.policy.observation_spec import ObservationSpec
from gymnasium import spaces
import numpy as np


def observation_space(spec: ObservationSpec, kind: ActionKind) -> spaces.Dict:
    """Return the space of observations: a box for each part, and one of a mask of manoeuvres."""
    boxes: dict[str, spaces.Space[object]] = {
        part: spaces.Box(low, high, dtype=low.dtype.type)
        for part, (low, high) in spec.bounds().items()}
    if kind == 'manoeuvre':
        boxes['mask'] = spaces.Box(0.0, 1.0, (len(MANOEUVRES),), np.float32)
    return spaces.Dict(boxes)


def action_space(kind: ActionKind) -> spaces.Box | spaces.Discrete:
    """Return the space of actions: a box of float32, or the numbers of manoeuvres."""
    if kind == 'manoeuvre':
        return spaces.Discrete(len(MANOEUVRES))
    low, high = action_bounds(kind)
    return spaces.Box(low, high, dtype=np.float32)
