# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The services and parameters that control sim_node."""

from collections import deque
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any
from uuid import uuid4

from crgame_ros.driver.source import is_replay
from crgame_ros.errors import InputError
from crgame_ros.game.game import Game, HumanSpec, load_game
from crgame_ros.game.seat_documents import SeatOccupant
from crgame_ros.paths import default_game, scenarios_directory
from crgame_ros.ros.endpoints import Endpoints
from crgame_ros.ros.number_parameters import declare_number, fixed
from crgame_ros.ros.run_ends import AT_END, EXIT, STAY, STAY_IF_CHOSEN
from crgame_ros.timing.time_controller import MAX_REAL_TIME_FACTOR, MIN_REAL_TIME_FACTOR
from rcl_interfaces.msg import ParameterDescriptor, SetParametersResult
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.task import Future
from std_srvs.srv import Trigger

# Drivers that do not depend on the scenario.
SCRIPTS = ('keys:', 'joy:')
# Time to put the hands on the controls after the last driver is ready [s].
COUNTDOWN_S = 3.0
OVER = 'the run is over: reset begins it anew'


@dataclass(eq=False)
class StepOrder:
    """
    An order of steps during a pause.

    :param steps: simulation steps; None for a scenario step, however many these are.
    :param tell: called after each simulation step with the number done so far; None for nobody.
    :ivar done: gets the step n at which the last one is done; None if they will not be done.
    :ivar count: simulation steps done so far.
    """

    steps: int | None
    tell: Callable[[int], object] | None = None
    done: Future = field(default_factory=Future)
    count: int = 0


