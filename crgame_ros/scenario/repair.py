# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Repairs scenario files where that is safe, before commonroad-io reads them."""

from collections import Counter
import copy
import math
import re

from commonroad.scenario.scenario import ScenarioID, TimeOfDay, Underground, Weather
from commonroad.scenario.traffic_light import TrafficLightDirection
from crgame_ros.scenario import guard
from crgame_ros.scenario.export_ids import ids_of, renumber
from lxml import etree

# A published map has an intended gap of 160 m; paths are sampled along gaps [m].
MAX_GAP = 1000.0
# A gap that a person would see [m].
TOLD_GAP = 5.0
# Elements that hold a truth value: commonroad-io knows the words, the schema 1 and 0 as well.
_BOOLEANS = ('horn', 'indicatorLeft', 'indicatorRight', 'brakingLights', 'hazardWarningLights',
             'flashingBlueLights', 'active', 'virtual')
# Elements that link a lanelet to others.
LINKS = ('successor', 'predecessor', 'adjacentLeft', 'adjacentRight')
_DIRECTIONS = frozenset(each.value for each in TrafficLightDirection)
_LENIENT_ID = re.compile(
    r'(C-)?([A-Z]{3})[-_.]([A-Za-z0-9]+)[-_.](\d+)'
    r'(?:[-_.](\d+)(?:[-_.]([STPI])((?:[-_.]\d+)+))?)?')


def mend_places(root: etree._Element) -> list[str]:
    """
    Remove positions of signs and lights that are no numbers; they are drawn at their lanelets.

    :param root: changed in place, before `guard.refuse_malformed`.
    :return: remarks, one line each.
    """
    notices = []
    for element in root.iterchildren('trafficSign', 'trafficLight'):
        for position in element.findall('position'):
            if not guard.has_finite_numbers(position.iter('x', 'y', 'z')):
                element.remove(position)
                notices.append(f'{element.tag} {element.get("id")}: its position is no number and '
                               'is ignored')
    return notices


def mend(root: etree._Element) -> list[str]:
    """
    Repair faults that need no guessing; commonroad-io would fail on them.

    :param root: a scenario that passed `guard.refuse_malformed`; changed in place.
    :return: remarks on the repairs, one line each.
    """
    notices: list[str] = []
    _mend_header(root, notices)
    _mend_references(root, notices)
    _mend_gaps(root, notices)
    _mend_adjacency(root, notices)
    _mend_incomings(root, notices)
    _mend_times(root, notices)
    _mend_positions(root)
    for element in root.iter(*_BOOLEANS):
        text = (element.text or '').strip()
        element.text = {'1': 'true', '0': 'false'}.get(text, text)
    _mend_stop_lines(root, notices)
    for light in root.iterchildren('trafficLight'):
        direction = light.find('direction')
        if direction is not None:
            direction.text = (direction.text or '').strip()
            if direction.text not in _DIRECTIONS:
                notices.append(f'traffic light {light.get("id")}: its direction '
                               f'{direction.text[:40]!r} is not known and counts as all')
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
    if not guard.is_date(root.get('date', '')):
        notices.append(f'the date {root.get("date", "")[:40]!r} is no date of the form '
                       '2026-01-31 and is ignored')
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
    for geometry in root.findall('location/geoTransformation'):
        if geometry.find('geoReference') is None:
            geometry.getparent().remove(geometry)
            notices.append('the geoTransformation has no geoReference and is ignored')
    for environment in root.iterfind('location/environment'):
        _mend_environment(environment, notices)


def _mend_environment(environment: etree._Element, notices: list[str]) -> None:
    """Replace words that commonroad-io does not know, among them some of the schema."""
    for tag, kind, alias in (('timeOfDay', TimeOfDay, {'day': 'unknown'}),
                             ('weather', Weather, {'sunny': 'clear'}),
                             ('underground', Underground, {})):
        node = environment.find(tag)
        node = etree.SubElement(environment, tag) if node is None else node
        given = (node.text or '').strip()
        node.text = alias.get(given, given)
        if node.text not in {value.value for value in kind}:
            node.text = 'unknown'
            notices.append(f'the {tag} {given[:40]!r} is not known and is ignored')


