# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
How many vehicles roads and junctions carry, beside the Highway Capacity Manual and SUMO.

Drives cars (4.5 m, no trucks) on roads made here, at a demand that they cannot meet: one lane, a
motorway, a traffic light, a minor road at a T junction and the entry of a roundabout against a
stream with random arrivals. Critical gaps are Raff's: as many smaller gaps were accepted as larger
ones were rejected. SUMO drives the same roads with the same arrivals and its own
defaults, where it is installed (Debian: apt-get install sumo).

The manual (HCM 6): 1,900 to 2,400 cars/h on a lane (chapter 12), 1,900 at a light, about 2 s lost
at its start (chapter 19); at a T junction potential capacity v e^(-v tc) / (1 - e^(-v tf)) with
critical gaps tc of 6.2 s (right) and 7.1 s (left) and follow-up times tf of 3.3 and 3.5 s
(chapter 20); at the entry of a roundabout of one lane 1,380 e^(-0.00102 v) (chapter 22).
"""

import argparse
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
import itertools
import math
import multiprocessing
from pathlib import Path
import shutil
import subprocess
import tempfile
from typing import NamedTuple
import xml.etree.ElementTree as ET

from commonroad.scenario.lanelet import Lanelet, LineMarking, StopLine
from commonroad.scenario.scenario import Scenario
from commonroad.scenario.traffic_light import (
    TrafficLight,
    TrafficLightCycle,
    TrafficLightCycleElement,
    TrafficLightState,
)
from commonroad.scenario.traffic_sign import (
    TrafficSign,
    TrafficSignElement,
    TrafficSignIDZamunda,
)
from crgame_ros.game.objects import ObjectDescription, Role
from crgame_ros.game.traffic_spec import TrafficSpec
from crgame_ros.roads.network import RoadNetwork
from crgame_ros.roads.signs import TrafficLights
from crgame_ros.traffic.fleet.adoption import Adopted
from crgame_ros.traffic.fleet.world_view import WorldView
from crgame_ros.traffic.spawning import CAR
from crgame_ros.traffic.traffic import Traffic
import matplotlib as mpl
from matplotlib import pyplot as plt
import numpy as np
from numpy.typing import NDArray

mpl.use('agg')
FloatArray = NDArray[np.float64]

STEP_S, SUBSTEPS = 0.1, 10
TOWN, MOTORWAY = 50.0 / 3.6, 120.0 / 3.6
HALF_LANE = 1.75
# Roads that begin with a lanelet of this length get no arrivals of `flow` [m].
NO_ENTRANCE = 9.0
GREEN, YELLOW, RED = 40.0, 3.0, 37.0
# Vehicles of a queue that start up; those after them leave at the saturation flow (HCM 6).
STARTING = 4
# Fewer accepted or rejected gaps tell no critical one.
LEAST_GAPS = 10
RADIUS = 18.0
NOBODY = np.zeros((0, 3))


class Result(NamedTuple):
    """
    What passed a place.

    :param flow: [veh/h]
    :param lost_s: of a light: time lost by the first vehicles of a queue.
    :param first_s: of a light: from the start of green to the first front on the line.
    :param critical_s: critical gap in the stream with the right of way.
    :param follow_up_s: mean time between two vehicles that use the same gap.
    """

    flow: float
    lost_s: float = math.nan
    first_s: float = math.nan
    critical_s: float = math.nan
    follow_up_s: float = math.nan

    def text(self) -> str:
        """Return the values for a table."""
        pair = (self.lost_s, self.first_s) if math.isfinite(self.lost_s) \
            else (self.critical_s, self.follow_up_s)
        return f'{self.flow:.0f}' + (
            f' ({pair[0]:.1f}, {pair[1]:.1f} s)' if all(map(math.isfinite, pair)) else '')


class Gate(NamedTuple):
    """A line across a lane: its middle (x, y) [m], and the lane's direction there [rad]."""

    x: float
    y: float
    heading: float


class Passes(NamedTuple):
    """
    Times at which fronts pass gates, ascending [s].

    :param measured: the gate at which vehicles are counted.
    :param stream: those of the stream at the gates of the conflict; `entering` the others there.
    """

    measured: list[float]
    stream: list[float]
    entering: list[float]


