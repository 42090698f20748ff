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
"""Make the pictures of the documentation from offline runs of the project's own games."""

from pathlib import Path

from crgame_ros.analysis.pictures.figure_style import figure_bytes
from crgame_ros.analysis.pictures.run_figure import draw_run
from crgame_ros.launcher.arguments import RunRequest
from crgame_ros.launcher.run_plan import effective_game
from crgame_ros.paths import scenarios_directory, share_directory
from crgame_ros.recording.export import write_bytes
from crgame_ros.recording.run_record import run_record_of
from crgame_ros.simulation.offline import run_offline
from crgame_ros.simulation.setup import build_setup

PICTURES = {'cut_in': (2.0, 5.0, 8.0, 11.0, 16.0), 'two_avs': (2.0, 5.0, 8.0, 12.0)}


def main() -> None:
    """Draw each game."""
    folder = share_directory() / 'docs' / 'images'
    folder.mkdir(parents=True, exist_ok=True)
    for name, times_s in PICTURES.items():
        request = RunRequest(game=Path(scenarios_directory() / f'{name}.yaml'))
        result = run_offline(build_setup(effective_game(request)))
        path = folder / f'{name}.png'
        write_bytes(figure_bytes(draw_run(run_record_of(result), times_s), 'png'), path)
        print(path)


if __name__ == '__main__':
    main()