def _valid_benchmark_id(given: str) -> str:
    """Return a valid id with as much of the given one as can be read: at least its country."""
    candidates = [given]
    parts = _LENIENT_ID.fullmatch(given)
    if parts is not None:
        cooperative, country, name, map_id, configuration, kind, numbers = parts.groups('')
        candidates.append(f'{cooperative}{country}_{name}-{map_id}'
                          + (f'_{configuration}' if configuration else '')
                          + (f'_{kind}{re.sub("[_.]", "-", numbers)}' if kind else ''))
    # The country decides what the ids of traffic signs mean.
    known = re.match('(?:C-)?([A-Z]{3})[-_.]', given)
    if known is not None:
        candidates.append(f'{known[1]}_{_plain(given[known.end():])}-1')
    for candidate in candidates:
        if len(candidate) <= 100 and ScenarioID.benchmark_id_pattern.fullmatch(candidate):
            try:
                ScenarioID.from_benchmark_id(candidate, '2020a')
            except (ValueError, AssertionError):
                continue
            return candidate
    return f'ZAM_{_plain(given) or "Unnamed"}-1'


def _plain(text: str) -> str:
    """Return the letters and digits of a text, at most 40."""
    return re.sub('[^A-Za-z0-9]', '', text)[:40]


def _mend_references(root: etree._Element, notices: list[str]) -> None:
    """Remove references to missing elements; commonroad-io would fail on them."""
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
    for lanelet in root.iterchildren('lanelet'):
        for link in _links(lanelet):
            if link.tag.startswith('adjacent') and \
                    link.get('drivingDir') not in ('same', 'opposite'):
                notices.append(f'lanelet {lanelet.get("id")}: the drivingDir of its {link.tag} is '
                               f'{link.get("drivingDir")!r} and counts as opposite')
                link.set('drivingDir', 'opposite')
            if link.get('ref') is None:
                lanelet.remove(link)
                dropped[f'<{link.tag}> of lanelet {lanelet.get("id")}, without a ref'] += 1
    if dropped:
        many = dropped.total() > 1
        notices.append(f'{dropped.total()} reference{"s lead" if many else " leads"} nowhere and '
                       f'{"are" if many else "is"} ignored{", the first" * many}: '
                       f'{next(iter(dropped))}')
    # A sign or light that only the stop line names concerns its lanelet.
    for lanelet in root.iterchildren('lanelet'):
        known = {(each.tag, each.get('ref')) for each in lanelet}
        for reference in lanelet.findall('stopLine/*[@ref]'):
            named = reference.tag, reference.get('ref')
            if named not in known:
                known.add(named)
                etree.SubElement(lanelet, named[0], ref=named[1])
    for tag in ('trafficSign', 'trafficLight'):
        used = {e.get('ref') for e in root.iterfind(f'lanelet/{tag}Ref')}
        for element in root.findall(tag):
            if element.get('id') not in used and (
                    tag == 'trafficSign' or element.find('position') is None):
                root.remove(element)
                notices.append(f'{tag} {element.get("id")} belongs to no lanelet and is ignored')


def _mend_gaps(root: etree._Element, notices: list[str]) -> None:
    """Remove links between lanelets that are far apart: vehicles cannot drive between them."""
    ends = {lanelet.get('id'): (_middle(lanelet, 0), _middle(lanelet, -1))
            for lanelet in root.iterchildren('lanelet')}
    cut: list[tuple[float, str]] = []
    kept: list[tuple[float, str]] = []
    for lanelet in root.iterchildren('lanelet'):
        start, end = ends[lanelet.get('id')]
        for link in _links(lanelet):
            first, last = ends[link.get('ref')]
            gap = math.dist(end, first) if link.tag == 'successor' \
                else math.dist(start, last) if link.tag == 'predecessor' \
                else min(math.dist(a, b) for a in (start, end) for b in (first, last))
            if not gap <= MAX_GAP:
                lanelet.remove(link)
                cut.append((gap, f'<{link.tag}> of lanelet {lanelet.get("id")}'))
            elif link.tag == 'successor' and gap > TOLD_GAP:
                kept.append((gap, f'from {lanelet.get("id")} to {link.get("ref")}'))
    if kept:
        notices.append(f'gaps of more than {TOLD_GAP:g} m between lanelets and their successors, '
                       f'which agents of traffic do not cross: {len(kept)}, the widest, '
                       f'{max(kept)[0]:.0f} m: {max(kept)[1]}')
    if cut:
        notices.append(f'{len(cut)} links of lanelets more than {MAX_GAP:g} m apart are ignored, '
                       f'the widest, {max(cut)[0]:.0f} m: {max(cut)[1]}')


