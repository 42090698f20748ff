# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Mends what converters get wrong, before the loader's own repairs, and thins the bounds out."""

from collections.abc import Iterable, Sequence
from copy import deepcopy
import math

from commonroad.scenario.traffic_sign import TrafficSignIDCountries
from crgame_ros.geometry.curve import arc_length
from crgame_ros.scenario.export_ids import IdPool, ids_of
from crgame_ros.worlds.opendrive import LightCycle
from lxml import etree
import numpy as np
from numpy.typing import NDArray
import shapely

FloatArray = NDArray[np.float64]

# Greatest distance of a bound from where it was [m]: converters write a point each half metre.
TOLERANCE = 0.01
# A light or sign farther from its lanelets than this is misplaced [m].
_FAR = 100.0
# A lanelet in parts: its bounds may turn so far in each before they could meet [rad].
_MOST_TURN = math.pi
_MOST_PARTS = 12
# The loader refuses bounds of more points that meet; those of fewer it mends where it uses them.
_MOST_POINTS = 150
# Of the length of a bound, if its points in the order of its chord make it shorter than this.
_FOLDED = 0.9
# A lane that begins beside the end of another, the other way round: at least so far from it [m],
# and turned by so much [rad].
_ASIDE, _BACK = 0.5, 2.0
_LIMIT_SIGNS = frozenset(kind.MAX_SPEED.value for kind in TrafficSignIDCountries.values()
                         if hasattr(kind, 'MAX_SPEED'))
# No limit is greater [m/s].
_MOST_LIMIT = 100.0
_SIDES = ('adjacentLeft', 'adjacentRight')


def mend_map(root: etree._Element, cycles: Sequence[LightCycle | None] | None,
             time_step_s: float) -> list[str]:
    """
    Mend a converted map.

    :param root: a CommonRoad 2020a document; changed in place.
    :param cycles: of the lights, in their order; None if the format has none: then they are off,
        since converters invent the same cycle for all lights of a junction.
    :param time_step_s: of the document.
    :return: remarks, one line each.
    """
    remarks: list[str] = []
    lanelets = {lanelet.get('id'): Bounds.of(lanelet) for lanelet in root.iterchildren('lanelet')}
    _drop_slivers(root, lanelets, remarks)
    _drop_turns(root, lanelets, remarks)
    before = sum(len(bounds.left) for bounds in lanelets.values())
    for bounds in lanelets.values():
        bounds.thin_out()
    after = sum(len(bounds.left) for bounds in lanelets.values())
    _cut_turning(root, lanelets, remarks)
    for bounds in lanelets.values():
        bounds.write()
    if after < before:
        remarks.append(f'the bounds have {after} points instead of {before}, none of them more '
                       f'than {TOLERANCE * 100:g} cm from where it was')
    _place_signs(root, lanelets, remarks)
    _set_cycles(root, cycles, time_step_s, remarks)
    _spread_limits(root)
    return remarks


