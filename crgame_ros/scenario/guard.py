# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Checks untrusted scenario files, so that files that pass can be read without harm."""

from collections.abc import Iterable
from datetime import date
import math
from pathlib import Path
import re

from crgame_ros.errors import InputError
from crgame_ros.library.stored_index import MAX_BYTES
from crgame_ros.paths import irregular
from crgame_ros.scenario.export_ids import whole_number
from lxml import etree

MAX_MAGNITUDE = 1e9
MAX_TIME_STEP = 100_000
# A plan covers seconds in steps of this length: with 1 ms it would have thousands of states.
MIN_STEP_S, MAX_STEP_S = 0.01, 10.0
# No vehicle is faster; lengths of searches and paths grow with the speed [m/s].
MAX_SPEED = 200.0
# The largest published map has a tenth of it; reading a million takes a minute.
MAX_POINTS = 200_000
VERSIONS = ('2018b', '2020a')
OBSTACLE_TAGS = ('obstacle', 'staticObstacle', 'dynamicObstacle', 'environmentObstacle',
                 'phantomObstacle')

_FLOAT_TAGS = frozenset({'x', 'y', 'z', 'length', 'width', 'radius', 'orientation', 'speedLimit'})
_INTEGER_TAGS = frozenset({'duration', 'timeOffset'})
_EITHER_TAGS = frozenset({'exact', 'intervalStart', 'intervalEnd'})
_TOP_LEVEL_IDS = ('lanelet', 'trafficSign', 'trafficLight', 'intersection', *OBSTACLE_TAGS)
_DECLARATION = re.compile(r'^\ufeff?\s*<\?xml[^>]*\?>')
_ENCODING = re.compile(rb'^\s*<\?xml[^>]*?encoding\s*=\s*["\']([A-Za-z0-9._-]+)["\']')
_DOWNLOAD = 'copy the file again'


def read_text(path: Path) -> str:
    """
    Read a scenario file of at most 64 MiB; only regular files are opened.

    :raises InputError: if it is missing, not a regular file, unreadable, too large or not text.
    """
    name = str(path)
    try:
        status = path.stat()
        if (other := irregular(status.st_mode)) is not None:
            raise InputError(f'is {other}', name, 'name a CommonRoad XML file')
        if status.st_size > MAX_BYTES:
            raise _too_large(status.st_size, name)
        with path.open('rb') as stream:
            data = stream.read(MAX_BYTES + 1)
    except OSError as error:
        raise InputError(f'cannot be read ({error.strerror})', name,
                         'check the name and the permissions') from error
    except ValueError as error:
        raise InputError(f'is no file name ({error})', repr(name), 'name a file') from error
    if len(data) > MAX_BYTES:
        raise _too_large(len(data), name)
    return _decode(data, name)


def parse_hardened(text: str, source: str, root_tag: str = 'commonRoad') -> etree._Element:
    """
    Parse XML without entities, document types, network access or oversized nodes.

    :param text: the file's content, of any declared encoding
    :param source: file name for messages
    :param root_tag: name of the root element: of a scenario, unless it is a solution
    :raises InputError: if it is not XML, has another root, or declares a document type.
    """
    if len(text) > MAX_BYTES:
        raise _too_large(len(text), source)
    parser = etree.XMLParser(resolve_entities=False, no_network=True, load_dtd=False,
                             huge_tree=False, remove_comments=True, remove_pis=True)
    declaration = _DECLARATION.match(text)
    if declaration is not None:
        blank = re.sub(r'[^\n]', '', declaration.group())
        text = blank + text[declaration.end():]
    try:
        root = etree.fromstring(text.encode('utf-8'), parser)
    except (etree.XMLSyntaxError, ValueError) as error:
        if '<!ENTITY' in text:
            raise _has_doctype(source) from error
        raise InputError(f'is no well-formed XML ({error})', source, _DOWNLOAD) from error
    if root.getroottree().docinfo.doctype:
        raise _has_doctype(source)
    if root.tag != root_tag:
        kind = 'scenario' if root_tag == 'commonRoad' else 'solution'
        raise InputError(f'the root element is <{root.tag}>', source,
                         f'give a CommonRoad {kind}, whose root is <{root_tag}>')
    return root


