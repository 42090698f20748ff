# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The tasks of one run: onsets of stimuli and requests, and their outcomes."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from hashlib import sha256

from crgame_ros.game.events import AtStep, AtTime, FiredEvent
from crgame_ros.game.objects import ObjectStates
from crgame_ros.game.scenario_scheduler import ScenarioScheduler
from crgame_ros.game.task_documents import (
    NOT_MEASURED,
    OpenPrompt,
    PageTimes,
    TaskEntry,
    TaskHappening,
    TaskReport,
)
from crgame_ros.game.task_spec import (
    DetectionResponse,
    OnEvent,
    TakeOverPrompt,
    TaskCondition,
    TaskSpec,
)
from crgame_ros.simulation.game_check import task_seat
from crgame_ros.simulation.run_events import ConditionCheck
from crgame_ros.simulation.setup import Setup
from crgame_ros.vehicle.state import VehicleState
import numpy as np


class StimulusSchedule:
    """
    The onsets of one task, at random intervals.

    The first interval starts with the task. Equal seeds and names give equal times on every
    machine, independent of the rest of the run.

    :param task: its shortest and longest time between onsets.
    :param name: of the task: two tasks of one game get different onsets.
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
        """Draw the next onset."""
        self._after_s += self._shortest_s + self._random.random() * (
            self._longest_s - self._shortest_s)
        self.next_n = self._begin_n + round(self._after_s / self._dt_s)


# A page's answer may arrive this long after the limit: display and network take time [s].
GRACE_S = 0.5
# More reports in a second do not come from a person.
REPORTS_PER_S = 20


@dataclass
class _Course:
    """The state of one task."""

    spec: TaskSpec
    seat: str
    when: TaskCondition | None
    running: bool = False
    begun: bool = False
    pressed: bool = False
    may_end: bool = True
    number: int = 0
    shown: int = 0
    schedule: StimulusSchedule | None = None
    prompt: OpenPrompt | None = None
    # Step at which the event of a request is triggered.
    due_n: int | None = None


class RunTasks:
    """
    Begins and ends tasks, makes their stimuli and requests, and processes answers.

    Conditions and buttons take effect at the scenario's ticks; stimuli appear and disappear
    at any step.

    :param setup: the run.
    """

    def __init__(self, setup: Setup) -> None:
        self._setup = setup
        self._courses = {spec.name: _Course(spec, task_seat(spec, setup.vehicle_ids),
                                            self._begins(spec)) for spec in setup.game.tasks}
        self._columns = {item.id: column
                         for column, item in enumerate(setup.obstacles.descriptions)}
        self._timed = {event.name for event in setup.game.events
                       if isinstance(event.when, AtTime | AtStep)}
        self._happened: set[str] = set()
        self._entries: list[TaskEntry] = []
        self._reports: list[TaskReport] = []
        # Of each seat: the second of its last report, and how many came in that second.
        self._taken: dict[str, tuple[int, int]] = {}
        self._n = 0

    def _begins(self, spec: TaskSpec) -> TaskCondition | None:
        """Return the condition that begins a task; for a request also its event's time."""
        if spec.when is not None or not isinstance(spec.task, TakeOverPrompt):
            return spec.when
        about = next((event.when for event in self._setup.game.events
                      if event.name == spec.task.before), None)
        scheduler = self._setup.scheduler
        if isinstance(about, AtStep):
            about = AtTime((about.step - scheduler.k0) * scheduler.time_step_s)
        return AtTime(about.time - spec.task.lead) if isinstance(about, AtTime) else None

    @property
    def running(self) -> tuple[str, ...]:
        """Return the names of the tasks that are running."""
        return tuple(name for name, course in self._courses.items() if course.running)

    @property
    def prompts(self) -> tuple[OpenPrompt, ...]:
        """Return the stimuli and requests that are neither answered nor over."""
        return tuple(course.prompt for course in self._courses.values() if course.prompt)

    def trigger(self, name: str) -> str | None:
        """
        Begin a task at the next tick, or end it if it is running.

        :return: None if it will, else the reason why not.
        """
        course = self._courses[name]
        if course.prompt is not None and isinstance(course.spec.task, TakeOverPrompt):
            return f'"{name}" is being shown'
        course.pressed = True
        return None

    def report(self, report: TaskReport) -> str | None:
        """
        Accept a page's report or its driver's answer; it takes effect at the next step.

        :return: None if it is accepted, else the reason why not.
        """
        course = self._courses.get(report.task)
        if course is None or course.seat != report.seat:
            return f'there is no task "{report.task}" for {report.seat}'
        second = int(self._n * self._setup.scheduler.dt_s)
        last, count = self._taken.get(report.seat, (second, 0))
        count = count if last == second else 0
        if count == REPORTS_PER_S:
            return f'{report.seat}: more than {REPORTS_PER_S} reports in a second'
        self._taken[report.seat] = (second, count + 1)
        self._reports.append(report)
        return None

    def due_events(self, n: int) -> list[str]:
        """Return the names of events that requests have announced and that are due by now."""
        due: list[str] = []
        for course in self._courses.values():
            task = course.spec.task
            if course.due_n is not None and n >= course.due_n and isinstance(task, TakeOverPrompt):
                course.due_n = None
                due.append(str(task.before))
        return due

    def at_tick(self, n: int, k: int, states: Sequence[VehicleState], objects: ObjectStates,
                fired: Sequence[FiredEvent]) -> None:
        """
        Begin and end tasks.

        :param states: of the driven vehicles at n.
        :param objects: at k.
        :param fired: events that have taken effect at this tick.
        """
        self._n = n
        self._happened |= {event.name for event in fired}
        conditions = ConditionCheck(self._setup, k, states, objects, self._columns)

        def holds(condition: TaskCondition | None) -> bool:
            if isinstance(condition, OnEvent):
                return condition.event in self._happened
            return condition is not None and conditions.holds(condition)
        for course in self._courses.values():
            by = 'trigger' if course.pressed else 'condition'
            if course.running:
                if course.pressed or (course.may_end and holds(course.spec.until)):
                    self._end(course, by)
            elif course.pressed or (not course.begun and holds(course.when)):
                self._begin(course, by)
                # Restarted by the button after that, it is ended by the button.
                course.may_end = not holds(course.spec.until)
            course.pressed = False

    def at_step(self, n: int, driven: Mapping[str, bool]) -> tuple[TaskEntry, ...]:
        """
        Show new stimuli, process reports, and close stimuli that were not answered in time.

        :param driven: whether a driver has the vehicle, by its id.
        :return: the entries since the last step.
        """
        self._n = n
        for report in self._reports:
            self._add_report(self._courses[report.task], report)
        self._reports.clear()
        for course in self._courses.values():
            task = course.spec.task
            if isinstance(task, DetectionResponse):
                self._detect(course, task)
            elif isinstance(task, TakeOverPrompt) and course.prompt is not None:
                self._request(course, task, driven[course.seat])
        entries, self._entries = tuple(self._entries), []
        return entries

    def _begin(self, course: _Course, by: str) -> None:
        task = course.spec.task
        course.begun = True
        if isinstance(task, TakeOverPrompt):
            course.number += 1
            self._note(course, 'request', course.number, by)
            course.prompt = OpenPrompt(course.spec.name, course.seat, course.number, self._n)
            if task.before is not None and task.before not in self._happened | self._timed:
                course.due_n = self._n + self._steps(task.lead)
            return
        course.running = True
        self._note(course, 'begin', 0, by)
        if isinstance(task, DetectionResponse):
            # A restarted task has other onsets, which are the same on every machine too.
            name = f'{course.spec.name}/{course.number}'
            course.schedule = StimulusSchedule(
                task, name, self._setup.game.seed, self._setup.scheduler, self._n)

    def _end(self, course: _Course, by: str) -> None:
        course.running, course.schedule = False, None
        if course.prompt is not None:
            # The time to answer it was cut short, so it does not count.
            self._close(course, 'over', 'end')
        self._note(course, 'end', 0, by)

    def _detect(self, course: _Course, task: DetectionResponse) -> None:
        schedule, prompt = course.schedule, course.prompt
        comes = schedule is not None and self._n >= schedule.next_n
        if prompt is not None and (
                comes or self._n - prompt.n >= self._steps(task.latest + GRACE_S)):
            self._close(course, 'missed', '' if prompt.seen else 'unseen')
        if schedule is not None and comes:
            schedule.advance()
            course.number += 1
            course.prompt = OpenPrompt(course.spec.name, course.seat, course.number, self._n)
            self._note(course, 'stimulus', course.number)

    def _request(self, course: _Course, task: TakeOverPrompt, driven: bool) -> None:
        autonomous = course.seat not in {human.id for human in self._setup.humans}
        if autonomous and driven:
            self._close(course, 'over', 'driven')
        elif course.prompt and self._n - course.prompt.n >= self._steps(task.lead + task.shown):
            self._close(course, 'over', 'time')

    def _add_report(self, course: _Course, report: TaskReport) -> None:
        task, prompt, times = course.spec.task, course.prompt, report.times
        concerns = prompt is not None and prompt.number == report.number
        if report.what == 'shown':
            # The first page's report counts; it may arrive after the answer.
            if course.shown < report.number == course.number:
                course.shown = report.number
                course.prompt = prompt and replace(prompt, seen=True)
                self._note(course, 'shown', report.number, times=times)
            return
        if not isinstance(task, DetectionResponse) or not (course.running or prompt):
            return
        since_ms = times.response_ms
        if not concerns or since_ms is None or not 0.0 <= since_ms <= 1e3 * task.latest:
            if not any(entry.task == report.task and entry.what == 'unrequested'
                       for entry in self._entries):
                # At most one a step: a person is not quicker.
                self._note(course, 'unrequested', 0, times=times)
        else:
            outcome = 'premature' if since_ms < 1e3 * task.earliest else 'hit'
            self._close(course, 'answer', outcome, times)

    def _close(self, course: _Course, what: TaskHappening, by: str = '',
               times: PageTimes = NOT_MEASURED) -> None:
        if course.prompt is not None:
            self._note(course, what, course.prompt.number, by, times)
            course.prompt = None

    def _note(self, course: _Course, what: TaskHappening, number: int, by: str = '',
              times: PageTimes = NOT_MEASURED) -> None:
        self._entries.append(TaskEntry(self._n, course.spec.name, course.spec.kind, course.seat,
                                       what, number, by, times))

    def _steps(self, seconds: float) -> int:
        return round(seconds / self._setup.scheduler.dt_s)
