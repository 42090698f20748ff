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
"""Pictures of runs show who drives in them."""

from crgame_ros.analysis.pictures.run_figure import colour_of, draw_run
from crgame_ros.game.game_file import load_game
from crgame_ros.paths import scenarios_directory
from crgame_ros.simulation.offline import run_offline
from crgame_ros.simulation.setup import build_setup
from matplotlib.colors import to_hex
from matplotlib.patches import Polygon
import numpy as np


def test_every_driven_vehicle_is_within_each_snapshot() -> None:
    """Of two AVs that follow each other by some 40 m, and the human in front of them."""
    result = run_offline(build_setup(load_game(scenarios_directory() / 'two_avs.yaml')),
                         duration_s=5.0, check_drivability=False)
    colours = {colour_of(vehicle_id): vehicle_id for vehicle_id in result.setup.vehicle_ids}
    snapshots = draw_run(result, (2.0, 5.0)).axes[:2]
    for axes in snapshots:
        (left, right), (bottom, top) = axes.get_xlim(), axes.get_ylim()
        shown = set()
        for patch in axes.patches:
            vehicle = colours.get(to_hex(patch.get_facecolor()))
            if vehicle is not None and isinstance(patch, Polygon):
                corners = np.asarray(patch.get_xy())
                assert np.all((corners > (left, bottom)) & (corners < (right, top))), vehicle
                shown.add(vehicle)
        assert shown == {'hv0', 'av0', 'av1'}
    # All at one scale.
    assert snapshots[0].get_xlim() == snapshots[1].get_xlim()
