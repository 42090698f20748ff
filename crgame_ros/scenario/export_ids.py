# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Ids that CommonRoad's schema accepts: positive, and unique within a file."""

from collections.abc import Collection, Iterable

from lxml import etree

_SIGNALS = {'trafficSignRef': 'trafficSign', 'trafficLightRef': 'trafficLight',
            'isLeftOf': 'incoming'}


class IdPool:
    """
    A source of ids that are unique within a file.

    :param notices: extended by remarks on elements that cannot keep their id.
    """

    def __init__(self, taken: set[int], notices: list[str]) -> None:
        self._taken = taken
        self._last = max((0, *taken))
        self._notices = notices

    def keep(self, number: int, name: str) -> int:
        """Return the id that an element had in the original, or a new one if that is taken."""
        if number > 0 and number not in self._taken:
            self._taken.add(number)
            self._last = max(self._last, number)
            return number
        fresh = self.fresh()
        self._notices.append(f'{name} has the id {fresh}, for {number} is '
                             + ('taken' if number > 0 else 'not positive'))
        return fresh

    def fresh(self) -> int:
        """Return an unused id."""
        self._last += 1
        self._taken.add(self._last)
        return self._last


def renumber(elements: Iterable[etree._Element], taken: set[int], notices: list[str],
             reserved: Collection[int] = ()) -> dict[int, int]:
    """
    Replace the ids of road elements that are not positive, or are in use by another element.

    References are updated. Incomings are referenced only within their intersection, so their ids
    are replaced within it only.

    :param elements: lanelets, traffic signs, traffic lights, intersections; changed in place.
    :param taken: ids of all other elements in the original; new ones are greater.
    :param notices: extended by remarks on renumbered elements.
    :param reserved: ids of other elements, which none of these may have.
    :return: ids of the lanelets in the file, by their previous ids.
    """
    elements = list(elements)
    used = set(reserved)
    pool = IdPool(set(taken), [])
    changed: dict[tuple[str, int, etree._Element | None], int] = {}
    lanelets: dict[int, int] = {}
    for element in elements:
        for node in (element, *element.iterchildren('incoming')):
            number = whole_number(node.get('id'))
            if number is None:
                continue
            new = number
            if number <= 0 or number in used:
                new = pool.fresh()
                changed[node.tag, number, element if node is not element else None] = new
                notices.append(f'{node.tag} {number} has the id {new}: the schema wants positive '
                               'ids, each of one element')
            used.add(new)
            node.set('id', str(new))
            if node.tag == 'lanelet':
                lanelets[number] = new
    for element in elements if changed else ():
        for reference in element.iterfind('.//*[@ref]'):
            kind = _SIGNALS.get(reference.tag, 'lanelet')
            scope = element if kind == 'incoming' else None
            number = whole_number(reference.get('ref'))
            if number is not None and (kind, number, scope) in changed:
                reference.set('ref', str(changed[kind, number, scope]))
    return lanelets


def whole_number(text: str | None) -> int | None:
    """Return the number in a text, of at most 18 digits; None if there is none."""
    try:
        number = int(text or '')
    except ValueError:
        return None
    return number if abs(number) < 10 ** 18 else None


def ids_of(elements: Iterable[etree._Element]) -> set[int]:
    """Return the ids of elements, without those that are no numbers."""
    return {number for element in elements
            if (number := whole_number(element.get('id'))) is not None}
