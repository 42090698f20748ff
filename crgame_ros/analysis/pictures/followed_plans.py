# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The plans that AVs followed in a recorded run, on its time line and in its coordinates."""

from collections.abc import Callable
import math
from pathlib import Path
from typing import NamedTuple

from crgame_ros.recording.recorded_plans import read_plans
from crgame_ros.recording.run_trajectories import RunTrajectories
import numpy as np
from numpy.typing import NDArray


class FollowedPlan(NamedTuple):
    """
    A plan of an AV.

    :param start_s: time since the start of the run at which it was available [s]
    :param stamp_s: time since the start of the run of its first pose [s]
    :param poses: (S, 3) of the rear axle in frame map, scenario steps apart.
    """

    start_s: float
    stamp_s: float
    poses: NDArray[np.float64]


def read_followed_plans(bag: Path, log: RunTrajectories,
                        progress: Callable[[float], object] | None = None
                        ) -> dict[str, tuple[FollowedPlan, ...]]:
    """
    Read the plans of each AV; empty where they were not recorded.

    The recording does not show which plans the engine accepted: refused ones are included.

    :param log: log of the same run.
    :param progress: called with the share of the recording read so far, 0 to 1.
    :raises InputError: as `read_plans`.
    """
    scheduler = log.game.scheduler
    found: dict[str, list[FollowedPlan]] = {av.id: [] for av in log.game.avs}
    for recorded in read_plans(bag, log.game.epoch, progress):
        av = log.game.av(recorded.av)
        if recorded.plan is None or recorded.k is None or av is None:
            continue
        stamp_s = (recorded.stamp_ns - scheduler.clock_offset_ns) * 1e-9
        # The run waits for the first answer; another one to the same request has no latency.
        waited_s = 0.0 if stamp_s == 0.0 or math.isnan(recorded.latency_s) \
            else recorded.latency_s * log.game.real_time_factor
        start_s = stamp_s + waited_s
        known = found[av.id]
        if known and start_s < known[-1].start_s:
            start_s = known[-1].start_s
        known.append(FollowedPlan(start_s, stamp_s,
                                  av.transform.to_simulation(recorded.plan.states[:, :3])))
    return {av_id: tuple(plans) for av_id, plans in found.items() if plans}