def refuse_malformed(root: etree._Element, source: str) -> None:
    """
    Refuse faults that cannot be repaired: in header, numbers, ids and lanelet bounds.

    :raises InputError: naming file, element and line.
    """
    _check_header(root, source)
    _check_ids(root, source)
    _check_numbers(root, source)
    lanelets = root.findall('lanelet')
    if not lanelets:
        raise InputError('has no lanelets', source, 'give a scenario with a road network')
    points = {lanelet.get('id'): _check_bounds(lanelet, source) for lanelet in lanelets}
    for element in root.iterchildren(*OBSTACLE_TAGS, 'planningProblem'):
        _check_states(element, source)
    for occupancies in root.iterfind('phantomObstacle/occupancySet'):
        if occupancies.find('occupancy') is None:
            raise InputError('its <occupancySet> has no <occupancy>', where(occupancies, source),
                             'add one, or remove the set')
    for reference in root.iterfind('.//position/lanelet'):
        if reference.get('ref') not in points:
            name = 'goal' if reference.getparent().getparent().tag == 'goalState' else 'position'
            raise InputError(f'the {name} names lanelet {reference.get("ref")}, which does not '
                             'exist', where(reference, source), f'correct the {name}')
    # Each position of an obstacle in a lanelet becomes an area of its own.
    count = sum(points.values()) + sum(
        points[reference.get('ref')] for obstacle in root.iterchildren(*OBSTACLE_TAGS)
        for reference in obstacle.iterfind('.//position/lanelet'))
    if count > MAX_POINTS:
        raise InputError(f'its lanelets, and those that are positions of obstacles, have {count} '
                         f'points, more than {MAX_POINTS}', source,
                         'thin them out, or cut the map')


def where(element: etree._Element, source: str) -> str:
    """Return file, line and the nearest enclosing element with an id, as text."""
    named: etree._Element | None = element
    while named is not None and named.get('id') is None:
        named = named.getparent()
    line = f'{source}, line {element.sourceline}'
    return line if named is None else f'{line}, {named.tag} {named.get("id")}'


def has_finite_numbers(elements: Iterable[etree._Element]) -> bool:
    """Return whether every leaf among the elements holds a finite number."""
    try:
        return all(math.isfinite(float(e.text or '')) for e in elements if not len(e))
    except ValueError:
        return False


def is_date(text: str) -> bool:
    """Return whether a text is a date of the form 2026-01-31, as the schema wants it."""
    try:
        return date.fromisoformat(text).isoformat() == text
    except ValueError:
        return False


def _too_large(size: int, source: str) -> InputError:
    return InputError(f'has {size / 2 ** 20:.0f} MiB, more than {MAX_BYTES // 2 ** 20}', source,
                      'give a smaller scenario')


def _has_doctype(source: str) -> InputError:
    return InputError('declares a document type or entities, which are not allowed', source,
                      'remove <!DOCTYPE …>')


def encode(text: str) -> bytes:
    """Return the bytes of a file that `read_text` reads as this text."""
    declared = _ENCODING.match(text[:200].encode('utf-8'))
    return text.encode(declared.group(1).decode('ascii') if declared else 'utf-8')


def _decode(data: bytes, source: str) -> str:
    declared = _ENCODING.match(data[:200].removeprefix(b'\xef\xbb\xbf'))
    encoding = declared.group(1).decode('ascii') if declared else 'utf-8'
    if data.startswith((b'\xff\xfe', b'\xfe\xff')):
        encoding = 'utf-16'
    try:
        return data.decode(encoding).removeprefix('\ufeff')
    except (LookupError, ValueError) as error:
        raise InputError(f'is no text of encoding {encoding}', source,
                         'give a CommonRoad XML file') from error


def _check_header(root: etree._Element, source: str) -> None:
    version = root.get('commonRoadVersion')
    if version not in VERSIONS:
        raise InputError(f'commonRoadVersion is {version!r}', f'{source}, <commonRoad>',
                         f'give a scenario of 2017a, {" or ".join(VERSIONS)}')
    text = root.get('timeStepSize')
    if text is None:
        raise InputError('timeStepSize is missing', f'{source}, <commonRoad>',
                         'add the time step in seconds')
    try:
        step = float(text)
    except ValueError:
        step = math.nan
    if not MIN_STEP_S <= step <= MAX_STEP_S:
        raise InputError(f'timeStepSize is {text!r}', f'{source}, <commonRoad>',
                         f'give seconds from {MIN_STEP_S} to {MAX_STEP_S:g}')