class Bounds:
    """
    A lanelet with its bounds as arrays.

    :param element: of the document.
    :param left: (N, 2) or (N, 3) points [m]
    :param right: likewise, N as well.
    """

    def __init__(self, element: etree._Element, left: FloatArray, right: FloatArray) -> None:
        self.element, self.left, self.right = element, left, right

    @classmethod
    def of(cls, element: etree._Element) -> 'Bounds':
        """Read a lanelet's bounds; points in the wrong order are put right."""
        return cls(element, *(_unfolded(_points(element.find(f'{side}Bound')))
                              for side in ('left', 'right')))

    @property
    def center(self) -> FloatArray:
        """Return the centre line (N, 2) [m]."""
        return 0.5 * (self.left + self.right)[:, :2]

    @property
    def turn(self) -> float:
        """Return the angle between the extreme headings of the centre line [rad]."""
        steps = np.diff(self.center, axis=0)
        steps = steps[np.hypot(*steps.T) > 1e-6]
        headings = np.unwrap(np.arctan2(steps[:, 1], steps[:, 0]))
        return float(np.ptp(headings)) if len(headings) else 0.0

    @property
    def is_tangled(self) -> bool:
        """Return whether the bounds meet or cross."""
        ring = np.concatenate((self.right, self.left[::-1]))[:, :2]
        return len(ring) > 3 and not shapely.Polygon(ring).is_valid

    def thin_out(self) -> None:
        """Remove points without which both bounds stay where they are, to `TOLERANCE`."""
        self._drop_doubled()
        kept = np.zeros(len(self.left), dtype=bool)
        for bound in (self.left, self.right):
            kept |= _needed(bound[:, :2])
        self.left, self.right = self.left[kept], self.right[kept]

    def _drop_doubled(self) -> None:
        """Remove pairs of points that repeat the pair before; two pairs remain."""
        moved = [np.hypot(*np.diff(bound[:, :2], axis=0).T) > 1e-4
                 for bound in (self.left, self.right)]
        kept = np.concatenate(([True], moved[0] | moved[1]))
        if kept.sum() > 1:
            self.left, self.right = self.left[kept], self.right[kept]

    def write(self) -> None:
        """Write the bounds into the element."""
        for name, points in (('leftBound', self.left), ('rightBound', self.right)):
            bound = self.element.find(name)
            for point in bound.findall('point'):
                bound.remove(point)
            for at, values in enumerate(points.tolist()):
                point = etree.Element('point')
                for axis, value in zip('xyz', values, strict=False):
                    etree.SubElement(point, axis).text = f'{value:.4f}'
                bound.insert(at, point)

    def cut(self, parts: int, numbers: Sequence[str]) -> list['Bounds']:
        """
        Return the lanelet in parts of equal length, with the same signs and neighbours.

        :param numbers: ids of the parts.
        """
        along = arc_length(self.center)
        ends = np.interp(np.linspace(0.0, along[-1], parts + 1), along, np.arange(len(along)))
        made = []
        for start, end, number in zip(ends[:-1], ends[1:], numbers, strict=True):
            at = np.unique(np.concatenate((
                [start], np.arange(math.floor(start) + 1, math.ceil(end)), [end])))
            element = deepcopy(self.element)
            element.set('id', number)
            rows = np.arange(len(along))
            made.append(Bounds(element, *(
                np.stack([np.interp(at, rows, column) for column in bound.T], axis=-1)
                for bound in (self.left, self.right))))
        return made


def _points(bound: etree._Element) -> FloatArray:
    return np.array([[float(value.text) for value in point] for point in bound.iter('point')])


def _unfolded(points: FloatArray) -> FloatArray:
    """Return a bound, ordered along its chord if it folds: a converter adds points backwards."""
    along = (points - points[0]) @ (points[-1] - points[0])
    other = points[np.argsort(along, kind='stable')]
    return other if _length(other) < _FOLDED * _length(points) else points


def _length(points: FloatArray) -> float:
    return float(np.hypot(*np.diff(points[:, :2], axis=0).T).sum())


def _needed(line: FloatArray) -> NDArray[np.bool_]:
    """Return which points a line needs to stay within `TOLERANCE`."""
    simple = shapely.get_coordinates(shapely.simplify(
        shapely.LineString(line), TOLERANCE, preserve_topology=False))
    kept = np.zeros(len(line), dtype=bool)
    kept[[0, -1]] = True
    at = 0
    for point in simple:
        # The points are in the order of the line.
        at += int(np.argmax((line[at:] == point).all(axis=1)))
        kept[at] = True
    return kept


def _drop_slivers(root: etree._Element, lanelets: dict[str, Bounds], remarks: list[str]) -> None:
    """Remove lanelets without length or width; their neighbours are linked past them."""
    gone = {number for number, bounds in lanelets.items()
            if len(bounds.left) != len(bounds.right) or len(bounds.left) < 2
            or _length(bounds.center) < 0.01
            or np.hypot(*(bounds.left - bounds.right)[:, :2].T).max() < 0.05}
    if not gone:
        return
    for number in gone:
        bounds = lanelets.pop(number)
        before, after = ([link.get('ref') for link in bounds.element.iterchildren(tag)]
                         for tag in ('predecessor', 'successor'))
        for ends, tag, others in ((before, 'successor', after), (after, 'predecessor', before)):
            for end in ends:
                if end in lanelets:
                    _relink(lanelets[end].element, tag, number, others)
        root.remove(bounds.element)
    _drop_links(root, gone)
    remarks.append(f'{len(gone)} lanelets without length or width are left out')


