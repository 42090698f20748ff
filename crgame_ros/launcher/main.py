# Copyright 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The command behind `run.sh`: check, run, and turn the recording into a scenario."""

from collections.abc import Sequence
import os
import sys

from crgame_ros.errors import CrgameError
from crgame_ros.launcher.arguments import parse_arguments
from crgame_ros.launcher.finisher import Finisher
from crgame_ros.launcher.graph import Graph
from crgame_ros.launcher.node_specs import node_specs, Roster
from crgame_ros.launcher.run_plan import plan_run, RunPlan
from crgame_ros.ros.environment import free_domain_id, network_is_open, prepare_environment
from crgame_ros.traffic.cache import compile_now


def say(text: str) -> None:
    """Print one line at once."""
    print(text, flush=True)


def main(arguments: Sequence[str] | None = None) -> int:
    """
    Run a game from the command line.

    :return: exit code: 0 at a good end, 2 for bad input, 1 for other failures.
    """
    try:
        request = parse_arguments(sys.argv[1:] if arguments is None else arguments)
        if request.replay is not None:
            from crgame_ros.cockpit.replay_server import serve_replay
            return serve_replay(request.replay, request.listen or '127.0.0.1', request.port,
                                say=say)
        plan = plan_run(request)
        compile_now()
        announce(plan)
        finisher = Finisher(plan.folder, say)
        code = Graph(node_specs(plan), say, Roster(plan.roster), finisher).run()
        plan.roster.unlink(missing_ok=True)
        return max(code, finisher.finish_all())
    except CrgameError as error:
        print(f'error: {error}', file=sys.stderr, flush=True)
        return error.exit_code
    except KeyboardInterrupt:
        return 130


def announce(plan: RunPlan) -> None:
    """Say what is going to happen, and settle the DDS domain."""
    prepare_environment()
    os.environ.setdefault('ROS_DOMAIN_ID', str(free_domain_id()))
    setup = plan.setup
    drivers = ', '.join(f'{human.id} driven by {setup.game.humans[index].driver}'
                        for index, human in enumerate(setup.humans))
    planners = ', '.join(f'{av.id} planned by {av.spec.planner}' for av in setup.avs)
    say(f'{setup.game.title or setup.loaded.benchmark_id}: '
        + ('; '.join(text for text in (drivers, planners) if text)
           or 'nobody drives, traffic is alone'))
    for notice in setup.notices:
        say(f'note: {notice}')
    reach = 'open network' if network_is_open() else 'this machine only'
    say(f'ROS_DOMAIN_ID={os.environ["ROS_DOMAIN_ID"]} ({reach}); files go to {plan.folder}')


if __name__ == '__main__':
    sys.exit(main())