class SimControl:
    """The orders to the simulation, as flags that its loop reads between cycles."""

    def __init__(self, node: Node) -> None:
        self._node = node
        # Names this process in /scenario/game, so that a recorder knows whether it goes on.
        self.simulation = uuid4().hex
        self.paused = False
        # Whether the pause was ordered, so that it is not that of a run that waits for its start.
        self.pause_ordered = False
        # Whether the run has begun: before that, an order of a step waits for participants.
        self.begun = False
        self._steps: deque[StepOrder] = deque()
        self.reset_wanted = False
        # Each gets why the game could not be used, or None, when the ordered reset is done.
        self._resets: list[Future] = []
        self.stop_wanted = False
        # Whether the node has to end with the run.
        self.quit_wanted = False
        # The run has ended, and the node stays for another one.
        self.over = False
        # Whether a game or scenario has been chosen since the start.
        self.chosen_later = False
        # The same since the last reset: a chosen game, even the same one, waits for a start.
        self.chosen_anew = False
        # Whether a start has been ordered since the last reset.
        self.started = False
        # Seats whose driver must come before the run begins.
        self.awaited: tuple[str, ...] = ()
        # Time until the run begins [s]; 0 unless all are ready and wait for it.
        self.countdown_s = 0
        self.seat_sources: dict[str, str] = {}
        self.seat_tenants: dict[str, SeatOccupant] = {}
        self._declare()
        # Kept beside the parameter because it is read in every cycle.
        self.real_time_factor = float(self._value('real_time_factor'))
        node.add_on_set_parameters_callback(self._on_parameters)
        node.add_post_set_parameters_callback(self._after_parameters)
        endpoints = Endpoints(node)
        # Other orders are served while one of a step waits. rclpy keeps groups by weak reference.
        self._group = ReentrantCallbackGroup()
        for name, callback in (('/sim/start', self._on_start), ('/sim/pause', self._on_pause),
                               ('/sim/step', self._on_step), ('/sim/reset', self._on_reset),
                               ('/sim/stop', self._on_stop)):
            endpoints.service(name, callback, group=self._group)
        self._chosen = 'game' if self._value('game') or not self._value('scenario') else 'scenario'
        # Files named on the command line are trusted; later orders may come from any DDS peer.
        self._directories = [Path(item).resolve() for item in self._value('scenario_directories')
                             if item] + [scenarios_directory().resolve()]
        self._first = self._value(self._chosen)
        if self._first:
            self._directories.append(Path(self._first).resolve().parent)

    def _declare(self) -> None:
        declare = self._node.declare_parameter
        declare('game', '', ParameterDescriptor(
            description='game file; taken at the start and at a reset'))
        declare('scenario', '', ParameterDescriptor(
            description='CommonRoad file instead of a game; taken at the start and at a reset'))
        fixed(self._node, 'scenario_directories', [''],
              'directories from which a later game or scenario may come')
        declare_number(self._node, 'real_time_factor', 1.0, 'simulated seconds per wall second',
                       (MIN_REAL_TIME_FACTOR, MAX_REAL_TIME_FACTOR), read_only=False)
        # From the command line [s]; 0 if none.
        self.duration_s = declare_number(
            self._node, 'duration', 0.0,
            "simulated seconds until the run ends; 0 takes the game's", (0.0, 1e7))
        self.starts_paused = fixed(self._node, 'start_paused', False,
                                   'wait for /sim/start, with each game anew')
        self.countdown_from_s = declare_number(
            self._node, 'countdown', COUNTDOWN_S, 'seconds from when all drivers at pages are '
            'ready to the start of the run', (0.0, 60.0))
        self.wants_realtime_priority = fixed(self._node, 'realtime_priority', False,
                                             'run under SCHED_FIFO where the system allows it')
        self.companions = tuple(filter(None, fixed(
            self._node, 'wait_for', [''],
            'companion nodes that must be connected before the run starts')))
        roster = fixed(self._node, 'roster', '', 'file that tells the launcher which vehicles the '
                       'game has; none if empty')
        self.roster = Path(roster) if roster else None
        folder = fixed(self._node, 'folder', '', "folder of the run's files, in which later runs "
                       'get their own; each later game is written there; none if empty')
        self.folder = Path(folder) if folder else None
        self._at_end = fixed(
            self._node, 'at_end', EXIT, 'what follows the end of a run: exit, stay until a reset '
            'or a signal, or stay-if-chosen: exit unless its game was chosen after the start')
        self.planner_timeout_s = declare_number(
            self._node, 'planner_timeout', 10.0,
            'seconds to wait for planners and companions at the start', (0.0, 1e4))
        if self._at_end not in AT_END:
            raise InputError(f'is "{self._at_end[:40]}"', 'parameter at_end',
                             'give ' + ', '.join(AT_END))

    def _value(self, name: str) -> Any:
        return self._node.get_parameter(name).value

    @property
    def stays(self) -> bool:
        """Return whether the node stays when a run has ended."""
        if self.quit_wanted:
            return False
        return self._at_end == STAY or (self._at_end == STAY_IF_CHOSEN and self.chosen_later)

    @property
    def stands_still(self) -> bool:
        """Return whether the run is paused and no step of it is ordered."""
        return self.paused and not self._steps

    def order_steps(self, steps: int | None,
                    tell: Callable[[int], object] | None = None) -> StepOrder:
        """Order steps during a pause; see `StepOrder`."""
        order = StepOrder(steps, tell)
        self._steps.append(order)
        return order

    def withdraw(self, order: StepOrder) -> None:
        """Answer an order of steps that shall not go on."""
        with suppress(ValueError):
            self._steps.remove(order)
            order.done.set_result(None)

    def count_step(self, steps_per_tick: int, n: int) -> None:
        """
        Count down the steps ordered during a pause.

        :param steps_per_tick: simulation steps of a scenario step.
        :param n: the simulation step that has been done.
        """
        if not (self.paused and self._steps):
            self.end_steps()
            return
        order = self._steps[0]
        order.count += 1
        if order.tell is not None:
            order.tell(order.count)
        if order.count >= (steps_per_tick if order.steps is None else order.steps):
            self._steps.popleft().done.set_result(n)

    def end_steps(self) -> None:
        """Answer the orders of steps that will not be done as such."""
        while self._steps:
            self._steps.popleft().done.set_result(None)

    def start(self) -> None:
        """Let the run begin, or go on."""
        self.paused, self.pause_ordered, self.started = False, False, True

    def pause(self) -> None:
        """Let everything stand still after the present step."""
        self.paused = self.pause_ordered = True

    def hold(self) -> None:
        """Let the run stand at its first step until it is started: a begun one needs a reset."""
        self.paused, self.pause_ordered, self.started = True, False, False

    def reset(self) -> Future:
        """
        Begin the run anew.

        :return: gets why the chosen game could not be used, or None, once the run is there.
        """
        self.reset_wanted, self.started = True, False
        self._resets.append(Future())
        return self._resets[-1]

    def end_reset(self, problem: str | None) -> None:
        """Answer the orders of a reset; problem: why the chosen game could not be used."""
        self.reset_wanted = False
        for done in self._resets:
            done.set_result(problem)
        self._resets.clear()

    def stop(self) -> None:
        """End the run."""
        self.stop_wanted = True

    def shut_down(self) -> None:
        """End the run, and the node with it."""
        self.stop_wanted = self.quit_wanted = True

    @property
    def choice(self) -> tuple[str, str]:
        """Return what is loaded at a reset: game or scenario, and its name."""
        return self._chosen, self._value(self._chosen)

    def choose(self, kind: str, name: str) -> str:
        """
        Choose what is loaded at a reset, by the parameter that names it.

        :param kind: game or scenario.
        :return: why this is refused; empty if it is not.
        """
        answer, = self._node.set_parameters([Parameter(kind, value=name)])
        if answer.successful:
            self._chosen = kind
        return str(answer.reason)

    def first_game(self) -> Game:
        """
        Load the game that the command line names.

        :raises InputError: if it cannot be used.
        """
        name = self._value(self._chosen)
        if not name or Path(name).is_file():
            return self._game(name)
        return self._game(str(self._allowed(name, self._chosen)))

    def next_game(self, present: Game) -> Game:
        """
        Load the game that the parameters name now, for a reset.

        :param present: a new scenario keeps its humans with their drivers, and its rules. A
            recording fits only its own scenario, so the game's default driver replaces it.
        :raises InputError: if it cannot be used or lies outside the configured directories.
        """
        name = self._value(self._chosen)
        self.chosen_later |= name != self._first
        if self._chosen != 'scenario' or not name:
            return self._game(str(self._allowed(name, 'game')) if name else '')
        path = self._allowed(name, 'scenario')
        if path.samefile(present.scenario):
            return present
        for human in present.humans:
            if human.driver.startswith(SCRIPTS):
                self._node.get_logger().info(
                    f'{human.id}: its script, {human.driver}, begins anew in {path.name}: it was '
                    'written for another road')
        humans = tuple(
            replace(human, spawn=None,
                    driver=HumanSpec.driver if is_replay(human.driver) else human.driver)
            for human in present.humans)
        return replace(present, scenario=path, title='', humans=humans, avs=None)

    def _game(self, path: str) -> Game:
        if not path:
            return load_game(default_game())
        return Game(Path(path)) if self._chosen == 'scenario' else load_game(Path(path))

    def _allowed(self, name: str, kind: str) -> Path:
        """Return the path of a game or scenario, by its name or as a file in a known directory."""
        for directory in self._directories:
            for ending in ('', '.yaml' if kind == 'game' else '.xml'):
                # A text may be no name of a file: too long, or with a zero byte.
                with suppress(OSError, ValueError):
                    path = (directory / f'{name}{ending}').resolve()
                    if path.is_relative_to(directory) and path.is_file():
                        return path
        raise InputError(f'"{name[:200]}" is in none of the configured directories', 'sim_node',
                         'name a file of the parameter scenario_directories')

    def _on_parameters(self, parameters: list[Parameter]) -> SetParametersResult:
        for parameter in parameters:
            if parameter.name in ('game', 'scenario') and parameter.value:
                try:
                    self._allowed(str(parameter.value), parameter.name)
                except InputError as error:
                    return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    def _after_parameters(self, parameters: list[Parameter]) -> None:
        for parameter in parameters:
            if parameter.name in ('game', 'scenario'):
                self.chosen_anew = True
                if parameter.value:
                    self._chosen = parameter.name
            if parameter.name == 'real_time_factor':
                self.real_time_factor = float(parameter.value)

    def _on_start(self, _: object, response: Trigger.Response) -> object:
        if self.over:
            return _answer(response, False, OVER)
        self.start()
        return _answer(response, True, f'waiting for the driver of {" and ".join(self.awaited)}'
                       if self.awaited else 'running')

    def _on_pause(self, _: object, response: Trigger.Response) -> object:
        if self.over:
            return _answer(response, False, OVER)
        self.pause()
        return _answer(response, True, 'paused')

    async def _on_step(self, _: object, response: Trigger.Response) -> object:
        if self.over:
            return _answer(response, False, OVER)
        if not self.paused:
            return _answer(response, False, 'not paused: call /sim/pause first')
        order = self.order_steps(None)
        if not self.begun:
            return _answer(response, True, 'once the run begins')
        n = await order.done
        return _answer(response, n is not None, f'at n = {n}' if n is not None else
                       'not done: the run goes on or is over')

    def _on_reset(self, _: object, response: Trigger.Response) -> object:
        self.reset()
        return _answer(response, True, 'resetting')

    def _on_stop(self, _: object, response: Trigger.Response) -> object:
        if self.over:
            return _answer(response, False, OVER)
        self.stop()
        return _answer(response, True, 'stopping')


def _answer(response: Trigger.Response, success: bool, text: str) -> object:
    response.success, response.message = success, text
    return response