def _drop_turns(root: etree._Element, lanelets: dict[str, Bounds], remarks: list[str]) -> None:
    """Remove links to a lane beside a lane's end, the other way round."""
    pairs = set()
    for number, bounds in lanelets.items():
        pairs |= {(number, link.get('ref')) for link in bounds.element.iterchildren('successor')}
        pairs |= {(link.get('ref'), number) for link in bounds.element.iterchildren('predecessor')}
    gone = {pair for pair in pairs if pair[0] in lanelets and pair[1] in lanelets
            and _is_turn(lanelets[pair[0]].center, lanelets[pair[1]].center)}
    for before, after in gone:
        _relink(lanelets[before].element, 'successor', after, ())
        _relink(lanelets[after].element, 'predecessor', before, ())
    known = {pair for pair in pairs if pair not in gone}
    for incoming in root.iterfind('intersection/incoming'):
        lanes = [each.get('ref') for each in incoming.iterchildren('incomingLanelet')]
        for tag in ('successorsRight', 'successorsStraight', 'successorsLeft'):
            for link in incoming.findall(tag):
                if not any((lane, link.get('ref')) in known for lane in lanes):
                    incoming.remove(link)
    if gone:
        remarks.append(f'{len(gone)} links would make vehicles turn on the spot and are left out')


def _is_turn(before: FloatArray, after: FloatArray) -> bool:
    end, start = before[-1] - before[-2], after[1] - after[0]
    turn = abs(math.atan2(end[0] * start[1] - end[1] * start[0], float(end @ start)))
    return turn > _BACK and float(np.hypot(*(after[0] - before[-1]))) > _ASIDE


def _relink(element: etree._Element, tag: str, old: str, new: Iterable[str]) -> None:
    """Replace a link of a lanelet by links to others."""
    for link in element.findall(f'{tag}[@ref="{old}"]'):
        at = element.index(link)
        element.remove(link)
        for number in new:
            if not element.findall(f'{tag}[@ref="{number}"]'):
                element.insert(at, etree.Element(tag, ref=number))


def _drop_links(root: etree._Element, gone: set[str]) -> None:
    for parent in root.iterchildren('lanelet', 'intersection'):
        for link in parent.findall('.//*[@ref]'):
            if link.get('ref') in gone and not link.tag.startswith('traffic'):
                link.getparent().remove(link)


def _cut_turning(root: etree._Element, lanelets: dict[str, Bounds], remarks: list[str]) -> None:
    """Cut lanelets that turn so far that they meet themselves, with all beside them."""
    parts: dict[str, int] = {}
    for number, bounds in lanelets.items():
        if number in parts or not bounds.is_tangled:
            continue
        count = max(math.ceil(bounds.turn / _MOST_TURN),
                    math.ceil(len(bounds.left) / _MOST_POINTS))
        if count > 1:
            group = _beside(number, lanelets)
            count = min(count + 1, _MOST_PARTS)
            parts |= dict.fromkeys(group, count)
    if not parts:
        return
    ids = IdPool(ids_of(root.iter('*')), [])
    numbers = {number: [number, *(str(ids.fresh()) for _ in range(count - 1))]
               for number, count in parts.items()}
    for number, count in parts.items():
        bounds = lanelets.pop(number)
        made = bounds.cut(count, numbers[number])
        for at, part in enumerate(made):
            _link_part(part.element, at, numbers)
            bounds.element.addprevious(part.element)
            lanelets[part.element.get('id')] = part
        root.remove(bounds.element)
    # Whatever begins at the end of a lanelet in parts begins at the end of its last part, and
    # junctions too.
    for lanelet in root.iterchildren('lanelet'):
        for link in lanelet.findall('predecessor'):
            chain = numbers.get(link.get('ref'))
            if chain is not None and lanelet.get('id') not in chain[1:]:
                link.set('ref', chain[-1])
    for incoming in root.iterfind('intersection/incoming/incomingLanelet'):
        incoming.set('ref', numbers.get(incoming.get('ref'), [incoming.get('ref')])[-1])
    remarks.append(f'{len(parts)} lanelets that meet themselves are cut into '
                   f'{sum(parts.values())} parts')


def _beside(number: str, lanelets: dict[str, Bounds]) -> list[str]:
    """Return a lanelet and all that lie beside it, directly or not."""
    found = [number]
    for each in found:
        found += [ref for tag in _SIDES for link in lanelets[each].element.iterchildren(tag)
                  if (ref := link.get('ref')) in lanelets and ref not in found]
    return found


def _link_part(element: etree._Element, at: int, numbers: dict[str, list[str]]) -> None:
    """Link part `at` of a lanelet to the parts before and after it and beside it."""
    chain = next(chain for chain in numbers.values() if element.get('id') in chain)
    for tag, other in (('predecessor', at - 1), ('successor', at + 1)):
        if 0 <= other < len(chain):
            links = element.findall(tag)
            place = element.index(links[0]) if links else 2 + (tag == 'successor') * len(
                element.findall('predecessor'))
            for link in links:
                element.remove(link)
            element.insert(place, etree.Element(tag, ref=chain[other]))
    for tag in _SIDES:
        for link in element.findall(tag):
            beside = numbers[link.get('ref')]
            same = link.get('drivingDir') == 'same'
            link.set('ref', beside[at if same else len(beside) - 1 - at])
    if at < len(chain) - 1:
        # A light holds vehicles at the end of a lanelet, with or without a line.
        for line in element.findall('stopLine') + element.findall('trafficLightRef'):
            element.remove(line)


