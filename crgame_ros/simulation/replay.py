# Copyright 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A recorded human again: the inputs of a recording, for the offline runner."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from crgame_ros.driver.replay import ReplayDriver
from crgame_ros.driver.source import DriverSource, parse_source
from crgame_ros.errors import InputError
from crgame_ros.recording.run_log import replay_inputs
from crgame_ros.simulation.setup import Setup


def recorded_inputs(
    setup: Setup,
) -> tuple[dict[str, DriverSource], NDArray[np.float64] | None]:
    """
    Find the inputs of every human whose driver is `replay:BAG`.

    :return: drivers by human, and the intervals Delta t_eff that reproduce the recorded states to
        the last bit [s]; None for the nominal step.
    :raises InputError: if a recording cannot be used, or two of them differ in their intervals.
    """
    drivers: dict[str, DriverSource] = {}
    intervals: NDArray[np.float64] | None = None
    for human in setup.humans:
        source = parse_source(human.driver)
        if source.kind != 'replay':
            continue
        commands, measured = replay_inputs(Path(source.argument))
        if human.id not in commands:
            raise InputError(f'{human.id} took no part', source.argument,
                             'it has ' + ', '.join(commands))
        if intervals is not None and not np.array_equal(intervals, measured):
            raise InputError('was recorded with other intervals than the other replay',
                             source.argument, 'replay humans of one recording together')
        drivers[human.id], intervals = ReplayDriver(commands[human.id]), measured
    return drivers, intervals