@dataclass(frozen=True)
class Site:
    """
    A place whose capacity is measured.

    :param name: for people.
    :param scenario: its roads; the ones with more than 10 m at the start are saturated.
    :param measured: lanelet whose start counts.
    :param manual: the manual's value.
    :param limit: [m/s]
    :param sumo: nodes, edges, connections, lights and routes of SUMO's plain formats.
    :param flow: of the stream that has the right of way [veh/h]
    :param stream: its way.
    :param gates: where its vehicles and those that enter it pass, once each.
    """

    name: str
    scenario: Scenario
    measured: int
    manual: float
    limit: float
    sumo: 'Sumo'
    flow: float = 0.0
    stream: FloatArray | None = None
    gates: tuple[Gate, ...] = ()
    is_light: bool = False


@dataclass(frozen=True)
class Sumo:
    """
    The same place for SUMO.

    :param saturated: edges of a route on which there is always another vehicle.
    :param streams: edges of the routes with the right of way, which share its flow.
    :param detector: lane and position of the instant induction loop [m]
    """

    nodes: str
    edges: str
    saturated: str
    detector: tuple[str, float]
    streams: tuple[str, ...] = ()
    connections: str = ''
    lights: str = ''


def lanelet(number: int, line: FloatArray, before: Sequence[int] = (), after: Sequence[int] = (),
            **more: object) -> Lanelet:
    """Make a lanelet of 3.5 m around a line (n, 2) [m]."""
    tangent = np.gradient(line, axis=0)
    normal = np.column_stack((-tangent[:, 1], tangent[:, 0]))
    normal *= HALF_LANE / np.hypot(*tangent.T)[:, None]
    return Lanelet(line + normal, line, line - normal, number, predecessor=list(before),
                   successor=list(after), **more)


def straight(start: tuple[float, float], end: tuple[float, float]) -> FloatArray:
    """Return points at most 5 m apart (n, 2) [m]."""
    count = max(2, math.ceil(math.dist(start, end) / 5.0) + 1)
    return np.linspace(start, end, count)


def bend(start: tuple[float, float], heading: float, end: tuple[float, float],
         final: float) -> FloatArray:
    """Return a Bezier curve (n, 2) between two poses [m, rad]."""
    first, last = np.array(start), np.array(end)
    reach = 0.39 * float(np.hypot(*(last - first)))
    inner = (first + reach * np.array((math.cos(heading), math.sin(heading))),
             last - reach * np.array((math.cos(final), math.sin(final))))
    t = np.linspace(0.0, 1.0, 21)[:, None]
    return np.asarray((1 - t)**3 * first + 3 * t * (1 - t)**2 * inner[0]
                      + 3 * t**2 * (1 - t) * inner[1] + t**3 * last)


def roads(lanelets: Iterable[Lanelet], limit: float, minor: Iterable[int] = (),
          sign: TrafficSignIDZamunda = TrafficSignIDZamunda.YIELD) -> Scenario:
    """Make a scenario with one limit [m/s]; some lanelets have a sign at their ends."""
    scenario = Scenario(STEP_S)
    scenario.add_objects(list(lanelets))
    numbers = {item.lanelet_id for item in scenario.lanelet_network.lanelets}
    element = TrafficSignElement(TrafficSignIDZamunda.MAX_SPEED, [str(limit)])
    scenario.add_objects(TrafficSign(900, [element], numbers, np.zeros(2)), numbers)
    for number in minor:
        scenario.add_objects(TrafficSign(900 + number, [TrafficSignElement(sign)], {number},
                                         np.zeros(2)), {number})
    return scenario


def one_lane(limit: float) -> Site:
    """Make a straight lane of 1.5 km."""
    lanes = (lanelet(1, straight((0.0, 0.0), (1200.0, 0.0)), after=[2]),
             lanelet(2, straight((1200.0, 0.0), (1500.0, 0.0)), before=[1]))
    sumo = Sumo('<node id="a" x="0" y="0"/><node id="b" x="1500" y="0"/>',
                f'<edge id="e" from="a" to="b" numLanes="1" speed="{limit}"/>', 'e', ('e_0', 1200))
    # Base capacity of multilane highways, whose least free-flow speed is 45 mph, and of freeways.
    manual = 1900.0 if limit < 20.0 else 2400.0
    return Site(f'one lane, {3.6 * limit:.0f} km/h', roads(lanes, limit), 2, manual, limit, sumo)


