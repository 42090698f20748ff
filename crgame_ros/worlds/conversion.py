# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Converts maps of other formats to CommonRoad scenarios that can be driven and exported."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
import re
import tempfile

from crgame_ros.errors import InputError, one_line
from crgame_ros.geometry.angles import wrap_pi
from crgame_ros.roads.network import RoadNetwork
from crgame_ros.scenario import guard
from crgame_ros.scenario.export_document import (
    goal_state,
    lanelet_references,
    planning_problem,
    scenario_document,
    scenario_header,
)
from crgame_ros.scenario.export_ids import IdPool
from crgame_ros.scenario.export_network import used_ids, write_roads
from crgame_ros.scenario.loading import parse_scenario
from crgame_ros.worlds.environments import DESIGNER, run_converter
from crgame_ros.worlds.kinds import LANELET2, OPENDRIVE, OSM, WorldKind
from crgame_ros.worlds.lanelet2 import prepare_lanelet2
from crgame_ros.worlds.mending import mend_map
from crgame_ros.worlds.opendrive import (
    light_cycles,
    LightCycle,
    prepare_opendrive,
    to_opendrive,
    without_turns,
)
from lxml import etree
import numpy as np

TIME_STEP_S = 0.1
# Of the AV that an imported map gets: length of its way [m], its speed at the start [m/s], and the
# time that it has [steps].
_WAY, _SPEED, _GOAL_STEPS = 400.0, 8.0, 1200
# Its centre is so far from the beginning of its lane, if the lane is long enough [m].
_FROM_START = 10.0
_DECLARATION = re.compile(r'<\?xml[^>]*\?>')
_NAMESPACE = re.compile(r'\sxmlns=("[^"]*"|\'[^\']*\')')
_NO_WORD = re.compile('[^A-Za-z0-9]')
# Between the end of a lane and the start of the next one: a corner [rad] and a gap [m] that a
# driver feels.
_KINK, _GAP = 0.35, 0.5
# Lanes that end within the map, not at its edge: so far from the edge [m].
_INSIDE = 20.0
_TOLD = 3


@dataclass(frozen=True)
class ImportedMap:
    """
    A map as a scenario.

    :param xml_text: the content of the file, valid by CommonRoad's schema.
    :param lanelets: number of its lanelets.
    :param length: of all lanes that cars drive on [m]
    :param remarks: on what was lost, mended or doubtful, one line each.
    """

    xml_text: str
    lanelets: int
    length: float
    remarks: tuple[str, ...]


def convert_map(source: Path, kind: WorldKind, timeout_s: float,
                say: Callable[[str], object]) -> ImportedMap:
    """
    Convert a map.

    :param timeout_s: that a converter may take [s]
    :param say: called with each line of progress.
    :raises InputError: if the map or its converter fails, or it has no lane.
    :raises CrgameError: if a converter cannot be installed.
    """
    with tempfile.TemporaryDirectory(prefix='crgame-import-') as name:
        folder = Path(name)
        try:
            root, cycles, remarks = _prepared(source, kind, folder, timeout_s, say)
        except ValueError as error:
            raise InputError(f'has a value that is no number ({error})', str(source),
                             'look at the map in an editor of its format') from error
        given, made = folder / 'given.xml', folder / 'made.xml'
        given.write_bytes(etree.tostring(root, xml_declaration=True, encoding='UTF-8'))
        program = DESIGNER.program('crdesigner', say)
        command = 'lanelet2cr' if kind is LANELET2 else 'odrcr'
        say(f'converting {source.name}, {kind.label}')
        run_converter([str(program), '--input-file', str(given), '--output-file', str(made),
                       command], folder, f'{source}: {DESIGNER.title}', timeout_s)
        if not made.is_file():
            raise InputError(f'{DESIGNER.title} wrote nothing', str(source),
                             'look at the map in an editor of its format')
        text = made.read_text(encoding='utf-8')
    return _finished(text, source, kind, cycles, remarks)


def _prepared(source: Path, kind: WorldKind, folder: Path, timeout_s: float,
              say: Callable[[str], object],
              ) -> tuple[etree._Element, list[LightCycle | None] | None, list[str]]:
    """
    Return the map as the converter reads it, the cycles of its lights, and remarks.

    :raises ValueError: if a value of the map is no number.
    """
    if kind is LANELET2:
        root = _parsed(source, 'osm')
        return root, None, prepare_lanelet2(root, str(source))
    cycles = None
    if kind is OPENDRIVE:
        root = _parsed(source, 'OpenDRIVE')
    else:
        given, network = folder / 'source.xml', _parsed(source, kind.root)
        given.write_bytes(etree.tostring(network if kind is OSM else without_turns(network)))
        root = _parsed(to_opendrive(given, kind is OSM, folder, timeout_s, say), 'OpenDRIVE')
        cycles = light_cycles(root, _parsed(folder / 'map.net.xml', 'net'))
    return root, cycles, prepare_opendrive(root)


def _parsed(path: Path, root_tag: str) -> etree._Element:
    """Read XML as scenarios are read: without entities and document types."""
    text = guard.read_text(path)
    declared = _DECLARATION.search(text)
    # A comment before the declaration is common, and no XML.
    if declared is not None:
        text = text[declared.end():]
    # Converters do not expect the namespace that some files of OpenDRIVE declare.
    return guard.parse_hardened(_NAMESPACE.sub('', text, 1), str(path), root_tag)


