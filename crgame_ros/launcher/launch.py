# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A live run from the command line: check it, run it, and convert the recording to a scenario."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, ExitStack
import os
import selectors
import shlex
import shutil
import signal
import sys
import time
from types import FrameType

from crgame_ros.errors import CrgameError
from crgame_ros.launcher.arguments import parse_arguments
from crgame_ros.launcher.finisher import Finisher
from crgame_ros.launcher.interruption import ENDING, print_now, writing
from crgame_ros.launcher.node_process import load, NodeProcess, NodeSpec
from crgame_ros.launcher.node_specs import node_specs, Roster, shared_modules
from crgame_ros.launcher.run_plan import plan_run, RunPlan
from crgame_ros.ros.environment import (
    free_domain_id,
    network_is_open,
    prepare_environment,
    PROFILE_VARIABLES,
    require_ros,
)
from crgame_ros.ros.namespace_lock import hold_namespace
from crgame_ros.ros.run_profile import (
    can_believe,
    check_believing,
    write_run_profile,
)
from crgame_ros.ros.shared_memory import remove_stale
from crgame_ros.traffic.compiling.kernel_cache import compile_now, compiling_when_idle

# Time for a node to end in good order, even on a busy machine [s].
GRACE_S = 10.0
# Time that it then gets to print its stacks [s].
WORD_S = 0.3
# Time for the recorder to record the last messages of the others [s].
DRAIN_S = 0.3
MAX_RESTARTS = 5
# Period in which restarts are counted [s].
RESTARTS_S = 60.0


class Graph:
    """
    The nodes of a graph, which run until the simulation ends or a signal comes.

    :param specs: the nodes; the end of the first one ends the run.
    :param roster: lists further vehicles, which get their nodes.
    :param finisher: finishes the recordings of runs that are over.
    """

    def __init__(self, specs: Sequence[NodeSpec], say: Callable[[str], None],
                 roster: Roster | None = None, finisher: Finisher | None = None,
                 namespace: str = '/') -> None:
        self._say = say
        self._roster = roster
        self._finisher = finisher
        self._namespace = namespace
        self._selector = selectors.DefaultSelector()
        self._signal: int | None = None
        self._given_up: set[str] = set()
        self._died_s: dict[str, list[float]] = {}
        self._specs = list(specs)
        self._nodes: dict[str, NodeProcess] = {}
        self._width = max(len(spec.name) for spec in specs)

    def run(self) -> int:
        """
        Run to the end.

        :return: the simulation's exit code; 0 after Ctrl-C in good order.
        """
        before = {number: signal.signal(number, self._on_signal)
                  for number in ENDING}
        first = self._specs[0].name
        try:
            for spec in self._specs:
                self._start(spec)
            while self._signal is None and self._nodes[first].exit_code() is None:
                self._relay(0.1)
                self._restart_dead(first)
                self._welcome()
                if self._finisher is not None:
                    self._finisher.poll()
            return self._end(first)
        finally:
            for node in self._nodes.values():
                node.kill()
                node.close()
            for number, handler in before.items():
                signal.signal(number, handler)

    @property
    def was_asked_to_end(self) -> bool:
        """Return whether a signal, such as that of Ctrl-C, ended the graph."""
        return self._signal is not None

    def _on_signal(self, number: int, _frame: FrameType | None) -> None:
        self._signal = number

    def _start(self, spec: NodeSpec) -> None:
        node = NodeProcess(spec, self._namespace)
        self._nodes[spec.name] = node
        self._say(f'{spec.name}: process {node.pid}')
        self._selector.register(node.output, selectors.EVENT_READ, node)

    def _relay(self, timeout_s: float) -> None:
        """Pass the nodes' output on, each line with the node's name."""
        for key, _ in self._selector.select(timeout_s):
            node: NodeProcess = key.data
            # Checked first, so that a node's last output is read before its pipe is closed.
            ended = node.exit_code() is not None
            self._pass_on(node)
            if ended:
                self._selector.unregister(node.output)

    def _pass_on(self, node: NodeProcess) -> None:
        for line in node.read_lines():
            self._say(f'[{node.spec.name:{self._width}}] {line}')

    def _restart_dead(self, first: str) -> None:
        """Report a node that died, and start it again, except for the first one."""
        for name, node in list(self._nodes.items()):
            code = node.exit_code()
            if name == first or code is None or name in self._given_up:
                continue
            cause = cause_of_death(code)
            # Bad input stays bad, so a node that exits with code 2 is not started again.
            now_s = time.monotonic()
            died_s = [at for at in self._died_s.get(name, []) if now_s - at < RESTARTS_S] + [now_s]
            self._died_s[name] = died_s
            if code == 2 or len(died_s) > MAX_RESTARTS:
                self._say(f'{name} died ({cause}); the others go on')
                self._given_up.add(name)
                continue
            self._say(f'{name} died ({cause}); starting it again')
            self._forget(node)
            self._start(node.spec)

    def _welcome(self) -> None:
        """Start the nodes that another game needs: new ones, and those that were given up."""
        for spec in self._roster.changed_specs() if self._roster is not None else ():
            if spec.name in self._given_up:
                self._given_up.discard(spec.name)
                self._died_s.pop(spec.name, None)
                self._forget(self._nodes.pop(spec.name))
            if spec.name not in self._nodes:
                self._start(spec)

    def _forget(self, node: NodeProcess) -> None:
        if node.output in {key.fileobj for key in self._selector.get_map().values()}:
            self._selector.unregister(node.output)
        self._pass_on(node)
        node.close()

    def _end(self, first: str) -> int:
        """End the simulation, wait for the recorder to write the last messages, end the others."""
        simulation = self._nodes[first]
        died = simulation.exit_code()
        if died:
            self._say(f'{first} died ({cause_of_death(died)}); ending the others')
        simulation.interrupt()
        self._wait_for([simulation])
        until_s = time.monotonic() + DRAIN_S
        while time.monotonic() < until_s:
            self._relay(0.05)
        recorders = [node for node in self._nodes.values()
                     if node.spec.executable == 'recorder_node']
        others = [node for node in self._nodes.values()
                  if node is not simulation and node not in recorders]
        for group in (others, recorders):
            for node in group:
                node.interrupt()
            self._wait_for(group)
        code = simulation.exit_code()
        # A node that was still loading has no handler yet.
        if self._signal is not None and died is None and code == -signal.SIGTERM:
            return 0
        return 0 if code == 0 else (code if code is not None and code > 0 else 1)

    def _wait_for(self, nodes: Sequence[NodeProcess]) -> None:
        until_s = time.monotonic() + GRACE_S
        while any(node.exit_code() is None for node in nodes) and time.monotonic() < until_s:
            self._relay(0.02)
        for node in nodes:
            if node.exit_code() is None:
                node.print_stacks()
                self._relay(WORD_S)
                self._say(f'{node.spec.name} does not end: killed')
                node.kill()
        self._relay(0.0)


