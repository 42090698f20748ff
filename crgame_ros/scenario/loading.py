# Copyright 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Loading CommonRoad scenarios (2018b and 2020a) from files and from text."""

from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
import hashlib
import logging
from pathlib import Path
import re
import warnings
from xml.etree import ElementTree

from commonroad.common.reader.file_reader_xml import XMLFileReader
from commonroad.common.util import AngleInterval, Interval
from commonroad.geometry.shape import Circle, Shape, ShapeGroup
from commonroad.planning.planning_problem import PlanningProblem
from commonroad.scenario.scenario import Scenario, ScenarioID
from commonroad.scenario.state import InitialState
from lxml import etree
import numpy as np
from numpy.typing import NDArray
import shapely

from crgame_ros.errors import InputError
from crgame_ros.scenario import guard

_LENIENT_ID = re.compile(
    r'(C-)?([A-Z]{3})[-_]([A-Za-z0-9]+)[-_](\d+)(?:[-_](\d+)(?:[-_]([STPI])((?:[-_]\d+)+))?)?')
# Lanes are tabulated along their length: one of a million kilometres would fill the memory [m].
_MAX_LANELET_LENGTH = 1e5


@dataclass(frozen=True)
class LoadedScenario:
    """
    A scenario that was checked, mended where that is safe, and read.

    :param scenario: the CommonRoad scenario.
    :param planning_problems: in the order of the file; initial states are exact.
    :param xml_text: the file's text as given.
    :param sha256: of `xml_text` in UTF-8.
    :param benchmark_id: a valid benchmark id, safe as a file name.
    :param time_step_s: Delta t_c [s].
    :param notices: remarks for the user, one line each.
    :param source: file name for messages.
    """

    scenario: Scenario
    planning_problems: tuple[PlanningProblem, ...]
    xml_text: str
    sha256: str
    benchmark_id: str
    time_step_s: float
    notices: tuple[str, ...]
    source: str


def load_scenario(path: Path) -> LoadedScenario:
    """
    Load a CommonRoad XML file.

    :raises InputError: naming file, element and remedy, if it cannot be used.
    """
    return parse_scenario(guard.read_text(path), str(path))


def parse_scenario(xml_text: str, source: str) -> LoadedScenario:
    """
    Load a CommonRoad scenario from its text.

    :param xml_text: the content of a scenario file
    :param source: file name or topic for messages
    :raises InputError: naming file, element and remedy, if it cannot be used.
    """
    root = guard.parse_hardened(xml_text, source)
    guard.refuse_malformed(root, source)
    notices = _mend(root)
    scenario, problems, remarks = _read(etree.tostring(root), source)
    notices += remarks
    exact = tuple(_exact_problem(problem, notices) for problem in problems)
    for lanelet in scenario.lanelet_network.lanelets:
        if not 1e-3 < lanelet.distance[-1] < _MAX_LANELET_LENGTH:
            raise InputError(f'the centre line is {lanelet.distance[-1]:g} m long',
                             f'{source}, lanelet {lanelet.lanelet_id}', 'correct its bounds')
    if not exact:
        notices.append('the scenario has no planning problem: the human drives alone')
    digest = scenario_digest(xml_text)
    return LoadedScenario(scenario, exact, xml_text, digest, str(scenario.scenario_id),
                          float(scenario.dt), tuple(f'{source}: {n}' for n in notices), source)


def scenario_digest(xml_text: str) -> str:
    """Give the SHA-256 by which a game names its scenario's text."""
    return hashlib.sha256(xml_text.encode('utf-8')).hexdigest()


def exact_position(position: NDArray[np.float64] | Shape) -> NDArray[np.float64]:
    """Reduce an uncertain position to its centre (x, y) [m]."""
    if isinstance(position, ShapeGroup):
        centroid = group_outline(position).centroid
        return np.array([centroid.x, centroid.y])
    if isinstance(position, Shape):
        return np.asarray(position.center, dtype=np.float64)[:2]
    return np.asarray(position, dtype=np.float64)[:2]


def group_outline(group: ShapeGroup) -> shapely.Geometry:
    """Unite the shapes of a group; commonroad-io halves a circle's radius in its own outline."""
    return shapely.union_all([
        group_outline(shape) if isinstance(shape, ShapeGroup)
        else shapely.Point(shape.center).buffer(shape.radius) if isinstance(shape, Circle)
        else shape.shapely_object for shape in group.shapes])


