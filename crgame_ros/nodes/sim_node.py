# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""sim_node: paces the simulation against the wall clock (CRG algorithms 1 and 2, live)."""

from contextlib import nullcontext
from dataclasses import asdict
from functools import partial
import json
import os
import time
from typing import TYPE_CHECKING

from crgame_ros.driver.source import COCKPIT, is_replay
from crgame_ros.errors import CrgameError, InputError
from crgame_ros.game.game import Game
from crgame_ros.nodes.sim.control import SimControl
from crgame_ros.nodes.sim.live_run import LiveRun
from crgame_ros.nodes.sim.run_state import Outcome
from crgame_ros.nodes.sim.simulation_interfaces import offer_simulation_interfaces
from crgame_ros.recording.run_folder import GAME_FILE, run_folder
from crgame_ros.ros.endpoints import Endpoints
from crgame_ros.ros.namespace_lock import hold_namespace
from crgame_ros.ros.node_main import run_node, StopFlag
from crgame_ros.ros.run_profile import open_topics
from crgame_ros.simulation.roster import Participants
from crgame_ros.simulation.setup import build_setup, Setup
from crgame_ros.timing.thread_counters import lock_memory, shorten_time_slice
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node

if TYPE_CHECKING:
    from crgame_ros.recording.recorded_game import RecordedInputs

NS_PER_S = 1_000_000_000
# /clock starts here: ROS takes a time of zero for "no clock yet".
FIRST_OFFSET_NS = NS_PER_S
REALTIME_PRIORITY = 50
# Nodes discover each other within this time [s].
DISCOVERY_S = 2.0
# Time to wait for a simulation's state, which is published every second [s].
ALIVE_S = 6.0