def cause_of_death(code: int) -> str:
    """Return a description of a process's end from its exit code."""
    return f'signal {signal.Signals(-code).name}' if code < 0 else f'exit code {code}'


def launch(arguments: Sequence[str] | None = None) -> int:
    """
    Run a game from the command line.

    :return: exit code, as of `main`.
    :raises KeyboardInterrupt: before the run began.
    """
    began = False
    try:
        request = parse_arguments(sys.argv[1:] if arguments is None else arguments)
        if request.replay is not None:
            from crgame_ros.cockpit.replay_server import serve_replay
            from crgame_ros.cockpit.rights import new_token
            return serve_replay(request.replay, request.listen or '127.0.0.1', request.port,
                                new_token() if request.token else None, say=print_now)
        require_ros()
        prepare_environment()
        domain = os.environ.get('ROS_DOMAIN_ID') or str(free_domain_id())
        os.environ['ROS_DOMAIN_ID'] = domain
        with ExitStack() as holding:
            # Held before anything is written: a second simulation leaves no folder.
            holding.enter_context(hold_namespace(domain, request.namespace))
            plan = plan_run(request)
            holding.callback(clear, plan)
            if plan.setup.game.traffic is not None:
                compile_now()
            announce(plan)
            # Killed processes leave 4 MB each.
            remove_stale()
            finisher = Finisher(plan.folder, print_now, not request.no_report)
            with compiling_when_idle(), believing_own_nodes(plan):
                specs = node_specs(plan)
                load(shared_modules(specs, plan))
                graph = Graph(specs, print_now, Roster(plan.roster), finisher, request.namespace)
                began = True
                code = graph.run()
        with writing(print_now):
            code = max(code, finisher.finish_all(graph.was_asked_to_end))
        finisher.write_reports()
        if plan.game_file.is_file():
            print_now(f'again: ./run.sh {shlex.quote(str(plan.game_file))}; '
                      'tools: ./crgame --help')
        failed = finisher.tell_outcomes()
        return code or failed
    except CrgameError as error:
        print(f'error: {error}', file=sys.stderr, flush=True)
        return error.exit_code
    except KeyboardInterrupt:
        if not began:
            raise
        return 130


def clear(plan: RunPlan) -> None:
    """Remove what only a run that goes on has in its folder."""
    shutil.rmtree(plan.private, ignore_errors=True)
    plan.roster.unlink(missing_ok=True)
    plan.claim.unlink(missing_ok=True)


@contextmanager
def believing_own_nodes(plan: RunPlan) -> Iterator[None]:
    """
    Give the nodes that start meanwhile a profile that keeps the run's topics to themselves.

    :raises InputError: if the request depends on it and there can be none.
    """
    request = plan.request
    believes = can_believe()
    if request.own_orders:
        check_believing('--own-orders')
    if request.open_topics or not believes:
        if not request.open_topics:
            print_now('note: with another middleware, or a Fast DDS profile of your own, messages '
                      'of other programs count on every topic')
        yield
        return
    setup = plan.setup
    write_run_profile(
        plan.dds_profile, request.namespace, [item.id for item in setup.humans],
        [item.id for item in setup.avs], request.own_orders)
    before = {name: os.environ.get(name) for name in PROFILE_VARIABLES}
    os.environ |= dict.fromkeys(PROFILE_VARIABLES, str(plan.dds_profile))
    try:
        yield
    finally:
        for name, value in before.items():
            os.environ.pop(name)
            if value is not None:
                os.environ[name] = value


def announce(plan: RunPlan) -> None:
    """Print the plan of the run."""
    setup = plan.setup
    drivers = ', '.join(f'{human.id} driven by {setup.game.humans[index].driver}'
                        for index, human in enumerate(setup.humans))
    planners = ', '.join(f'{av.id} planned by {av.spec.planner}' for av in setup.avs)
    print_now(f'{setup.game.title or setup.loaded.benchmark_id}: '
              + ('; '.join(text for text in (drivers, planners) if text)
                 or 'no driven vehicle, only traffic'))
    for notice in setup.notices:
        print_now(f'note: {notice}')
    reach = 'open network' if network_is_open() else 'this machine only'
    print_now(f'ROS_DOMAIN_ID={os.environ["ROS_DOMAIN_ID"]} ({reach}); files go to {plan.folder}')