def exact_value(value: float | Interval | None) -> float:
    """Reduce an uncertain value to the middle of its interval; a missing one is 0."""
    if value is None:
        return 0.0
    if isinstance(value, AngleInterval):
        return float(value.start + 0.5 * value.length)
    if isinstance(value, Interval):
        return float(0.5 * (value.start + value.end))
    return float(value)


def _read(data: bytes, source: str) -> tuple[Scenario, list[PlanningProblem], list[str]]:
    try:
        with _captured_remarks() as remarks:
            scenario, problems = XMLFileReader(data).open()
    except Exception as error:  # commonroad-io raises whatever its code stumbles over
        text = str(error) or 'no further explanation'
        raise InputError(f'commonroad-io cannot read it ({type(error).__name__}: {text[:200]})',
                         _element_of(error, source), 'compare it with the CommonRoad format'
                         ) from error
    return scenario, list(problems.planning_problem_dict.values()), remarks


@contextmanager
def _captured_remarks() -> Iterator[list[str]]:
    """Collect what commonroad-io would print, so that it reaches the user as notices."""
    remarks: list[str] = []

    class Collector(logging.Handler):
        def emit(self, record: logging.LogRecord) -> None:
            remarks.append(record.getMessage())

    logger = logging.getLogger('commonroad.common.reader.file_reader_xml')
    collector, propagate = Collector(logging.WARNING), logger.propagate
    logger.addHandler(collector)
    logger.propagate = False
    try:
        with warnings.catch_warnings(record=True) as caught, np.errstate(all='ignore'):
            warnings.simplefilter('always', UserWarning)
            yield remarks
    finally:
        logger.removeHandler(collector)
        logger.propagate = propagate
    remarks += [str(w.message) for w in caught if issubclass(w.category, UserWarning)]
    counted = Counter(' '.join(remark.split())[:200] for remark in remarks)
    remarks[:] = [f'{text} ({n} times)' if n > 1 else text for text, n in counted.items()
                  if 'Default traffic sign IDs' not in text]


def _element_of(error: BaseException, source: str) -> str:
    """Find the element that commonroad-io was reading when it failed."""
    found = source
    trace = error.__traceback__
    while trace is not None:
        node = trace.tb_frame.f_locals.get('xml_node')
        if isinstance(node, ElementTree.Element) and node.get('id') is not None:
            found = f'{source}, {node.tag} {node.get("id")}'
        trace = trace.tb_next
    return found


def _exact_problem(problem: PlanningProblem, notices: list[str]) -> PlanningProblem:
    state = problem.initial_state
    uncertain = [name for name in state.used_attributes
                 if isinstance(getattr(state, name), Shape | Interval)]
    if not uncertain:
        return problem
    notices.append(f'planning problem {problem.planning_problem_id}: the uncertain initial '
                   f'{", ".join(uncertain)} is reduced to its centre')
    exact = InitialState(
        time_step=round(exact_value(state.time_step)), position=exact_position(state.position),
        orientation=exact_value(state.orientation), velocity=exact_value(state.velocity),
        acceleration=exact_value(state.acceleration), yaw_rate=exact_value(state.yaw_rate),
        slip_angle=exact_value(state.slip_angle))
    return PlanningProblem(problem.planning_problem_id, exact, problem.goal)


def _mend(root: etree._Element) -> list[str]:
    notices: list[str] = []
    _mend_header(root, notices)
    _mend_references(root, notices)
    _mend_adjacency(root, notices)
    heights = [point for point in root.iter('point') if point.find('z') is not None]
    for point in heights:
        point.remove(point.find('z'))
    if heights:
        notices.append(f'the heights of {len(heights)} points are ignored')
    for light in root.iterchildren('trafficLight'):
        if light.find('cycle') is None:
            etree.SubElement(light, 'cycle')
            notices.append(f'traffic light {light.get("id")} has no cycle and is inactive')
    for obstacle in root.iterchildren('obstacle', 'dynamicObstacle'):
        for name, entry in (('trajectory', 'state'), ('occupancySet', 'occupancy')):
            for series in obstacle.findall(name):
                if series.find(entry) is None:
                    obstacle.remove(series)
                    notices.append(f'obstacle {obstacle.get("id")}: its empty {name} is ignored')
    return notices


