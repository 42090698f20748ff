# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""When the stimuli of a detection response task come."""

from hashlib import sha256

from crgame_ros.game.scenario_scheduler import ScenarioScheduler
from crgame_ros.game.task_spec import DetectionResponse
import numpy as np


class StimulusSchedule:
    """
    The onsets of one task, each so long after the one before as chance has it.

    The first comes so long after the beginning. Equal seeds and names give equal times on every
    machine, whatever else happens in the run.

    :param task: its shortest and longest time between onsets.
    :param name: of the task: two of one game have stimuli of their own.
    :param seed: of the game.
    :param scheduler: time grids of the run.
    :param begin_n: simulation step at which the task begins.
    :ivar next_n: simulation step of the next onset.
    """

    def __init__(self, task: DetectionResponse, name: str, seed: int,
                 scheduler: ScenarioScheduler, begin_n: int) -> None:
        self._shortest_s, self._longest_s = task.interval
        self._dt_s = scheduler.dt_s
        self._begin_n = begin_n
        # Not Python's hash, which differs from process to process.
        words = np.frombuffer(sha256(name.encode()).digest(), dtype='<u4').tolist()
        self._random = np.random.default_rng([seed, *words])
        self._after_s = 0.0
        self.next_n = begin_n
        self.advance()

    def advance(self) -> None:
        """Choose the next onset."""
        self._after_s += self._shortest_s + self._random.random() * (
            self._longest_s - self._shortest_s)
        self.next_n = self._begin_n + round(self._after_s / self._dt_s)
