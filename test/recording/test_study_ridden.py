# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Trials in an AV are driven again up to the take-over, by other planners and the recorded one."""

from pathlib import Path
from typing import Any

from crgame_ros.cli import main
from crgame_ros.driver.source import ReplayDriver
from crgame_ros.paths import scenarios_directory
from crgame_ros.study.file import load_study
import numpy as np
import polars
import pytest
from study_maker import StudyMaker

# Cycle from which the participant's commands drive the AV, of 0.01 s each.
TAKEN_OVER = 90


class Rider(StudyMaker):
    """A study whose participants sit in the AV, and take it over in their first trial."""

    def __init__(self, recorder: Any, folder: Path) -> None:
        super().__init__(recorder, folder, scenarios_directory() / 'cut_in.yaml')
        file = folder / 'study' / 'study.yaml'
        file.write_text(file.read_text().replace('seed: 3}', 'seed: 3, seat: av0}'))
        self.study = load_study(file)
        self.taken = True

    def drivers(self, commands: np.ndarray) -> dict[str, ReplayDriver]:
        if not self.taken:
            return {}
        self.taken = False
        commands[:TAKEN_OVER] = np.nan
        commands[TAKEN_OVER:] = (0.0, 0.8, 0.0, 0.0)
        return {'av0': ReplayDriver(commands)}


@pytest.mark.slow
def test_trials_in_an_av_are_driven_again_up_to_the_take_over(recorder: Any,
                                                              tmp_path: Path) -> None:
    make = Rider(recorder, tmp_path / 'ridden')
    with make.session('P01', 0) as session:
        rng = np.random.default_rng(2)
        while session.next_item is not None:
            make.do(session, rng)
    assert main(['study', 'rerun', str(make.folder), '--planner', 'constant-velocity',
                 '--workers', '1']) == 0
    found = polars.read_csv(make.folder / 'data' / 'rerun' / 'comparison' / 'comparison.csv',
                            null_values=['', 'NaN']).filter(vehicle='av0').sort('trial', 'planner')
    assert found['planner'].to_list() == ['constant-velocity', 'own'] * 2
    assert found['status'].unique().to_list() == ['ok']
    first, second = (found.filter(trial=number) for number in (1, 2))
    # Up to the first command, which is the step after it was given.
    assert first['until_s'].to_list() == pytest.approx([0.01 * TAKEN_OVER] * 2, abs=0.011)
    assert first['rerun_duration_s'].to_list() == pytest.approx([0.9] * 2, abs=0.011)
    assert first['recorded_distance_m'].is_null().all()
    # Nobody took over in the second: its whole drive is comparable.
    assert second['until_s'].is_null().all()
    own = second.filter(planner='own').row(0, named=True)
    assert own['rerun_distance_m'] == pytest.approx(own['recorded_distance_m'], rel=1e-9)
    assert first['rerun_distance_m'].n_unique() + second['rerun_distance_m'].n_unique() > 2