def _place_signs(root: etree._Element, lanelets: dict[str, Bounds], remarks: list[str]) -> None:
    """Remove positions of lights and signs far from their lanelets, where they are drawn then."""
    for tag in ('trafficLight', 'trafficSign'):
        users: dict[str, list[Bounds]] = {}
        for bounds in lanelets.values():
            for reference in bounds.element.iter(f'{tag}Ref'):
                users.setdefault(reference.get('ref'), []).append(bounds)
        count = 0
        for element in root.iterchildren(tag):
            position = element.find('position')
            near = users.get(element.get('id'), [])
            if position is not None and near and not _is_near(position, near):
                element.remove(position)
                count += 1
        if count:
            remarks.append(f'{count} positions of {tag} elements more than {_FAR:g} m from their '
                           'lanelets are ignored')


def _is_near(position: etree._Element, lanelets: Sequence[Bounds]) -> bool:
    point = [float(position.findtext(f'.//{axis}', 'nan')) for axis in 'xy']
    return any(np.hypot(*(bounds.center - point).T).min() <= _FAR for bounds in lanelets)


def _set_cycles(root: etree._Element, cycles: Sequence[LightCycle | None] | None,
                time_step_s: float, remarks: list[str]) -> None:
    lights = sorted(root.iterchildren('trafficLight'), key=lambda light: int(light.get('id')))
    if not lights:
        return
    if cycles is not None and len(cycles) != len(lights):
        remarks.append(f'{len(cycles)} lights have programs, {len(lights)} were converted')
        cycles = None
    off = 0
    for light, cycle in zip(lights, cycles or [None] * len(lights), strict=True):
        for old in light.findall('cycle') + light.findall('active'):
            light.remove(old)
        made = etree.Element('cycle')
        off += cycle is None
        for duration, colour in cycle or [(time_step_s, 'inactive')]:
            element = etree.SubElement(made, 'cycleElement')
            etree.SubElement(element, 'duration').text = str(max(1, round(duration / time_step_s)))
            etree.SubElement(element, 'color').text = colour
        light.insert(0, made)
    if off:
        remarks.append(f'{off} of {len(lights)} lights have no program in the file and are off: '
                       'give each a cycle to use them')


def _spread_limits(root: etree._Element) -> None:
    """
    Let limits hold until the next one: converters write a sign only where the limit changes.

    Signs with more than any limit, which mark the end of one, are removed afterwards.
    """
    limits = {sign.get('id'): float(sign.findtext('.//additionalValue', 'nan'))
              for sign in root.iterchildren('trafficSign')
              if sign.findtext('.//trafficSignID') in _LIMIT_SIGNS}
    lanelets = {lanelet.get('id'): lanelet for lanelet in root.iterchildren('lanelet')}
    own = {number: next((ref for each in lanelet.iterchildren('trafficSignRef')
                         if (ref := each.get('ref')) in limits), None)
           for number, lanelet in lanelets.items()}
    waiting = [number for number, sign in own.items() if sign is not None]
    for number in waiting:
        for link in lanelets[number].iterchildren('successor'):
            after = link.get('ref')
            if after in own and own[after] is None:
                own[after] = own[number]
                _insert_reference(lanelets[after], own[number] or '')
                waiting.append(after)
    ends = {sign for sign, limit in limits.items() if not limit < _MOST_LIMIT}
    for parent in (*lanelets.values(), *root.iterchildren('trafficSign')):
        for reference in parent.findall('.//trafficSignRef'):
            if reference.get('ref') in ends:
                reference.getparent().remove(reference)
    for sign in root.findall('trafficSign'):
        if sign.get('id') in ends:
            root.remove(sign)


def _insert_reference(lanelet: etree._Element, sign: str) -> None:
    """Add a reference to a sign where the schema wants it: before those to lights."""
    light = lanelet.find('trafficLightRef')
    reference = etree.Element('trafficSignRef', ref=sign)
    if light is None:
        lanelet.append(reference)
    else:
        light.addprevious(reference)