def _finished(text: str, source: Path, kind: WorldKind, cycles: list[LightCycle | None] | None,
              remarks: list[str]) -> ImportedMap:
    """Mend, check and complete what the converter has written."""
    made = f'{source}, converted'
    root = guard.parse_hardened(text, made)
    if root.find('lanelet') is None:
        raise InputError('no lane was found in it', str(source),
                         'look at the map in an editor of its format')
    remarks = remarks + mend_map(root, cycles, TIME_STEP_S)
    for location in root.findall('location'):
        # Those of a projection that was not used.
        root.remove(location)
    root.set('benchmarkID', _benchmark_id(root.get('benchmarkID', ''), source))
    loaded = parse_scenario(etree.tostring(root, encoding='unicode'), made)
    network = RoadNetwork(loaded.scenario.lanelet_network)
    notes: list[str] = []
    roads = write_roads(loaded, 0, notes)
    ids = IdPool(used_ids(roads.elements), notes)
    problem = _problem(network, ids.fresh(), roads.lanelets)
    header = scenario_header(f'{loaded.benchmark_id}_1_T-1', TIME_STEP_S, one_line(
        f'{source.name}, {kind.label}, by {DESIGNER.title} and crgame import'))
    remarks += [notice.removeprefix(f'{made}: ') for notice in loaded.notices
                if 'no planning problem' not in notice]
    remarks += _road_remarks(network)
    drivable = [lanelet for lanelet in network.lanelet_ids if network.is_drivable(lanelet)]
    return ImportedMap(scenario_document(header, roads.elements, problem),
                       len(network.lanelet_ids),
                       sum(network.line(lanelet).length for lanelet in drivable),
                       tuple(map(one_line, remarks)))


def _benchmark_id(given: str, source: Path) -> str:
    """Return an id with the country that the converter found, and the name of the file."""
    country = re.match('[A-Z]{3}', given)
    name = _NO_WORD.sub('', source.name.split('.')[0])[:40] or 'Map'
    # The country decides what signs mean; Germany's have the numbers that the converter writes.
    return f'{country[0] if country else "ZAM"}_{name}-1'


def _problem(network: RoadNetwork, number: int, written: dict[int, int]) -> str:
    """Return a planning problem: along the straightest way of up to 400 m, where it is longest."""
    ways: list[tuple[float, bool, int, list[int]]] = []
    for lanelet in network.lanelet_ids:
        if network.is_drivable(lanelet):
            chain = [lanelet]
            length = network.line(lanelet).length
            while length < _WAY:
                after = network.straightest_successor(chain[-1])
                if after is None or after in chain or not network.is_drivable(after):
                    break
                chain.append(after)
                length += network.line(after).length
            # Of equal ones that which begins at the edge of the map, then the first of the file.
            ways.append((-min(length, _WAY), bool(network.predecessors(lanelet)), len(ways),
                         chain))
    if not ways:
        raise InputError('it has no lane for cars', 'the map', 'look at it in an editor')
    chain = min(ways)[-1]
    first = network.line(chain[0])
    x, y, yaw = network.pose_on(chain[0], min(_FROM_START, 0.5 * first.length))
    limit = network.speed_limit(chain[0]) or _SPEED
    goal = lanelet_references([written.get(chain[-1], chain[-1])])
    return planning_problem(number, (x, y, yaw, min(limit, _SPEED), 0.0, 0.0),
                            [goal_state((0, _GOAL_STEPS), goal)])


def _road_remarks(network: RoadNetwork) -> list[str]:
    """
    Return remarks on the lanes for cars, one line each.

    They are on lanes that end within the map, kinks and gaps between lanes, and missing limits.
    """
    lanes = [lanelet for lanelet in network.lanelet_ids if network.is_drivable(lanelet)]
    if not lanes:
        return []
    points = np.concatenate([network.line(lanelet).points for lanelet in lanes])
    low, high = points.min(axis=0) + _INSIDE, points.max(axis=0) - _INSIDE
    ends, kinks, gaps, unlimited = [], [], [], []
    for lanelet in lanes:
        line = network.line(lanelet)
        after = [other for other in network.successors(lanelet) if other != lanelet]
        if not after and ((line.points[-1] > low) & (line.points[-1] < high)).all():
            ends.append(lanelet)
        for other in after:
            next_line = network.line(other)
            if abs(wrap_pi(float(next_line.heading[0] - line.heading[-1]))) > _KINK:
                kinks.append(lanelet)
            if np.hypot(*(next_line.points[0] - line.points[-1])) > _GAP:
                gaps.append(lanelet)
        if network.speed_limit(lanelet) is None:
            unlimited.append(lanelet)
    return [f'{len(found)} of {len(lanes)} lanes {what}: lanelet '
            + ', '.join(map(str, found[:_TOLD])) + (' …' if len(found) > _TOLD else '')
            for found, what in (
                (ends, 'end within the map'),
                (kinks, f'turn by more than {np.degrees(_KINK):.0f} degrees at their end'),
                (gaps, f'end more than {_GAP:g} m from the start of the next one'),
                (unlimited, "have no speed limit: agents take their road type's")) if found]
