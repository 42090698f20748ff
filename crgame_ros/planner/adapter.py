# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The adapter that every planner runs behind: its failures become braking plans."""

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field, replace
import traceback

from crgame_ros.each_minute import kind_of
from crgame_ros.errors import CrgameError, PlanningError
from crgame_ros.geometry.curve import arc_length
from crgame_ros.messages.plan import Plan, PlanRequest
from crgame_ros.planner.interface import Planner, PlannerContext
from crgame_ros.planner.path_following import braking_plan
from crgame_ros.planner.plan_check import check_start, RoadLimit
from crgame_ros.vehicle.state import StateColumn, VehicleState
from crgame_ros.vehicle.stopping import firm_braking
import numpy as np

Clock = Callable[[], float]


@dataclass
class PlannerStatistics:
    """
    Statistics of a planner's answers so far.

    :param plans: answers given, braking plans included.
    :param fallbacks: braking plans given.
    :param shortened: plans given that stop before the planner's plan leaves the road.
    :param reasons: how often each reason for braking occurred; those that differ in numbers alone
        count together, under the first of them.
    :param durations_s: duration of each call; empty without a clock [s]
    :param failure: traceback of the first failure of the planner's code; empty without one.
    """

    plans: int = 0
    fallbacks: int = 0
    shortened: int = 0
    reasons: Counter[str] = field(default_factory=Counter)
    durations_s: list[float] = field(default_factory=list)
    failure: str = ''
    _first: dict[str, str] = field(default_factory=dict)

    def count_reason(self, reason: str) -> None:
        """Count a reason for braking."""
        self.reasons[first_of_kind(self._first, reason)] += 1


class PlannerAdapter:
    """
    A wrapper around a planner that always answers.

    A braking plan along the last plan (`Plan.fallback` is set) is the answer if `setup` or `plan`
    raises an exception, or if the plan has the wrong stamp, numbers that are not finite, or
    another first state than the request. A plan that leaves the road further than its start is
    off it is driven as far as it is right, with a stop before that place; if it is too near for
    that, the answer is a braking plan. Fallbacks and shortened plans are counted. Exits and
    interrupts pass.

    :param clock: seconds from a steady clock, to time each call; None measures nothing.
    """

    def __init__(self, planner: Planner, clock: Clock | None = None) -> None:
        self.planner = planner
        self.statistics = PlannerStatistics()
        self.last_reason: str | None = None
        # None once it is set up.
        self.setup_failure: str | None = 'the planner was not set up'
        self._clock = clock
        self._last_plan: Plan | None = None

    def setup(self, context: PlannerContext) -> str | None:
        """
        Set the planner up.

        :return: the reason of a failure, or None; after a failure the planner gets no requests
            until the next setup.
        """
        self._vehicle = context.vehicle
        self._deceleration = firm_braking(context.vehicle)
        self._last_plan = None
        self.setup_failure = self.last_reason = None
        try:
            self._limit = RoadLimit.from_context(context)
            self.planner.setup(context)
        except Exception as error:
            self._keep_failure(error)
            self.setup_failure = self.last_reason = f'setup failed: {describe(error)}'
        return self.setup_failure

    def plan(self, request: PlanRequest) -> Plan:
        """
        Answer a request with the planner's plan or a braking plan.

        :raises CrgameError: if `setup` was never called.
        """
        if not hasattr(self, '_vehicle'):
            raise CrgameError(f'planner {self.planner.name} was asked for a plan before its setup')
        start = self._clock() if self._clock else 0.0
        plan, reason = self._ask(request)
        if plan is None:
            plan = braking_plan(request, self._last_plan, self._vehicle, self._deceleration)
        if self._clock:
            self.statistics.durations_s.append(self._clock() - start)
        self.last_reason = reason
        self.statistics.plans += 1
        if reason is not None:
            self.statistics.fallbacks += 1
            self.statistics.count_reason(reason)
        self._last_plan = plan
        return plan

    def _ask(self, request: PlanRequest) -> tuple[Plan | None, str | None]:
        if self.setup_failure is not None:
            return None, self.setup_failure
        try:
            plan = self.planner.plan(request)
            if not isinstance(plan, Plan):
                return None, f'the planner returned a {type(plan).__name__}, not a Plan'
            reason = check_start(plan, request.ego, request.stamp_ns)
            if reason is None and (found := self._limit.first_beyond(plan.states)) is not None:
                shortened = self._shortened(request, plan, found[0])
                if shortened is not None:
                    self.statistics.shortened += 1
                    return shortened, None
                reason = self._limit.refusal(plan.states)
        except Exception as error:
            self._keep_failure(error)
            return None, describe(error)
        return (plan, None) if reason is None else (None, reason)

    def _shortened(self, request: PlanRequest, plan: Plan, end: int) -> Plan | None:
        """Return a plan that stops on its way before a state; None if that is too near."""
        states = plan.states[:end]
        s = arc_length(states[:, :2])
        stops = states[:, StateColumn.SPEED]**2 <= 2.0 * self._deceleration * (s[-1] - s)
        last = int(np.flatnonzero(stops)[-1]) if stops.any() else 0
        if last == 0:
            return None
        then = replace(request, ego=VehicleState(*states[last].tolist()),
                       stamp_ns=request.stamp_ns + round(last * request.time_step_s * 1e9))
        stop = braking_plan(then, plan, self._vehicle, self._deceleration)
        return Plan(plan.stamp_ns, np.concatenate((states[:last], stop.states)))

    def _keep_failure(self, error: Exception) -> None:
        if not self.statistics.failure and not isinstance(error, PlanningError):
            frames = error.__traceback__
            # The caller's frame here says nothing about the planner.
            if frames is not None and frames.tb_next is not None:
                frames = frames.tb_next
            self.statistics.failure = ''.join(traceback.format_exception(
                type(error), error, frames))


def describe(error: Exception) -> str:
    """Return the text of an exception in one line; unexpected ones with their type."""
    text = ' '.join(str(error).split())
    if isinstance(error, PlanningError):
        return text
    return f'{type(error).__name__}: {text}' if text else type(error).__name__


def first_of_kind(first: dict[str, str], reason: str) -> str:
    """
    Return the first reason of the same kind.

    :param first: by kind; gets this reason if it is the first of its kind.
    """
    return first.setdefault(kind_of(reason), reason)