class SimNode(Node):
    """The live runner: one epoch after another, each with its own interval of /clock."""

    def __init__(self) -> None:
        super().__init__('sim_node')
        self._control = SimControl(self)
        self._interfaces = offer_simulation_interfaces(self, self._control)
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(self)
        self._recorded: RecordedInputs | None = None
        self._created_s = time.monotonic()

    def run(self, stop: StopFlag) -> None:
        """Run until the game ends or a stop is asked for."""
        # A launcher holds the namespace for the nodes that it started.
        place = hold_namespace(str(self.context.get_domain_id()), self.get_namespace()) \
            if self._control.roster is None else nullcontext()
        with place:
            self._run(stop)

    def _run(self, stop: StopFlag) -> None:
        setup = self._announce(build_setup(self._control.first_game()))
        # A launcher knows of the other simulations that it started.
        refuse_another(self, self._created_s + (DISCOVERY_S if self._control.roster is None
                                                else 0.0))
        if self._control.wants_realtime_priority:
            self._raise_priority()
        else:
            shorten_time_slice()
        # Where it is refused, the causes of late steps show pages that the system has reclaimed.
        lock_memory()
        self._control.paused = self._control.starts_paused
        epoch, offset_ns, again = 0, FIRST_OFFSET_NS, False
        while True:
            # With a driver in the browser a run waits for a start. A repetition with the same
            # people begins by itself.
            if not (self._control.started or again):
                self._control.paused |= self._control.starts_paused or any(
                    item.driver == COCKPIT for item in setup.humans)
            run = LiveRun(self, self._executor, self._control, setup, epoch, offset_ns,
                          self._recorded)
            simulation = run.simulation
            if self._interfaces is not None:
                self._interfaces.show(simulation)
            outcome = run.run(stop)
            now_ns = simulation.scheduler.stamp_ns(simulation.n)
            self.get_logger().info(
                f'{outcome.name.lower()} at {(now_ns - offset_ns) / NS_PER_S:.2f} s '
                f'(n = {simulation.n})')
            if outcome is not Outcome.RESET and self._control.stays and not stop.requested:
                self.get_logger().info('the page can begin another run; Ctrl-C ends everything')
                outcome = run.hold_after_end()
            run.destroy()
            if outcome is not Outcome.RESET:
                return
            before = setup
            setup, problem = self._next_setup(setup)
            self._control.end_reset(problem)
            again = simulation.n > 0 and setup.game == before.game \
                and not self._control.chosen_anew and self._all_sit(setup)
            self._control.chosen_anew = False
            epoch += 1
            self._write_game(setup.game, epoch)
            offset_ns = (now_ns // NS_PER_S + 2) * NS_PER_S

    def _all_sit(self, setup: Setup) -> bool:
        """Return whether each seat that the game leaves to people at pages is occupied."""
        tenants = self._control.seat_tenants
        return all(human.id in tenants and tenants[human.id].here
                   for human in setup.humans if human.driver == COCKPIT)

    def _next_setup(self, present: Setup) -> tuple[Setup, str | None]:
        """Load the game that the parameters name; if it is unusable, the present one and why."""
        try:
            return self._announce(build_setup(self._control.next_game(present.game))), None
        except CrgameError as error:
            self.get_logger().error(f'{error}; the present game starts again')
            return present, str(error)

    def _announce(self, setup: Setup) -> Setup:
        self._recorded = self._read_recordings(setup)
        self._write_roster(setup)
        for notice in setup.notices:
            self.get_logger().info(notice)
        unprotected = open_topics(self.get_namespace(), [item.id for item in setup.humans],
                                  [item.id for item in setup.avs])
        if unprotected:
            self.get_logger().warning(
                f'other programs can publish {unprotected[0]} and {len(unprotected) - 1} more '
                'topics of vehicles that were not in the first game: to exclude them, start the '
                'run with this game')
        self.get_logger().info(
            f'{setup.loaded.benchmark_id}: {len(setup.humans)} human(s), {len(setup.avs)} AV(s), '
            f'{len(setup.obstacles.descriptions)} objects, '
            f'{1.0 / setup.scheduler.dt_s:g} Hz, tick {setup.scheduler.time_step_s:g} s')
        return setup

    def _read_recordings(self, setup: Setup) -> 'RecordedInputs | None':
        """Read the recordings to be repeated before the run, because its loop opens no file."""
        if not any(is_replay(human.driver) for human in setup.humans):
            return None
        from crgame_ros.recording.recorded_game import recorded_inputs
        return recorded_inputs(setup)

    def _write_roster(self, setup: Setup) -> None:
        """Write the participants for the launcher: a chosen game may have other vehicles."""
        path = self._control.roster
        if path is None:
            return
        content = asdict(Participants.from_setup(setup))
        fresh = path.with_suffix('.new')
        try:
            fresh.write_text(json.dumps(content), encoding='utf-8')
            fresh.replace(path)
        except OSError as error:
            self.get_logger().error(f'{path}: cannot be written ({error.strerror})')

    def _write_game(self, game: Game, epoch: int) -> None:
        """Write the resolved game beside its recording."""
        if self._control.folder is None:
            return
        path = run_folder(self._control.folder, epoch) / GAME_FILE
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(game.dump(), encoding='utf-8')
        except OSError as error:
            self.get_logger().error(f'{path}: cannot be written ({error.strerror})')

    def _raise_priority(self) -> None:
        try:
            os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(REALTIME_PRIORITY))
        except PermissionError:
            self.get_logger().warning(
                'real-time priority refused by the system: set rtprio in '
                '/etc/security/limits.d, or run without realtime_priority')


def refuse_another(node: Node, until_s: float) -> None:
    """
    Check that no other simulation publishes here: two on the same topics would mix.

    On this machine a lock ensures that (`namespace_lock`); this check covers other machines and
    users.

    :param until_s: until when others may be discovered, on the steady clock.
    :raises InputError: if another one publishes.
    """
    endpoints = Endpoints(node)
    while time.monotonic() < until_s and not node.count_publishers('clock'):
        time.sleep(0.02)
    if not node.count_publishers('clock'):
        return
    # A process killed a moment ago is still listed; a live one publishes every second.
    heard = endpoints.polled('/diagnostics')
    until_s = time.monotonic() + ALIVE_S
    while time.monotonic() < until_s:
        message = heard.pop()
        statuses = [] if message is None else message.status
        if any(item.name == 'sim_node: run' for item in statuses):
            raise InputError(
                f'another simulation runs in namespace {node.get_namespace()} of this ROS domain',
                'sim_node', 'end it, or start this one in a namespace (--namespace, '
                '-r __ns:=/exp2) or with another ROS_DOMAIN_ID')
        if message is None:
            time.sleep(0.01)
    endpoints.release(heard)


main = partial(run_node, SimNode)

if __name__ == '__main__':
    main()