def _check_ids(root: etree._Element, source: str) -> None:
    seen: dict[int, str] = {}
    problems: dict[int, str] = {}
    for element in root.iterchildren(*_TOP_LEVEL_IDS, 'planningProblem'):
        kind = problems if element.tag == 'planningProblem' else seen
        text = element.get('id')
        number = whole_number(text)
        if number is None:
            raise InputError(f'<{element.tag}> has the id {text!r}', where(element, source),
                             'give a whole number of at most 18 digits')
        if number in kind:
            raise InputError(f'the id {number} is used by a {kind[number]} too',
                             where(element, source), 'give each element an id of its own')
        kind[number] = element.tag
        # References are compared as text later, so ids are normalised: ' 07' equals '7'.
        element.set('id', str(number))
    for reference in root.iterfind('.//*[@ref]'):
        number = whole_number(reference.get('ref'))
        if number is None:
            raise InputError(f'<{reference.tag}> refers to {reference.get("ref")!r}',
                             where(reference, source), 'give the id of an element')
        reference.set('ref', str(number))


def _check_numbers(root: etree._Element, source: str) -> None:
    for element in root.iter(*_FLOAT_TAGS, *_INTEGER_TAGS, *_EITHER_TAGS):
        # That of a state holds its value in a child, which is checked itself.
        if len(element) and element.tag == 'orientation':
            continue
        integer = element.tag in _INTEGER_TAGS or (
            element.tag in _EITHER_TAGS and element.getparent().tag == 'time')
        try:
            value = math.nan if len(element) else (int if integer else float)(element.text)
        except (TypeError, ValueError):
            value = math.nan
        if not abs(value) <= MAX_MAGNITUDE:
            raise InputError(
                f'<{element.tag}> is {(element.text or "empty")[:40]!r}, no usable '
                f'{"whole " if integer else ""}number', where(element, source),
                'give a finite number')


def _check_bounds(lanelet: etree._Element, source: str) -> int:
    """Check the points of a lanelet, and return their number."""
    counts = []
    for name in ('leftBound', 'rightBound'):
        points = lanelet.findall(f'{name}/point')
        if len(points) < 2:
            raise InputError(f'<{name}> has {len(points)} points', where(lanelet, source),
                             'give each bound at least 2')
        for point in points:
            if point.find('x') is None or point.find('y') is None:
                raise InputError('a point has no x or no y', where(point, source),
                                 'complete it')
        counts.append(len(points))
    if counts[0] != counts[1]:
        raise InputError(f'the bounds have {counts[0]} and {counts[1]} points',
                         where(lanelet, source), 'give both bounds equally many')
    return counts[0] + counts[1]


def _check_states(element: etree._Element, source: str) -> None:
    if element.tag in ('environmentObstacle', 'phantomObstacle'):
        states: list[etree._Element] = []
    else:
        states = element.findall('initialState')
        if not states:
            raise InputError('has no initialState', where(element, source), 'add it')
    if element.tag == 'planningProblem':
        for speed in element.iterfind('initialState/velocity/*'):
            if speed.tag in _EITHER_TAGS and not abs(float(speed.text)) <= MAX_SPEED:
                raise InputError(f'the initial velocity is {float(speed.text):g} m/s',
                                 where(speed, source),
                                 f'give one between -{MAX_SPEED:g} and {MAX_SPEED:g} m/s')
    states += element.findall('trajectory/state')
    for state in states:
        if state.find('position') is None:
            raise InputError(f'a <{state.tag}> has no position', where(state, source), 'add it')
    for timed in [*states, *element.findall('occupancySet/occupancy')]:
        for step in timed.iterfind('time/*'):
            if step.tag in _EITHER_TAGS and not 0 <= int(step.text) <= MAX_TIME_STEP:
                raise InputError(f'the time step {step.text} lies outside 0 to {MAX_TIME_STEP}',
                                 where(step, source), 'correct it')
