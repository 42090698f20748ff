# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The roads of a scenario for export: copied from its file, or rewritten if they are invalid."""

from copy import deepcopy
from dataclasses import dataclass
import functools
from importlib import resources
import warnings

from commonroad.common.writer.file_writer_xml import (
    IntersectionXMLNode,
    LaneletXMLNode,
    LocationXMLNode,
    TrafficLightXMLNode,
    TrafficSignXMLNode,
)
from commonroad.scenario.scenario import Location
from crgame_ros.errors import InputError
from crgame_ros.scenario import guard
from crgame_ros.scenario.export_ids import ids_of, renumber, whole_number
from crgame_ros.scenario.loading import LoadedScenario
from lxml import etree

_PARTS = ('location', 'scenarioTags', 'lanelet', 'trafficSign', 'trafficLight', 'intersection')
_SIMULATED = 'simulated'
_MESSAGE_LENGTH = 200
_LOCATION = ('<location><geoNameId>-999</geoNameId><gpsLatitude>999</gpsLatitude>'
             '<gpsLongitude>999</gpsLongitude></location>')
# The other elements that the schema requires, so that roads can be checked alone.
_FRAME = ('<commonRoad commonRoadVersion="2020a" benchmarkID="ZAM_Frame-1" date="2020-01-01" '
          'author="" affiliation="" source="" timeStepSize="0.1"/>')
_PROBLEM = (
    '<planningProblem id="{}"><initialState><position><point><x>0</x><y>0</y></point></position>'
    '<velocity><exact>0</exact></velocity><orientation><exact>0</exact></orientation>'
    '<yawRate><exact>0</exact></yawRate><slipAngle><exact>0</exact></slipAngle>'
    '<time><exact>0</exact></time></initialState><goalState><time><intervalStart>0'
    '</intervalStart><intervalEnd>1</intervalEnd></time></goalState></planningProblem>')


def _definition(name: str) -> bytes:
    return resources.files('commonroad').joinpath(
        'scenario_definition', 'xml_definition_files', name).read_bytes()


@functools.cache
def _schema() -> tuple[etree.XMLSchema, frozenset[str]]:
    """Load commonroad-io's CommonRoad 2020a schema, and the signs that it contains."""
    root = etree.fromstring(_definition('XML_commonRoad_XSD.xsd'))
    signs = root.iterfind('{*}simpleType[@name="trafficSignID"]/{*}restriction/{*}enumeration')
    return etree.XMLSchema(root), frozenset(sign.get('value') for sign in signs)


def solution_schema_errors(root: etree._Element) -> list[str]:
    """Return the errors by the schema of solutions; empty for a valid solution."""
    return _errors(etree.XMLSchema(etree.fromstring(
        _definition('CommonRoadSolution_schema.xsd'))), root)


def schema_errors(root: etree._Element) -> list[str]:
    """Return the errors by the schema; empty for a valid scenario."""
    return _errors(_schema()[0], root)


def _errors(schema: etree.XMLSchema, root: etree._Element) -> list[str]:
    return [] if schema.validate(root) else [
        entry.message[:_MESSAGE_LENGTH] for entry in schema.error_log]


@dataclass(frozen=True)
class WrittenRoads:
    """
    The roads of an exported file.

    :param elements: location, tags, lanelets, traffic signs, traffic lights and intersections.
    :param lanelets: ids of the lanelets in the file, by their ids in the scenario.
    """

    elements: list[etree._Element]
    lanelets: dict[int, int]


def write_roads(loaded: LoadedScenario, shift: int, notices: list[str]) -> WrittenRoads:
    """
    Return location, tags, lanelets, traffic signs, traffic lights and intersections.

    They are copied from the file unchanged. If that violates the schema, as in a third of the
    published files, they are written from the loaded scenario, without elements that the schema
    still refuses. Elements without a positive unique id get a new one.

    :param shift: scenario step that becomes time step 0; the cycles of traffic lights are shifted
    :param notices: extended by remarks on changes of the roads
    :raises InputError: if they cannot be written so that the schema accepts them.
    """
    root = guard.parse_hardened(loaded.xml_text, loaded.source)
    taken = ids_of(root.iter('*'))
    if root.get('commonRoadVersion') == '2020a':
        copied, remarks = _completed([deepcopy(child) for tag in _PARTS
                                      for child in root.iterchildren(tag)], shift)
        lanelets = renumber(copied, taken, remarks)
        if not schema_errors(framed(copied)):
            notices += remarks
            return WrittenRoads(copied, lanelets)
    rewritten, remarks = _completed(_rewritten(loaded), shift)
    lanelets = renumber(rewritten, taken, remarks)
    kept = _without_refused(rewritten, remarks)
    if errors := schema_errors(framed(kept)):
        raise InputError(f'the roads cannot be written as a valid scenario '
                         f'({"; ".join(errors[:3])})', loaded.source, 'correct the scenario')
    notices.append('the roads of the original violate the CommonRoad 2020a schema and were '
                   'rewritten from the loaded scenario')
    notices += remarks
    return WrittenRoads(kept, lanelets)


def used_ids(elements: list[etree._Element]) -> set[int]:
    """Return all ids of the elements."""
    return ids_of(node for element in elements for node in element.iter('*'))


def framed(elements: list[etree._Element]) -> etree._Element:
    """Return a document with copies of the roads and the elements that the schema requires."""
    frame = etree.fromstring(_FRAME)
    frame.extend(deepcopy(elements))
    # The schema refuses ids that are not numbers; the problem's id must differ from references.
    numbers = [number for node in frame.iter('*') for name in ('id', 'ref')
               if (number := whole_number(node.get(name))) is not None]
    frame.append(etree.fromstring(_PROBLEM.format(max((0, *numbers)) + 1)))
    return frame


