# Copyright 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The command behind `run.sh`: check, run, and turn the recording into a scenario."""

from collections.abc import Callable, Sequence
from functools import partial
import os
import sys

from crgame_ros.errors import CrgameError
from crgame_ros.launcher.arguments import parse_arguments
from crgame_ros.launcher.graph import Graph
from crgame_ros.launcher.node_specs import node_specs, Roster
from crgame_ros.launcher.run_plan import plan_run, RunPlan
from crgame_ros.ros.environment import free_domain_id, network_is_open, prepare_environment


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
        announce(plan)
        code = Graph(node_specs(plan), say, Roster(plan.roster)).run()
        return max(code, finish(plan))
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


def finish(plan: RunPlan) -> int:
    """
    Complete the recording and derive the scenario and the timing report from it.

    :return: 0, or 1 if something could not be written.
    """
    from crgame_ros.recording.conversion import convert
    from crgame_ros.recording.recover import recover
    from crgame_ros.recording.timing_report import write_timing_report
    if not plan.bag.is_dir():
        say('nothing was recorded: the run ended before its first step')
        return 1
    plan.roster.unlink(missing_ok=True)
    code = 0
    # A reset begins another bag, a recorder that was started again too.
    bags = sorted(path for path in plan.folder.glob(f'{plan.bag.name}*') if path.is_dir())
    steps: list[Callable[[], object]] = [partial(recover, bag) for bag in bags]
    for bag in bags:
        # The first bag gives the run's files their names, later ones their own.
        suffix = bag.name.removeprefix(plan.bag.name)
        timing = plan.folder / f'timing{suffix}.json'
        scenario = plan.folder / f'{bag.name}.xml' if suffix else plan.folder
        steps += [partial(write_timing_report, bag, timing), partial(convert, bag, scenario)]
    for step in steps:
        try:
            step()
        except (CrgameError, OSError) as error:
            say(f'error: {error}')
            code = 1
    for path in sorted(plan.folder.iterdir()):
        say(f'  {path}')
    return code


if __name__ == '__main__':
    sys.exit(main())