def _links(lanelet: etree._Element) -> list[etree._Element]:
    """Return the elements that link a lanelet to others."""
    return [link for tag in LINKS for link in lanelet.findall(tag)]


def _middle(lanelet: etree._Element, index: int) -> tuple[float, float]:
    """Return the midpoint between the first, or last, points of both bounds."""
    points = [lanelet.findall(f'{name}/point')[index] for name in ('leftBound', 'rightBound')]
    x, y = (sum(float(point.find(axis).text) for point in points) / 2 for axis in 'xy')
    return x, y


def _mend_adjacency(root: etree._Element, notices: list[str]) -> None:
    """Remove cyclic links of neighbours; commonroad-io would follow them endlessly."""
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


def _mend_times(root: etree._Element, notices: list[str]) -> None:
    """Set missing times: time step 0 for states, any time for goals."""
    for element in root.iterchildren(*guard.OBSTACLE_TAGS, 'planningProblem'):
        for state in element.findall('initialState'):
            if state.find('time/*') is None:
                _set_time(state, {'exact': 0})
                notices.append(f'{element.tag} {element.get("id")}: its initial state has no time '
                               'and counts as that of time step 0')
            _complete_state(state)
        between = [time for time in element.iterfind('trajectory/state/time')
                   if time.find('intervalStart') is not None
                   and time.find('intervalEnd') is not None]
        for time in between:
            middle = sum(float(time.findtext(name)) for name in ('intervalStart', 'intervalEnd'))
            _set_time(time.getparent(), {'exact': int(middle // 2)})
        if between:
            notices.append(f'{element.tag} {element.get("id")}: the times of {len(between)} '
                           'states are intervals and count as their middle')
        for signal in element.findall('signalSeries/signalState'):
            if signal.find('time/*') is None:
                signal.getparent().remove(signal)
                notices.append(f'{element.tag} {element.get("id")}: a signal state without a time '
                               'is ignored')
        for goal in element.findall('goalState'):
            if goal.find('time/*') is None:
                _set_time(goal, {'intervalStart': 0, 'intervalEnd': guard.MAX_TIME_STEP})
                notices.append(f'planning problem {element.get("id")}: its goal has no time and '
                               'may be reached at any')


def _mend_positions(root: etree._Element) -> None:
    """Write the outlines of lanelets as areas: commonroad-io knows lanelets in goals alone."""
    lanelets = {lanelet.get('id'): lanelet for lanelet in root.iterchildren('lanelet')}
    for element in root.iterchildren(*guard.OBSTACLE_TAGS):
        for reference in element.findall('.//position/lanelet'):
            lanelet = lanelets[reference.get('ref')]
            left, right = (lanelet.findall(f'{side}Bound/point') for side in ('left', 'right'))
            outline = etree.Element('polygon')
            outline.extend(copy.deepcopy(point) for point in (*right, *reversed(left)))
            reference.getparent().replace(reference, outline)


def _mend_stop_lines(root: etree._Element, notices: list[str]) -> None:
    """Drop the only point of a stop line: commonroad-io would look for a second one."""
    for line in root.iterfind('lanelet/stopLine'):
        points = line.findall('point')
        if len(points) == 1:
            line.remove(points[0])
            notices.append(f'lanelet {line.getparent().get("id")}: its stop line has one point '
                           'and counts as at the end of the lanelet')


def _complete_state(state: etree._Element) -> None:
    """Write 0 for a missing value in front of others, at which commonroad-io stops reading."""
    names = ('velocity', 'acceleration', 'yawRate', 'slipAngle')
    given = [state.find(name) is not None for name in names]
    for place, name in enumerate(names):
        if not given[place] and any(given[place:]):
            etree.SubElement(etree.SubElement(state, name), 'exact').text = '0'


def _mend_incomings(root: etree._Element, notices: list[str]) -> None:
    """Make ids of incomings unique; the guard has checked all other ids."""
    reserved = ids_of(node for node in root.iterchildren('*') if node.tag != 'intersection')
    inside = ids_of(root.iterfind('intersection//*[@id]'))
    renumber(root.findall('intersection'), reserved | inside, notices, reserved)


def _set_time(state: etree._Element, values: dict[str, int]) -> None:
    for time in state.findall('time'):
        state.remove(time)
    time = etree.SubElement(state, 'time')
    for tag, value in values.items():
        etree.SubElement(time, tag).text = str(value)