def _without_refused(elements: list[etree._Element],
                     notices: list[str]) -> list[etree._Element]:
    """
    Return the roads without elements that the schema refuses and that are not essential.

    An element that then lacks a required part is removed as well, up to a whole sign, light or
    intersection. Lanelets and their bounds are kept.
    """
    schema, _ = _schema()
    frame, gone = framed(elements), []
    while not schema.validate(frame):
        tree = frame.getroottree()
        refused = {node: entry.message for entry in schema.error_log
                   for node in tree.xpath(entry.path or 'none') if _is_dispensable(node)}
        # The schema reports broken references at the root.
        known = {node.get('id') for node in frame.iter('*')}
        refused |= {node: f'nothing has the id {node.get("ref")}'
                    for node in frame.iterfind('.//*[@ref]') if node.get('ref') not in known}
        if not refused:
            break
        for node, message in refused.items():
            gone.append(f'<{node.tag}> ({message[:_MESSAGE_LENGTH]})')
            parent = node.getparent()
            if node.tag == 'location':
                parent.replace(node, etree.fromstring(_LOCATION))
            elif parent is not None:
                parent.remove(node)
    if gone:
        notices.append(f'the schema refuses {len(gone)} elements of the roads; they are left out, '
                       f'the first: {gone[0]}')
    frame.remove(frame.find('planningProblem'))
    return list(frame)


def _is_dispensable(node: etree._Element) -> bool:
    lineage = {node.tag, *(parent.tag for parent in node.iterancestors())}
    return node.tag not in ('commonRoad', 'scenarioTags', 'lanelet') \
        and not lineage & {'leftBound', 'rightBound', 'planningProblem'} \
        or node.tag == 'lineMarking'


def _completed(elements: list[etree._Element],
               shift: int) -> tuple[list[etree._Element], list[str]]:
    """Add required elements, drop signs that the schema lacks, and shift the lights' cycles."""
    location, tags = (
        next((element for element in elements if element.tag == tag), None)
        for tag in ('location', 'scenarioTags'))
    tags = etree.Element('scenarioTags') if tags is None else tags
    if tags.find(_SIMULATED) is None:
        etree.SubElement(tags, _SIMULATED)
    elements = [etree.fromstring(_LOCATION) if location is None else location, tags,
                *(element for element in elements
                  if element.tag not in ('location', 'scenarioTags'))]
    for light in elements:
        for cycle in light.iterchildren('cycle') if light.tag == 'trafficLight' else ():
            _shift_cycle(cycle, shift)
    return _without_unknown_signs(elements)


def _without_unknown_signs(
    elements: list[etree._Element],
) -> tuple[list[etree._Element], list[str]]:
    _, known = _schema()
    gone: set[str] = set()
    dropped = 0
    for sign in elements:
        parts = sign.findall('trafficSignElement') if sign.tag == 'trafficSign' else []
        unknown = [part for part in parts if part.findtext('trafficSignID') not in known]
        for part in unknown:
            sign.remove(part)
        dropped += len(unknown)
        if unknown and len(unknown) == len(parts):
            gone.add(sign.get('id'))
    for lanelet in elements if gone else ():
        for reference in lanelet.findall('.//trafficSignRef'):
            if reference.get('ref') in gone:
                reference.getparent().remove(reference)
    kept = [element for element in elements
            if element.tag != 'trafficSign' or element.get('id') not in gone]
    return kept, [f'the schema does not know {dropped} of the traffic signs; they are left out'
                  ] if dropped else []


def _shift_cycle(cycle: etree._Element, shift: int) -> None:
    """Shift a light's cycle, so that time step 0 has its state at the shift."""
    if cycle.find('cycleElement') is None:
        element = etree.SubElement(cycle, 'cycleElement')
        etree.SubElement(element, 'duration').text = '1'
        etree.SubElement(element, 'color').text = 'inactive'
    durations = [int(node.text or 0) for node in cycle.iterfind('cycleElement/duration')]
    node = cycle.find('timeOffset')
    offset = (int(node.text or 0) if node is not None else 0) - shift
    if shift and sum(durations) > 0:
        offset %= sum(durations)
    if node is not None and offset == 0:
        # The schema permits positive offsets only.
        cycle.remove(node)
    elif offset:
        node = etree.SubElement(cycle, 'timeOffset') if node is None else node
        node.text = str(offset)


def _rewritten(loaded: LoadedScenario) -> list[etree._Element]:
    network = loaded.scenario.lanelet_network
    tags = etree.Element('scenarioTags')
    for tag in sorted(loaded.scenario.tags or (), key=lambda item: str(item.value)):
        etree.SubElement(tags, tag.value)
    with warnings.catch_warnings():
        # commonroad-io warns when a lanelet without a type gets the type unknown.
        warnings.simplefilter('ignore', UserWarning)
        elements = [LocationXMLNode.create_node(loaded.scenario.location or Location()), tags]
        elements += [LaneletXMLNode.create_node(lanelet) for lanelet in network.lanelets]
        elements += [TrafficSignXMLNode.create_node(sign) for sign in network.traffic_signs]
        elements += [TrafficLightXMLNode.create_node(light) for light in network.traffic_lights]
        elements += [IntersectionXMLNode.create_node(item) for item in network.intersections]
    return elements