def light() -> Site:
    """Make a lane with a light after 500 m."""
    line = StopLine(np.array([500.0, HALF_LANE]), np.array([500.0, -HALF_LANE]),
                    LineMarking.SOLID, set(), {50})
    scenario = roads((
        lanelet(1, straight((0.0, 0.0), (500.0, 0.0)), after=[2], stop_line=line),
        lanelet(2, straight((500.0, 0.0), (800.0, 0.0)), before=[1])), TOWN)
    scenario.add_objects(TrafficLight(50, np.array([500.0, 3.0]), TrafficLightCycle([
        TrafficLightCycleElement(state, round(seconds / STEP_S)) for state, seconds in (
            (TrafficLightState.GREEN, GREEN), (TrafficLightState.YELLOW, YELLOW),
            (TrafficLightState.RED, RED))])), {1})
    sumo = Sumo(
        '<node id="a" x="0" y="0"/><node id="b" x="500" y="0" type="traffic_light"/>'
        '<node id="c" x="800" y="0"/>',
        f'<edge id="e" from="a" to="b" speed="{TOWN}"/><edge id="f" from="b" to="c" '
        f'speed="{TOWN}"/>', 'e f', ('f_0', 0.1), connections='<connection from="e" to="f"/>',
        lights='<tlLogic id="b" programID="0" offset="0" type="static">'
        + ''.join(f'<phase duration="{seconds:g}" state="{state}"/>' for seconds, state in (
            (GREEN, 'G'), (YELLOW, 'y'), (RED, 'r'))) + '</tlLogic>')
    return Site('traffic light', scenario, 2, 1900.0, TOWN, sumo, is_light=True)


def t_junction(turn: str, flow: float) -> Site:
    """
    Make a minor road with a stop sign that ends at a major road of two lanes.

    :param turn: `right`, against the eastbound stream, or `left`, against both.
    :param flow: of all streams in the way together [veh/h]
    """
    y, near, far = -HALF_LANE, 8.0, 400.0
    to_east = turn == 'right'
    lanes = [lanelet(1, straight((HALF_LANE, -300.0), (HALF_LANE, -near)), after=[2])]
    lanes.append(lanelet(2, bend((HALF_LANE, -near), 0.5 * math.pi,
                                 (near, y) if to_east else (-near, -y),
                                 0.0 if to_east else math.pi), [1], [14 if to_east else 24]))
    for first, way in ((11, 1.0), (21, -1.0)):
        end = far + NO_ENTRANCE
        for n, (start, stop) in enumerate(((-end, -far), (-far, -near), (-near, near),
                                           (near, far))):
            merged = n == 3 and (way > 0.0) == to_east
            lanes.append(lanelet(
                first + n, straight((way * start, way * y), (way * stop, way * y)),
                ([first + n - 1] if n else []) + ([2] if merged else []),
                [first + n + 1] if n < 3 else []))
    critical, follow_up = (6.2, 3.3) if to_east else (7.1, 3.5)
    rate = max(flow, 1e-6) / 3600.0
    manual = 3600.0 * rate * math.exp(-rate * critical) / -math.expm1(-rate * follow_up)
    sumo = Sumo(
        f'<node id="w" x="-{far}" y="0"/><node id="x" x="0" y="0" type="priority_stop"/>'
        f'<node id="e" x="{far}" y="0"/><node id="s" x="0" y="-300"/>',
        ''.join(f'<edge id="{a}{b}" from="{a}" to="{b}" priority="{n}" speed="{TOWN}"/>'
                for a, b, n in (('w', 'x', 9), ('x', 'e', 9), ('e', 'x', 9), ('x', 'w', 9),
                                ('s', 'x', 1))),
        'sx xe' if to_east else 'sx xw', ('xe_0' if to_east else 'xw_0', 0.1),
        ('wx xe',) if to_east else ('wx xe', 'ex xw'))
    stream = np.array([[-far, y, 0.0], [far, y, 0.0]])
    gates = (Gate(near, y, 0.0),) if to_east else (Gate(0.0, y, 0.0), Gate(-near, -y, math.pi))
    return Site(f'T junction, {turn} turn', roads(
        lanes, TOWN, [1], TrafficSignIDZamunda.STOP), 2, manual, TOWN, sumo, flow,
                stream, gates)


