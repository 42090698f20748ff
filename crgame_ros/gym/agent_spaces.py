# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The spaces of an agent, as Gymnasium's types."""

from crgame_ros.policy.actions import action_bounds, ActionKind
from crgame_ros.policy.observation_spec import ObservationSpec
from gymnasium import spaces
import numpy as np


def observation_space(spec: ObservationSpec) -> spaces.Dict:
    """Return the space of observations: a box of float32 for each part."""
    return spaces.Dict({part: spaces.Box(low, high, dtype=np.float32)
                        for part, (low, high) in spec.bounds().items()})


def action_space(kind: ActionKind) -> spaces.Box:
    """Return the space of actions: a box of float32."""
    low, high = action_bounds(kind)
    return spaces.Box(low, high, dtype=np.float32)
