# Copyright 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.
"""The spaces of an agent, as Gymnasium has them."""

from crgame_ros.policy.actions import action_bounds, ActionKind
from crgame_ros.policy.observation_spec import ObservationSpec
from gymnasium import spaces
import numpy as np


def observation_space(spec: ObservationSpec) -> spaces.Dict:
    """Give the space of observations: a box of float32 for each part."""
    return spaces.Dict({part: spaces.Box(low, high, dtype=np.float32)
                        for part, (low, high) in spec.bounds().items()})


def action_space(kind: ActionKind) -> spaces.Box:
    """Give the space of actions: a box of float32."""
    low, high = action_bounds(kind)
    return spaces.Box(low, high, dtype=np.float32)