def ring(start_deg: float, end_deg: float) -> FloatArray:
    """Return an arc of the roundabout (n, 2) [m]."""
    angle = np.radians(np.linspace(start_deg, end_deg, max(3, round(end_deg - start_deg) // 4)))
    return RADIUS * np.column_stack((np.cos(angle), np.sin(angle)))


def roundabout(flow: float) -> Site:
    """Make a roundabout of one lane with two entries and two exits."""
    joins = [math.radians(220.0 + 90.0 * n) for n in range(2)]
    at = [(RADIUS * math.cos(angle), RADIUS * math.sin(angle)) for angle in joins]
    out = [math.radians(320.0 + 90.0 * n) for n in range(2)]
    leave = [(RADIUS * math.cos(angle), RADIUS * math.sin(angle)) for angle in out]
    y, far, near = -HALF_LANE, 250.0, 50.0
    lanes = (
        lanelet(11, straight((-far - NO_ENTRANCE, y), (-far, y)), after=[12]),
        lanelet(12, straight((-far, y), (-near, y)), [11], [13]),
        lanelet(13, bend((-near, y), 0.0, at[0], joins[0] + 0.5 * math.pi), [12], [21]),
        lanelet(1, straight((-y, -far), (-y, -near)), after=[2]),
        lanelet(2, bend((-y, -near), 0.5 * math.pi, at[1], joins[1] + 0.5 * math.pi), [1], [22]),
        lanelet(21, ring(220.0, 310.0), [13, 24], [22]),
        lanelet(22, ring(310.0, 320.0), [2, 21], [23, 31]),
        lanelet(23, ring(320.0, 410.0), [22], [24, 33]),
        lanelet(24, ring(410.0, 580.0), [23], [21]),
        lanelet(31, bend(leave[0], out[0] + 0.5 * math.pi, (near, y), math.tau), [22], [32]),
        lanelet(32, straight((near, y), (far, y)), [31]),
        lanelet(33, bend(leave[1], out[1] + 0.5 * math.pi, (-y, near), 2.5 * math.pi), [23],
                [34]),
        lanelet(34, straight((-y, near), (-y, far)), [33]))
    corners = {'w': math.pi, 's': 1.5 * math.pi, 'e': 0.0, 'n': 0.5 * math.pi}
    nodes = ''.join(
        f'<node id="r{name}" x="{RADIUS * math.cos(angle)}" y="{RADIUS * math.sin(angle)}"/>'
        f'<node id="{name}" x="{far * math.cos(angle)}" y="{far * math.sin(angle)}"/>'
        for name, angle in corners.items())
    edges = ''.join(
        f'<edge id="{a}{b}" from="r{a}" to="r{b}" speed="{TOWN}" priority="9" shape="'
        + ' '.join(f'{x:.2f},{y:.2f}' for x, y in ring(
            math.degrees(corners[a]), math.degrees(corners[a]) + 90.0)) + '"/>'
        for a, b in ('ws', 'se', 'en', 'nw'))
    edges += ''.join(f'<edge id="in{name}" from="{name}" to="r{name}" speed="{TOWN}"/>'
                     for name in 'ws')
    edges += ''.join(f'<edge id="out{name}" from="r{name}" to="{name}" speed="{TOWN}"/>'
                     for name in 'en')
    sumo = Sumo(nodes, edges + '<roundabout nodes="rw rs re rn" edges="ws se en nw"/>',
                'ins se en outn', ('ins_0', 200.0), ('inw ws se oute', 'inw ws se en outn'))
    stream = np.array([[-far, y, 0.0], [far, y, 0.0]])
    return Site('roundabout', roads(lanes, TOWN, [12, 1]), 2,
                1380.0 * math.exp(-0.00102 * flow), TOWN, sumo, flow, stream,
                (Gate(*leave[0], out[0] + 0.5 * math.pi),))


def arrivals(flow: float, seconds: float, seed: int) -> list[float]:
    """Draw random times of arrival [s], at least 1 s apart with the mean of the flow."""
    if flow <= 0.0:
        return []
    random = np.random.default_rng(seed)
    gaps = 1.0 + random.exponential(3600.0 / flow - 1.0, math.ceil(2.0 * flow * seconds / 3600))
    times = np.cumsum(gaps)
    return [float(time) for time in times[times < seconds]]


def streams_of(site: Site, seconds: float, seed: int) -> list[Adopted]:
    """Return the vehicles of the streams that have the right of way, as recorded ones."""
    if site.stream is None:
        return []
    # A left turn waits for both directions: each has half of the flow.
    ways = [site.stream]
    if 'left' in site.name:
        ways.append(np.column_stack((-site.stream[:, :2], (math.pi, math.pi))))
    random = np.random.default_rng(seed)
    found = []
    for number, way in enumerate(ways):
        for time in arrivals(site.flow / len(ways), seconds, seed + number):
            speed = site.limit * float(np.clip(random.normal(1.0, 0.1), 0.8, 1.2))
            reach = float(np.hypot(*(way[1] - way[0])[:2]))
            share = np.append(np.arange(0.0, reach, speed * STEP_S), reach)[:, None] / reach
            poses = way[0] + share * (way[1] - way[0])
            velocity = speed * np.array((math.cos(way[0, 2]), math.sin(way[0, 2]), 0.0))
            found.append(Adopted(
                ObjectDescription(f'o{number}_{len(found)}', 'car', Role.RECORDED, CAR),
                round(time / STEP_S), poses, np.tile(velocity, (len(poses), 1))))
    return found


def drive(site: Site, model: str, settle_s: float, seconds: float, seed: int) -> Passes:
    """Drive agents, and return when fronts pass the start of the measured lanelet, and gates."""
    network = RoadNetwork(site.scenario.lanelet_network)
    lights = TrafficLights(site.scenario)
    spec = TrafficSpec(recorded='reactive', flow=3600.0, model=model, truck_share=0.0)
    stream = streams_of(site, settle_s + seconds, seed)
    traffic = Traffic(spec, network, site.scenario, (), stream, STEP_S, SUBSTEPS, seed, 0)
    way = site.scenario.lanelet_network.find_lanelet_by_id(site.measured).center_vertices
    gates = (Gate(*way[0], math.atan2(*(way[1] - way[0])[::-1])), *site.gates)
    middles = np.array(gates)[:, :2]
    along, across = (np.array([(math.cos(gate.heading + turn), math.sin(gate.heading + turn))
                               for gate in gates]) for turn in (0.0, 0.5 * math.pi))
    half = 0.5 * CAR.length
    before: FloatArray | None = None
    found = Passes([], [], [])
    for k in range(round((settle_s + seconds) / STEP_S)):
        poses = traffic.states.poses
        fronts = poses[:, :2] + half * np.column_stack((np.cos(poses[:, 2]), np.sin(poses[:, 2])))
        offset = fronts[:, None] - middles
        ahead = (offset * along).sum(axis=2)
        ahead[np.abs((offset * across).sum(axis=2)) > HALF_LANE] = np.nan
        if before is not None:
            passed = (before < 0.0) & (ahead >= 0.0) & (ahead - before < 10.0)
            for slot, gate in np.argwhere(passed):
                share = -before[slot, gate] / (ahead[slot, gate] - before[slot, gate])
                time = (k - 1 + float(share)) * STEP_S
                if time >= settle_s:
                    (found.measured if gate == 0 else found.stream if slot < len(stream)
                     else found.entering).append(time)
        before = ahead
        traffic.advance(WorldView(k, NOBODY, NOBODY, lights.states_at(k)))
    return Passes(*map(sorted, found))


def drive_sumo(site: Site, settle_s: float, seconds: float, seed: int) -> Passes:
    """Drive SUMO's vehicles, and return when they enter its detector."""
    sumo, end = site.sumo, settle_s + seconds
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for part, kind in ((sumo.nodes, 'nodes'), (sumo.edges, 'edges'),
                           (sumo.connections, 'connections'), (sumo.lights, 'tlLogics')):
            (folder / f'{kind}.xml').write_text(f'<{kind}>{part}</{kind}>', encoding='utf-8')
        build = ['netconvert', '-n', 'nodes.xml', '-e', 'edges.xml', '-o', 'net.xml']
        build += ['-x', 'connections.xml'] if sumo.connections else []
        build += ['-i', 'tlLogics.xml'] if sumo.lights else []
        subprocess.run(build, cwd=folder, check=True, capture_output=True)
        trips = [(time, sumo.streams[n % len(sumo.streams)]) for n, time in enumerate(
            arrivals(site.flow, end, seed))] if sumo.streams else []
        trips += [(1.2 * n, sumo.saturated) for n in range(round(end / 1.2))]
        (folder / 'routes.xml').write_text('<routes><vType id="car" length="4.5"/>' + ''.join(
            f'<vehicle id="{n}" type="car" depart="{time:.2f}" departSpeed="max" '
            f'departLane="best"><route edges="{edges}"/></vehicle>'
            for n, (time, edges) in enumerate(sorted(trips))) + '</routes>', encoding='utf-8')
        lane, position = sumo.detector
        (folder / 'loops.xml').write_text(
            f'<additional><instantInductionLoop id="d" lane="{lane}" pos="{position}" '
            'file="out.xml"/></additional>', encoding='utf-8')
        subprocess.run(['sumo', '-n', 'net.xml', '-r', 'routes.xml', '-a', 'loops.xml', '--end',
                        str(end), '--seed', str(seed), '--time-to-teleport', '-1',
                        '--no-step-log'], cwd=folder, check=True, capture_output=True)
        own = {str(n) for n, (_, edges) in enumerate(sorted(trips)) if edges == sumo.saturated}
        return Passes(sorted(
            float(entry.get('time', '')) for entry in ET.parse(folder / 'out.xml').iter(
                'instantOut') if entry.get('state') == 'enter' and entry.get('vehID') in own
            and float(entry.get('time', '')) >= settle_s), [], [])


def accepted_gaps(stream: list[float], entering: list[float]) -> tuple[float, float]:
    """
    Return the critical gap by Raff's method, and the mean follow-up time [s]; NaN if unknown.

    Vehicles that enter wait in one queue: the gaps between two of them were rejected by the later
    one.
    """
    accepted, rejected, follow_up = [], [], []
    gap_of = np.searchsorted(stream, entering)
    for n in range(1, len(entering)):
        first, last = int(gap_of[n - 1]), int(gap_of[n])
        if first == last:
            follow_up.append(entering[n] - entering[n - 1])
            continue
        rejected += np.diff(stream[first:last]).tolist()
        if last < len(stream):
            accepted.append(stream[last] - stream[last - 1])
    if len(accepted) < LEAST_GAPS or len(rejected) < LEAST_GAPS:
        return math.nan, math.nan
    candidates = np.unique(accepted + rejected)
    smaller = np.searchsorted(np.sort(accepted), candidates, 'right') / len(accepted)
    larger = 1.0 - np.searchsorted(np.sort(rejected), candidates, 'right') / len(rejected)
    critical = float(candidates[np.argmax(smaller >= larger)])
    return critical, float(np.mean(follow_up)) if follow_up else math.nan


def result(site: Site, passes: Passes, seconds: float) -> Result:
    """Return what the times of passing mean."""
    times = passes.measured
    if not site.is_light:
        critical, follow_up = accepted_gaps(passes.stream, passes.entering)
        return Result(3600.0 * len(times) / seconds, critical_s=critical, follow_up_s=follow_up)
    cycle = GREEN + YELLOW + RED
    headways, lost, first = [], [], []
    for _, group in itertools.groupby(times, lambda time: time // cycle):
        queue = np.array([time % cycle for time in group])
        queue = queue[queue < GREEN]
        if len(queue) < 2 * STARTING:
            continue
        steady = float(np.diff(queue[STARTING - 1:]).mean())
        headways.append(steady)
        first.append(float(queue[0]))
        lost.append(float(queue[STARTING - 1]) - STARTING * steady)
    return Result(3600.0 / float(np.mean(headways)), float(np.mean(lost)), float(np.mean(first)))


# Streams that have the right of way [veh/h].
FLOWS = (0.0, 300.0, 600.0, 900.0, 1200.0)
SITES: dict[str, Callable[[], list[Site]]] = {
    'lane': lambda: [one_lane(TOWN), one_lane(MOTORWAY)],
    'light': lambda: [light()],
    'right': lambda: [t_junction('right', flow) for flow in FLOWS],
    'left': lambda: [t_junction('left', flow) for flow in FLOWS],
    'roundabout': lambda: [roundabout(flow) for flow in FLOWS]}
SUMO = 'SUMO'
Task = tuple[str, int, str, float, float, int]


def measure(task: Task) -> Result:
    """Measure one site with one model."""
    kind, index, model, settle_s, seconds, seed = task
    site = SITES[kind]()[index]
    run = drive_sumo(site, settle_s, seconds, seed) if model == SUMO else drive(
        site, model, settle_s, seconds, seed)
    return result(site, run, seconds)


def draw(measured: list[tuple[Site, list[Result]]], models: list[str], path: Path) -> None:
    """Draw capacity against the stream with the right of way, or bars for sites without one."""
    names = list(dict.fromkeys(site.name for site, _ in measured if site.stream is not None))
    alone = [(site, results) for site, results in measured if site.stream is None]
    _, axes = plt.subplots(1, len(names) + bool(alone), squeeze=False, layout='constrained',
                           figsize=(4.2 * (len(names) + bool(alone)), 3.4))
    series = ('manual', *models)
    for axis, name in zip(axes[0], names, strict=False):
        rows = [(site, results) for site, results in measured if site.name == name]
        flows = [site.flow for site, _ in rows]
        axis.plot(flows, [site.manual for site, _ in rows], 'k--', label='manual')
        for number, model in enumerate(models):
            axis.plot(flows, [results[number].flow for _, results in rows], 'o-', label=model)
        axis.set(title=name, xlabel='stream with the right of way [veh/h]', ylim=(0.0, None),
                 ylabel='capacity [veh/h]')
        axis.legend()
    if alone:
        axis = axes[0][-1]
        for number, label in enumerate(series):
            heights = [site.manual if number == 0 else results[number - 1].flow
                       for site, results in alone]
            axis.bar(np.arange(len(alone)) + 0.2 * (number - 1.5), heights, 0.2, label=label,
                     color='0.7' if number == 0 else f'C{number - 1}')
        axis.set_xticks(np.arange(len(alone)), [site.name.replace(', ', ',\n')
                                                for site, _ in alone])
        axis.set(ylabel='vehicles an hour', title='one lane', ylim=(0.0, 3200.0))
        axis.legend(loc='upper center', ncols=2)
    plt.savefig(path, dpi=110)


def main() -> None:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--sites', default=','.join(SITES))
    parser.add_argument('--models', default='acc,idm')
    parser.add_argument('--minutes', type=float, default=20.0)
    parser.add_argument('--settle', type=float, default=4.0, help='minutes before them')
    parser.add_argument('--seed', type=int, default=0)
    parser.add_argument('--jobs', type=int, default=1)
    parser.add_argument('--picture', type=Path, help='draw what was measured into this file')
    values = parser.parse_args()
    models = values.models.split(',') + ([SUMO] if shutil.which('sumo') else [])
    measured: list[tuple[Site, list[Result]]] = []
    print('vehicles an hour; at a light the time lost and that of the first vehicle, else the '
          'critical gap and the follow-up time')
    print(f'{"site":28}{"against":>9}{"manual":>8}' + ''.join(f'{name:>20}' for name in models))
    tasks: list[Task] = [
        (kind, index, model, 60.0 * values.settle, 60.0 * values.minutes, values.seed)
        for kind in values.sites.split(',') for index in range(len(SITES[kind]()))
        for model in models]
    with multiprocessing.get_context('spawn').Pool(values.jobs) as pool:
        found = pool.imap(measure, tasks)
        for kind in values.sites.split(','):
            for site in SITES[kind]():
                results = [next(found) for _ in models]
                measured.append((site, results))
                print(f'{site.name:28}{site.flow:9.0f}{site.manual:8.0f}'
                      + ''.join(f'{each.text():>20}' for each in results), flush=True)
    if values.picture is not None:
        draw(measured, models, values.picture)


if __name__ == '__main__':
    main()