def _mend_header(root: etree._Element, notices: list[str]) -> None:
    given = root.get('benchmarkID', '')
    benchmark_id = _valid_benchmark_id(given)
    if benchmark_id != given:
        root.set('benchmarkID', benchmark_id)
        notices.append(f'the malformed benchmark id {given[:60]!r} is replaced by {benchmark_id}')
    if root.get('commonRoadVersion') == '2018b':
        root.set('tags', root.get('tags', ''))
    elif root.find('scenarioTags') is None:
        etree.SubElement(root, 'scenarioTags')
    location = root.find('location')
    names = ('geoNameId', 'gpsLatitude', 'gpsLongitude')
    if location is not None and not (
            all(location.find(name) is not None for name in names)
            and guard.has_finite_numbers(location.iter(
                *names, 'xTranslation', 'yTranslation', 'zRotation', 'scaling'))):
        root.remove(location)
        notices.append('the location is incomplete or holds no numbers and is ignored')


def _valid_benchmark_id(given: str) -> str:
    candidates = [given]
    parts = _LENIENT_ID.fullmatch(given)
    if parts is not None:
        cooperative, country, name, map_id, configuration, kind, numbers = parts.groups('')
        candidates.append(f'{cooperative}{country}_{name}-{map_id}'
                          + (f'_{configuration}' if configuration else '')
                          + (f'_{kind}{numbers.replace("_", "-")}' if kind else ''))
    for candidate in candidates:
        if len(candidate) <= 100 and ScenarioID.benchmark_id_pattern.fullmatch(candidate):
            try:
                ScenarioID.from_benchmark_id(candidate, '2020a')
            except (ValueError, AssertionError):
                continue
            return candidate
    return f'ZAM_{re.sub("[^A-Za-z0-9]", "", given)[:40] or "Unnamed"}-1'


def _mend_references(root: etree._Element, notices: list[str]) -> None:
    """Drop references to what does not exist; commonroad-io would stumble over them."""
    ids = {tag: {e.get('id') for e in root.iterchildren(tag)}
           for tag in ('lanelet', 'trafficSign', 'trafficLight')}
    targets = {'trafficSignRef': 'trafficSign', 'trafficLightRef': 'trafficLight'}
    dropped: Counter[str] = Counter()
    for parent in root.iterchildren('lanelet', 'intersection'):
        for reference in parent.findall('.//*[@ref]'):
            target = targets.get(reference.tag, 'lanelet')
            if reference.tag != 'isLeftOf' and reference.get('ref') not in ids[target]:
                reference.getparent().remove(reference)
                dropped[f'<{reference.tag}> to the missing {target} {reference.get("ref")}'] += 1
    if dropped:
        notices.append(f'{dropped.total()} references lead nowhere and are ignored, the first: '
                       f'{next(iter(dropped))}')
    for tag in ('trafficSign', 'trafficLight'):
        used = {e.get('ref') for e in root.iterfind(f'lanelet/{tag}Ref')}
        for element in root.findall(tag):
            if element.get('id') not in used and (
                    tag == 'trafficSign' or element.find('position') is None):
                root.remove(element)
                notices.append(f'{tag} {element.get("id")} belongs to no lanelet and is ignored')


def _mend_adjacency(root: etree._Element, notices: list[str]) -> None:
    """Cut chains of neighbours that run in a circle; commonroad-io would follow them for ever."""
    for side in ('adjacentLeft', 'adjacentRight'):
        links = {}
        for lanelet in root.iterchildren('lanelet'):
            link = lanelet.find(side)
            if link is not None and link.get('drivingDir') == 'same':
                links[lanelet.get('id')] = link
        done: set[str] = set()
        for start in list(links):
            chain: set[str] = set()
            current = start
            while current in links and current not in done:
                chain.add(current)
                following = links[current].get('ref')
                if following in chain:
                    link = links.pop(current)
                    link.getparent().remove(link)
                    notices.append(f'lanelet {current}: its {side} closes a circle and is '
                                   'ignored')
                    break
                current = following
            done |= chain
