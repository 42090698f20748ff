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
"""Points in the frame of a pose: ahead of it and to its left."""

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


def beside(poses: FloatArray, d: FloatArray) -> FloatArray:
    """
    Move poses to their left.

    :param poses: (..., 3 or more) x [m], y [m], yaw [rad]
    :param d: (...) offsets [m]
    :return: (..., 3), the yaw unchanged
    """
    yaw = poses[..., 2]
    return np.stack((poses[..., 0] - d * np.sin(yaw), poses[..., 1] + d * np.cos(yaw), yaw),
                    axis=-1)


def seen_from(poses: FloatArray, points: FloatArray) -> tuple[FloatArray, FloatArray]:
    """
    Give how far points are ahead of poses, and how far to their left.

    :param poses: (..., 3 or more) x [m], y [m], yaw [rad]
    :param points: (..., 2) [m]
    :return: both (...) [m]
    """
    dx, dy = points[..., 0] - poses[..., 0], points[..., 1] - poses[..., 1]
    cos, sin = np.cos(poses[..., 2]), np.sin(poses[..., 2])
    return dx * cos + dy * sin, dy * cos - dx * sin
