# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Loads CommonRoad scenarios (2017a, 2018b and 2020a) from files and from text.

An exported file has a planning problem for every driven vehicle. The attribute `source` states
which of them a human drove, and which obstacle has the recorded drive. The schema accepts any text
there, and commonroad-io preserves it on reading and writing, unlike comments.
"""

from collections import Counter
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
import hashlib
import logging
from pathlib import Path
import pickle
import re
import warnings
from xml.etree import ElementTree

from commonroad.common.reader.file_reader_xml import XMLFileReader
from commonroad.planning.planning_problem import PlanningProblem
from commonroad.scenario.lanelet import Lanelet
from commonroad.scenario.scenario import Scenario
from commonroad.scenario.state import InitialState
from commonroad.scenario.traffic_sign import SupportedTrafficSignCountry
from crgame_ros.errors import InputError, one_line
from crgame_ros.roads.surface import lanelet_ring
from crgame_ros.scenario import guard
from crgame_ros.scenario.exact_values import exact_position, exact_value, uncertain_values
from crgame_ros.scenario.format_2017a import upgrade
from crgame_ros.scenario.repair import mend, mend_places
from crgame_ros.scenario.simplifications import simplifications, unused_elements
from lxml import etree
import numpy as np
from numpy.typing import NDArray
import shapely

# Lanes are sampled along their length: one of a million kilometres would fill the memory [m].
_MAX_LANELET_LENGTH = 1e5
# Whose signs commonroad-io knows; those of its own country ZAM are Germany's.
_COUNTRIES = frozenset(country.value for country in SupportedTrafficSignCountry)
# Size of the cache of loaded texts: batches of runs, and tables of a run, load them many times.
_KEPT = 8
# Repairing the surface of a lanelet with crossing bounds takes cubic time: 500 points took 4 s.
_MOST_TANGLED = 200
# Text in the source of every exported file, which identifies such files.
SOURCE_MARK = 'driven in crgame_ros'
_NOTE = re.compile(r' \(humans?: ([^()]*)\)')
_HUMAN = re.compile(r'planning problem (\d{1,18}) is obstacle (\d{1,18})')


@dataclass(frozen=True)
class LaneletHeights:
    """The heights of the vertices of a lanelet's bounds, (N) each [m]."""

    left: NDArray[np.float64]
    right: NDArray[np.float64]


def _take_heights(root: etree._Element) -> tuple[dict[int, LaneletHeights], list[str]]:
    """
    Read the heights of lanelets whose vertices all have one, and remove all heights.

    :param root: a scenario that passed `guard.refuse_malformed`; changed in place
    :return: by lanelet id, and remarks, one line each
    """
    found = {}
    for lanelet in root.iterchildren('lanelet'):
        left, right = (
            [float(text) for point in lanelet.iterfind(f'{side}/point')
             if (text := point.findtext('z')) is not None] for side in ('leftBound', 'rightBound'))
        count = len(lanelet.findall('leftBound/point'))
        if left and len(left) == len(right) == count:
            found[int(lanelet.get('id', ''))] = LaneletHeights(np.array(left), np.array(right))
    points = [point for point in root.iter('point', 'center') if point.find('z') is not None]
    for point in points:
        point.remove(point.find('z'))
    shown = sum(2 * len(heights.left) for heights in found.values())
    notices = []
    if shown:
        notices.append(f'the heights of {shown} points are for the eye alone')
    if shown < len(points):
        notices.append(f'the heights of {len(points) - shown} points are ignored: only those of '
                       'lanelets whose points all have one are shown')
    return found, notices


@dataclass(frozen=True)
class LoadedScenario:
    """
    A scenario that was checked, repaired where that is safe, and read.

    :param planning_problems: in the order of the file; initial states are exact.
    :param xml_text: the file's text, unchanged.
    :param sha256: digest of `xml_text` in UTF-8.
    :param benchmark_id: a valid benchmark id, safe as a file name.
    :param time_step_s: Delta t_c [s].
    :param notices: remarks for the user, one line each.
    :param source: file name for messages.
    :param heights: heights of lanelets by id, where the file has them; the scenario is flat.
    """

    scenario: Scenario
    planning_problems: tuple[PlanningProblem, ...]
    xml_text: str
    sha256: str
    benchmark_id: str
    time_step_s: float
    notices: tuple[str, ...]
    source: str
    heights: dict[int, LaneletHeights] = field(default_factory=dict)

    @cached_property
    def human_problems(self) -> dict[int, int]:
        """Return the planning problems of recorded humans, with the obstacles of their drives."""
        recorded = {obstacle.obstacle_id for obstacle in self.scenario.dynamic_obstacles}
        return {problem: obstacle for problem, obstacle
                in _read_human_note(self.scenario.source or '').items() if obstacle in recorded}


def load_scenario(path: Path) -> LoadedScenario:
    """
    Load a CommonRoad XML file.

    :raises InputError: naming file, element and remedy, if it cannot be used.
    """
    return parse_scenario(guard.read_text(path), str(path))


