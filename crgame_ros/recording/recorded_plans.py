# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Reads the plans of a recorded run one by one, each with the request that it answers."""

from collections import OrderedDict
from collections.abc import Callable, Iterator
import math
from pathlib import Path
from typing import NamedTuple

from crgame_ros.errors import InputError
from crgame_ros.messages.cdr import header_stamp_ns
from crgame_ros.messages.joints import (
    from_joint_trajectory,
    plan_from_joints,
    vehicle_joint_names,
    vehicles_from_joints,
)
from crgame_ros.messages.plan import Plan
from crgame_ros.messages.request_layout import request_head
from crgame_ros.recording.epochs import Epoch, read_epoch
from crgame_ros.recording.reader import BagReader
from crgame_ros.recording.storage import BagMessage
from crgame_ros.vehicle.state import VehicleState

# Number of whole requests kept until they are answered; they are large, and the engine does not
# look further back either.
_KEPT = 64


class RecordedPlan(NamedTuple):
    """
    A recorded answer of a planner.

    :param av: id of the AV.
    :param stamp_ns: of the request that it answers [ns]
    :param k: scenario step of that request; None if the stamp belongs to no step.
    :param latency_s: log time between the last sending of the request and this first answer to
        it; NaN for every further answer, and if the request was not recorded [s]
    :param plan: in the AV's scenario coordinates; None if the answer was malformed.
    :param fault: why it was malformed, else empty.
    :param told: the AV's state in the request, in the same coordinates; None if the request was
        not recorded.
    """

    av: str
    stamp_ns: int
    k: int | None
    latency_s: float
    plan: Plan | None
    fault: str
    told: VehicleState | None


class OpenRequests:
    """The sending times of requests that have not been answered yet."""

    def __init__(self) -> None:
        self._asked_ns: dict[tuple[str, int], int] = {}

    def sent(self, av: str, stamp_ns: int, log_time_ns: int) -> None:
        """Store a request; a repeated request counts from its last sending."""
        self._asked_ns[av, stamp_ns] = log_time_ns

    def answered(self, av: str, stamp_ns: int, log_time_ns: int) -> int | None:
        """
        Return the log time between a request and its answer [ns].

        :return: None if no request with that stamp is open.
        """
        asked_ns = self._asked_ns.pop((av, stamp_ns), None)
        return None if asked_ns is None else log_time_ns - asked_ns


def read_plans(path: Path, epoch: int | None = None,
               progress: Callable[[float], object] | None = None) -> Iterator[RecordedPlan]:
    """
    Read the plans of a run in the order in which they were recorded, without keeping them.

    :param path: a recording, finished or cut off.
    :param epoch: which run, where a recording holds several; None for the last.
    :param progress: called with the share of the recording that has been read, 0 to 1.
    :raises InputError: if the recording lacks its documents, or is damaged inside.
    """
    with BagReader(path, parts=True, progress=progress) as reader:
        run = read_epoch(reader, epoch)
        requests = {f'/{av.id}/plan_request': av.id for av in run.game.avs}
        plans = {f'/{av.id}/plan': av.id for av in run.game.avs}
        times, kept = OpenRequests(), OrderedDict[tuple[str, int], BagMessage]()
        for message in reader.messages((*requests, *plans)):
            stamp_ns = header_stamp_ns(message.data)
            if not run.holds(stamp_ns, message.log_time_ns):
                continue
            if message.topic in requests:
                av = requests[message.topic]
                times.sent(av, stamp_ns, message.log_time_ns)
                kept[av, stamp_ns] = message
                if len(kept) > _KEPT * len(requests):
                    kept.popitem(last=False)
                continue
            av = plans[message.topic]
            lapse_ns = times.answered(av, stamp_ns, message.log_time_ns)
            plan, fault = _plan(reader, message, av, run)
            asked, n = kept.get((av, stamp_ns)), run.game.scheduler.tick_of_stamp(stamp_ns)
            yield RecordedPlan(
                av, stamp_ns, None if n is None else run.game.scheduler.k(n),
                math.nan if lapse_ns is None else lapse_ns * 1e-9, plan, fault,
                None if asked is None else _requested_state(asked, av))


def _plan(reader: BagReader, message: BagMessage, av: str, run: Epoch) -> tuple[Plan | None, str]:
    try:
        series = from_joint_trajectory(reader.decode(message).message, message.topic)
        return plan_from_joints(series, av, run.game.scheduler.time_step_ns), ''
    except InputError as error:
        return None, error.what


def _requested_state(message: BagMessage, av: str) -> VehicleState | None:
    """Return the state of the AV itself in a request; None if the request lacks it."""
    try:
        head = request_head(message.data, message.topic)
    except InputError:
        return None
    if head.names != vehicle_joint_names(av):
        return None
    state, = vehicles_from_joints(head.positions, head.velocities, head.accelerations).tolist()
    return VehicleState(*state)
