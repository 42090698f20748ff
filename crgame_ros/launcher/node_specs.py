# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The nodes of a run, and those that a game chosen later adds."""

from collections.abc import Sequence
import json
from pathlib import Path

from crgame_ros.driver.source import COCKPIT, is_replay
from crgame_ros.launcher.arguments import cockpit_host, RunRequest
from crgame_ros.launcher.node_process import NodeSpec
from crgame_ros.launcher.run_plan import RunPlan
from crgame_ros.planner.registry import BUILT_IN, EXTERNAL
from crgame_ros.ros.run_ends import EXIT, STAY, STAY_IF_CHOSEN
from crgame_ros.simulation.roster import Participants

COMPANION_NICE = 5
# Viewers and nodes that measure beside the run have the lowest priority.
VIEWER_NICE = 10


def node_specs(plan: RunPlan) -> list[NodeSpec]:
    """Return the nodes of a run: sim_node first, which waits for its companions; viewers last."""
    setup, request = plan.setup, plan.request
    companions = [
        *participant_specs(Participants.from_setup(setup), plan.roster),
        NodeSpec('recorder_node', {'directory': plan.bag}, nice=COMPANION_NICE),
        NodeSpec('drivability_node', nice=COMPANION_NICE),
        NodeSpec('timesync_node', nice=COMPANION_NICE),
        NodeSpec('criticality_node', nice=VIEWER_NICE)]
    viewers = _viewer_specs(plan)
    # With a driver in the browser, the run begins when the seat is taken, and step 0 must reach
    # the page.
    waits = any(human.driver == COCKPIT for human in setup.humans)
    drivers = [spec for spec in viewers if waits and spec.executable == 'cockpit_node']
    # Later games may come from the page, and from the folder of the first one.
    folders = [plan.cockpit / 'games']
    if request.game is not None:
        folders.append(request.game.resolve().parent)
    simulation = NodeSpec('sim_node', {
        'at_end': at_end(request), 'countdown': float(request.countdown_s),
        'folder': plan.folder, 'game': plan.game_file,
        'real_time_factor': float(request.real_time_factor),
        'realtime_priority': request.realtime_priority, 'start_paused': request.start_paused,
        'scenario_directories': folders, 'roster': plan.roster,
        'wait_for': [spec.name for spec in (*companions, *drivers)]})
    return [simulation, *companions, *viewers]


def shared_modules(specs: Sequence[NodeSpec], plan: RunPlan) -> list[str]:
    """Return the modules that a run's nodes load: this package's own, no users' code."""
    modules = {spec.module: None for spec in specs}
    for av in plan.setup.avs:
        if av.spec.planner in BUILT_IN:
            modules[BUILT_IN[av.spec.planner].partition(':')[0]] = None
    if any(spec.executable == 'traffic_node' for spec in specs):
        modules['crgame_ros.traffic.warm_up:drive_everything'] = None
    return list(modules)


def at_end(request: RunRequest) -> str:
    """Return the action at a run's end: it stays visible if another run can be started."""
    if request.headless:
        return EXIT
    return STAY if request.duration_s is None else STAY_IF_CHOSEN


def participant_specs(participants: Participants, roster: Path) -> list[NodeSpec]:
    """
    Return the nodes that the vehicles, perception, traffic, map and instruments of a game need.

    :param roster: file in which sim_node names the code that they may run.
    """
    code = {'roster': roster}
    specs = [
        *(NodeSpec('planner_node', code, COMPANION_NICE, av)
          for av, planner in participants.avs.items() if planner != EXTERNAL),
        *(NodeSpec('driver_node', code, vehicle=human)
          for human, driver in participants.humans.items()
          if driver != COCKPIT and not is_replay(driver)),
        *(NodeSpec('perception_node', code, COMPANION_NICE, av)
          for av in participants.perceiving)]
    if participants.traffic:
        specs.append(NodeSpec('traffic_node', code, nice=COMPANION_NICE))
    if participants.occupancy:
        specs.append(NodeSpec('map_node', nice=COMPANION_NICE))
    if participants.instruments:
        specs.append(NodeSpec('instruments_node'))
    return specs


def _viewer_specs(plan: RunPlan) -> list[NodeSpec]:
    """Return the nodes that may come and go during a run."""
    request = plan.request
    viewers = [NodeSpec('marker_node', nice=VIEWER_NICE)]
    if not request.headless:
        viewers.append(NodeSpec('cockpit_node', {
            'port': request.port, 'listen': cockpit_host(request), 'token': request.token,
            'open_cockpit': request.open_cockpit,
            'certificate': _path(request.certificate), 'key': _path(request.key),
            'framed_by': ' '.join(request.framed_by), 'private': plan.private,
            'seats': [human.id for human in plan.setup.humans],
            'folders': [plan.setup.game.scenario.resolve().parent],
            'directory': plan.cockpit, 'runs': plan.folder,
            # The files beside a folder that the user named are not shown.
            'archive': plan.folder.parent if request.out is None else ''},
            nice=COMPANION_NICE))
    return viewers


def _path(path: Path | None) -> str:
    return '' if path is None else str(path.resolve())


class Roster:
    """
    The vehicles of the present game, as sim_node writes them into a file.

    A game chosen in the cockpit may have other vehicles than the first one.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._seen: tuple[int, int] | None = None

    def changed_specs(self) -> list[NodeSpec]:
        """Return the nodes that the vehicles of another game need; none if it is the same."""
        try:
            stat = self._path.stat()
        except OSError:
            return []
        if (stat.st_mtime_ns, stat.st_ino) == self._seen:
            return []
        first, self._seen = self._seen is None, (stat.st_mtime_ns, stat.st_ino)
        if first:
            # The graph begins with its nodes.
            return []
        content = json.loads(self._path.read_text(encoding='utf-8'))
        return participant_specs(Participants.read(content), self._path)