def parse_scenario(xml_text: str, source: str) -> LoadedScenario:
    """
    Load a CommonRoad scenario from its text.

    Loading a text again returns a separate copy of the cached result: changes of one copy do not
    affect others.

    :param xml_text: the content of a scenario file
    :param source: file name or topic for messages
    :raises InputError: naming file, element and remedy, if it cannot be used.
    """
    loaded = pickle.loads(_pickled(_Text(xml_text, source)))
    return replace(loaded, source=source, notices=tuple(
        one_line(f'{source}: {notice}') for notice in loaded.notices))


@dataclass(frozen=True)
class _Text:
    """A text to load; the same one from elsewhere, as from a recording, is equal."""

    xml: str
    source: str = field(compare=False)


@lru_cache(_KEPT)
def _pickled(text: _Text) -> bytes:
    return pickle.dumps(_parsed(text.xml, text.source), pickle.HIGHEST_PROTOCOL)


def _parsed(xml_text: str, source: str) -> LoadedScenario:
    """Load a scenario with notices that do not name its source yet."""
    root = guard.parse_hardened(xml_text, source)
    notices = upgrade(root) + mend_places(root)
    guard.refuse_malformed(root, source)
    heights, remarks = _take_heights(root)
    notices += remarks + mend(root) + unused_elements(root)
    scenario, problems, remarks = _read(etree.tostring(root), source)
    notices += remarks
    # commonroad-io looks for an attribute of this name.
    virtual = {int(element.get('id')) for element in root.iterchildren('trafficSign')
               if element.findtext('virtual') == 'true'}
    for sign in scenario.lanelet_network.traffic_signs:
        sign.virtual = sign.traffic_sign_id in virtual
    exact = tuple(_exact_problem(problem, notices) for problem in problems)
    notices += simplifications(scenario)
    country = str(scenario.scenario_id.country_id)
    if country not in _COUNTRIES and scenario.lanelet_network.traffic_signs:
        notices.append(f"the signs of {country} are not known and count as Germany's")
    for lanelet in scenario.lanelet_network.lanelets:
        if not 1e-3 < lanelet.distance[-1] < _MAX_LANELET_LENGTH:
            raise InputError(f'the centre line is {lanelet.distance[-1]:g} m long',
                             f'{source}, lanelet {lanelet.lanelet_id}', 'correct its bounds')
        if _is_tangled(lanelet):
            raise InputError(f'its bounds of {len(lanelet.left_vertices)} points cross themselves '
                             'or each other', f'{source}, lanelet {lanelet.lanelet_id}',
                             'correct its bounds')
    if not exact:
        notices.append('the scenario has no planning problem: the human drives alone')
    digest = scenario_digest(xml_text)
    return LoadedScenario(scenario, exact, xml_text, digest, str(scenario.scenario_id),
                          float(scenario.dt), tuple(notices), source, heights)


def _is_tangled(lanelet: Lanelet) -> bool:
    """Return whether bounds of many points cross; users repair crossing bounds of few points."""
    if len(lanelet.left_vertices) <= _MOST_TANGLED:
        return False
    return not shapely.Polygon(lanelet_ring(lanelet)).is_valid


def scenario_digest(xml_text: str) -> str:
    """Return the SHA-256 by which a game identifies its scenario's text."""
    return hashlib.sha256(xml_text.encode('utf-8')).hexdigest()


def _read(data: bytes, source: str) -> tuple[Scenario, list[PlanningProblem], list[str]]:
    try:
        with _captured_remarks() as remarks:
            scenario, problems = XMLFileReader(data).open()
    except Exception as error:  # commonroad-io can raise any exception
        text = str(error) or 'no further explanation'
        raise InputError(f'commonroad-io cannot read it ({type(error).__name__}: {text[:200]})',
                         _element_of(error, source), 'compare it with the CommonRoad format'
                         ) from error
    return scenario, list(problems.planning_problem_dict.values()), remarks


@contextmanager
def _captured_remarks() -> Iterator[list[str]]:
    """Collect warnings of commonroad-io, so that the user gets them as notices."""
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
    """Return the element that commonroad-io was reading when it failed, as text."""
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
    uncertain = uncertain_values(state)
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


def human_note(humans: Mapping[int, int]) -> str:
    """Return the text after `SOURCE_MARK` that tells obstacle ids by planning problem."""
    if not humans:
        return ''
    told = ', '.join(f'planning problem {number} is obstacle {obstacle}'
                     for number, obstacle in humans.items())
    return f' ({"human" if len(humans) == 1 else "humans"}: {told})'


def without_human_notes(source: str) -> str:
    """Return a source without the notes of earlier runs, which hold for their own files only."""
    return _NOTE.sub('', source)


def _read_human_note(source: str) -> dict[int, int]:
    """Return the obstacle ids by planning problem in a source with a `human_note`."""
    mark = source.rfind(SOURCE_MARK)
    note = _NOTE.match(source, mark + len(SOURCE_MARK)) if mark >= 0 else None
    return {} if note is None else {
        int(problem): int(obstacle) for problem, obstacle in _HUMAN.findall(note[1])}


def plays_its_humans(path: Path) -> bool:
    """
    Return whether a file is an exported run whose humans play back while its AVs drive.

    :raises InputError: if it cannot be read.
    """
    root = guard.parse_hardened(guard.read_text(path), str(path))
    humans = _read_human_note(root.get('source', ''))
    problems = {problem.get('id') for problem in root.iterchildren('planningProblem')}
    return bool(humans) and not problems <= {str(number) for number in humans}
