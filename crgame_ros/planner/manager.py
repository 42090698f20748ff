# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The planners of one AV in a run: which is in charge, and what is said of it."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
import math
from statistics import median

from crgame_ros.each_minute import EachMinute, kind_of
from crgame_ros.game.events import EventSpec, PlannerSwap, SpeedLimit
from crgame_ros.messages.plan import Plan, PlanRequest
from crgame_ros.messages.status_values import BRAKING, OK, Status, WARN
from crgame_ros.planner.adapter import Clock, PlannerAdapter, PlannerStatistics
from crgame_ros.planner.interface import PlannerContext
from crgame_ros.planner.registry import create_planner
from crgame_ros.roads.speed_limits import set_speed_limit, with_own_roads

# A planner is slow if it takes longer than so many scenario steps: the median of so many answers.
SLOW_STEPS, RECENT = 2, 5
# Answers from one report of the counts to the next.
_REPORTED = 10


def swapped_in(vehicle_id: str, events: Sequence[EventSpec]) -> tuple[str, ...]:
    """Return the names of the planners to which events switch an AV."""
    return tuple(event.action.planner for event in events
                 if isinstance(event.action, PlannerSwap) and event.action.av == vehicle_id)


class PlannerManager:
    """
    The active planner of an AV; events switch it and change its roads.

    Every planner is created and set up before the run, so that an event costs no time in the run.
    After a change of speed limits the active planner is set up again at once, and each other one
    when it becomes active.

    :param name: of the game's planner for the AV.
    :param options: of that planner.
    :param events: all events of the game.
    :param clock: seconds from a steady clock, to time each plan; None measures nothing.
    :raises InputError: if a planner cannot be created.
    """

    def __init__(self, context: PlannerContext, name: str, options: Mapping[str, object],
                 events: Sequence[EventSpec] = (), clock: Clock | None = None) -> None:
        self._events = {event.name: event.action for event in events
                        if isinstance(event.action, SpeedLimit)
                        or (isinstance(event.action, PlannerSwap)
                            and event.action.av == context.vehicle_id)}
        if any(isinstance(action, SpeedLimit) for action in self._events.values()):
            # The limits change in the planners' own copy, not in the scenario of other runs.
            context = replace(context, scenario=with_own_roads(context.scenario))
        self._context = context
        self._done: set[str] = set()
        self.name = name
        self.statistics = PlannerStatistics()
        self._adapters = {
            event: self._made(action.planner, action.options, clock)
            for event, action in self._events.items() if isinstance(action, PlannerSwap)}
        self.adapter = self._made(name, options, clock)
        self._outdated: set[str] = set()
        self.failure = self.adapter.setup(context)
        for adapter in self._adapters.values():
            adapter.setup(context)

    def _made(self, name: str, options: Mapping[str, object],
              clock: Clock | None) -> PlannerAdapter:
        adapter = PlannerAdapter(create_planner(name, options), clock)
        adapter.statistics = self.statistics
        return adapter

    @property
    def last_reason(self) -> str | None:
        """Return the reason why the last plan was a braking plan; None if it was none."""
        return self.adapter.last_reason

    def plan(self, request: PlanRequest) -> Plan:
        """Answer a request with the active planner."""
        return self.adapter.plan(request)

    def apply(self, fired: Sequence[str]) -> list[str]:
        """
        Apply the events that have fired.

        :param fired: names of all events so far in their order; those already applied are skipped
        :return: a message about each change, one line each
        """
        said = []
        for name in fired:
            action = self._events.get(name)
            if action is None or name in self._done:
                continue
            self._done.add(name)
            said.append(self._limit(action) if isinstance(action, SpeedLimit)
                        else self._swap(name, action.planner))
        return said

    def _limit(self, action: SpeedLimit) -> str:
        set_speed_limit(self._context.scenario, action.speed, action.lanelets)
        self._outdated = set(self._adapters)
        self.failure = self.adapter.setup(self._context)
        return self._said(f'speed limit {action.speed:g} m/s')

    def _swap(self, event: str, planner: str) -> str:
        self.adapter, self.name = self._adapters[event], planner
        # Its setup in advance may be older than a change of speed limits, or have failed.
        if event in self._outdated:
            self._outdated.discard(event)
            self.adapter.setup(self._context)
        self.failure = self.adapter.setup_failure
        return self._said(f'planner {planner}')

    def _said(self, text: str) -> str:
        return text if self.failure is None else f'{text}: {self.failure}'


class FailureLines:
    """
    The lines about the failures of one AV's planner.

    :param vehicle_id: of the AV.
    :param say: prints or logs a text.
    :param step_s: scenario step, in which an answer is due [s]
    """

    def __init__(self, vehicle_id: str, say: Callable[[str], object],
                 step_s: float = math.inf) -> None:
        self._vehicle_id, self._say, self._step_s = vehicle_id, say, step_s
        self._timed_out = 0
        self._shown = ''
        self._minute = EachMinute()

    def note(self, manager: 'PlannerManager') -> None:
        """Tell what is new after a setup or an answer."""
        recent = manager.statistics.durations_s[-RECENT:]
        if len(recent) == RECENT and (took_s := median(recent)) > SLOW_STEPS * self._step_s:
            self._tell(f'planner {manager.name} is slow',
                       f'{took_s:.2f} s for a plan, a scenario step is {self._step_s:g} s')
        failure = manager.statistics.failure
        if failure != self._shown:
            self._shown = failure
            self._say(f'{self._vehicle_id}: planner {manager.name} has failed:\n'
                      + failure.rstrip())
        if manager.last_reason is not None:
            self._tell(f'brakes along its last plan, planner {manager.name}', manager.last_reason)

    def wait(self, timed_out: int, limit_s: float) -> None:
        """
        Tell that requests stayed without an answer.

        :param timed_out: number of them so far.
        :param limit_s: for which the planner was waited for each time [s]
        """
        if timed_out > self._timed_out:
            self._tell('its planner is slow or gone',
                       f'no answer in {limit_s:g} s, requests so far without one: {timed_out}')
        self._timed_out = timed_out

    def refuse(self, reason: str | None) -> None:
        """Tell that an answer was refused; None: it was not."""
        if reason is not None:
            self._tell('its planner answered, but the plan was refused', reason)

    def _tell(self, what: str, reason: str) -> None:
        text = f'{what}: {reason}'
        line = self._minute.line(kind_of(text), f'{self._vehicle_id}: {text}')
        if line is not None:
            self._say(line)


def planner_status(av: str, k: int, plan: Plan, manager: PlannerManager) -> Status | None:
    """
    Return what is told after an answer: each braking plan, and the counts at every tenth answer.

    :param av: its id.
    :param k: scenario step of the request.
    :param manager: of the planner; without a clock, its status has no planning time.
    :return: None if there is nothing to tell.
    """
    statistics = manager.statistics
    if not plan.fallback and statistics.plans % _REPORTED:
        return None
    took_s = statistics.durations_s[-1:]
    return Status.of(
        f'planner_node: {av}', WARN if plan.fallback else OK,
        f'{BRAKING}{manager.last_reason}' if plan.fallback else 'planning',
        {'k': k, 'plans': statistics.plans, 'fallbacks': statistics.fallbacks,
         **({'plan_time_ms': f'{took_s[0] * 1e3:.3f}'} if took_s else {}),
         'planner': manager.name})
