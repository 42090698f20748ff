# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A live run from the command line: check it, run it, and convert the recording to a scenario."""

from collections.abc import Sequence
import os
import shutil
import sys

from crgame_ros.errors import CrgameError
from crgame_ros.launcher.arguments import parse_arguments
from crgame_ros.launcher.finisher import Finisher
from crgame_ros.launcher.forked_node import load
from crgame_ros.launcher.graph import Graph
from crgame_ros.launcher.interruption import print_now, writing
from crgame_ros.launcher.main import ENDED_EARLY
from crgame_ros.launcher.node_specs import node_specs, Roster, shared_modules
from crgame_ros.launcher.run_plan import plan_run, RunPlan
from crgame_ros.ros.environment import (
    free_domain_id,
    network_is_open,
    prepare_environment,
    require_ros,
)
from crgame_ros.ros.namespace_lock import hold_namespace
from crgame_ros.ros.shared_memory import remove_stale
from crgame_ros.traffic.kernel_cache import compile_now, compiling_when_idle


def launch(arguments: Sequence[str] | None = None) -> int:
    """
    Run a game from the command line.

    :return: exit code, as of `main`.
    """
    began = False
    try:
        request = parse_arguments(sys.argv[1:] if arguments is None else arguments)
        if request.replay is not None:
            from crgame_ros.cockpit.access import new_token
            from crgame_ros.cockpit.replay_server import serve_replay
            return serve_replay(request.replay, request.listen or '127.0.0.1', request.port,
                                new_token() if request.token else None, say=print_now)
        require_ros()
        plan = plan_run(request)
        if plan.setup.game.traffic is not None:
            compile_now()
        announce(plan)
        # Killed processes leave 4 MB each.
        remove_stale()
        finisher = Finisher(plan.folder, print_now, not request.no_report)
        try:
            domain = os.environ['ROS_DOMAIN_ID']
            with compiling_when_idle(), hold_namespace(domain, request.namespace):
                specs = node_specs(plan)
                load(shared_modules(specs, plan))
                graph = Graph(specs, print_now, Roster(plan.roster), finisher, request.namespace)
                began = True
                code = graph.run()
        finally:
            shutil.rmtree(plan.private, ignore_errors=True)
            plan.roster.unlink(missing_ok=True)
            plan.claim.unlink(missing_ok=True)
        with writing(print_now):
            code = max(code, finisher.finish_all(graph.was_asked_to_end))
        finisher.write_reports()
        print_now(f'again: ./run.sh {plan.game_file}; tools: ./crgame --help')
        return code
    except CrgameError as error:
        print(f'error: {error}', file=sys.stderr, flush=True)
        return error.exit_code
    except KeyboardInterrupt:
        if began:
            return 130
        print_now(ENDED_EARLY)
        return 0


def announce(plan: RunPlan) -> None:
    """Print the plan of the run, and set the DDS domain."""
    prepare_environment()
    os.environ.setdefault('ROS_DOMAIN_ID', str(free_domain_id()))
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
