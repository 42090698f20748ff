# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Prepares Lanelet2 maps, also Autoware's, for the converter, which reads one dialect of them."""

from itertools import count
import re

from crgame_ros.errors import InputError
from lxml import etree
import numpy as np
from numpy.typing import NDArray

_LIMIT = re.compile(r'(\d+(?:\.\d+)?)\s*(km/?h|kmh|mph|m/s)?')
# A sign of Germany's in Lanelet2's words: de274-60.
_SIGN = re.compile(r'de274-(\d+)')
_TO_METRES_A_SECOND = {'mph': 0.44704, 'm/s': 1.0}
_KMH = 1.0 / 3.6
# A bound is far longer than the other from this factor on, beyond so many metres.
_FAR_LONGER, _LONGER = 2.5, 10.0

FloatArray = NDArray[np.float64]
# WGS 84: semi-major axis [m] and flattening.
_RADIUS, _FLATTENING = 6378137.0, 1.0 / 298.257223563


def prepare_lanelet2(root: etree._Element, source: str) -> list[str]:
    """
    Change a map such that the converter reads it, and its coordinates become metres.

    Positions are `local_x` and `local_y` where every node has them, as Autoware writes them;
    otherwise they are those in the plane that touches the earth in the middle of the map.

    :param root: of the map; changed in place.
    :param source: the file, for messages.
    :return: remarks, one line each.
    :raises InputError: if the nodes have no positions.
    """
    positions, remark = _place_nodes(root, source)
    return [remark, *_drop_unequal(root, positions), *_write_limits(root)]


def _tag(element: etree._Element, key: str) -> str | None:
    found = element.find(f'tag[@k="{key}"]')
    return None if found is None else found.get('v')


def _set_tag(element: etree._Element, key: str, value: str) -> None:
    for old in element.findall(f'tag[@k="{key}"]'):
        element.remove(old)
    etree.SubElement(element, 'tag', k=key, v=value)


def _place_nodes(root: etree._Element, source: str) -> tuple[dict[str, FloatArray], str]:
    """Write positions that the converter keeps; return them [m], by node, and a remark."""
    nodes = root.findall('node')
    local = _numbers([(_tag(node, 'local_x'), _tag(node, 'local_y')) for node in nodes])
    degrees = _numbers([(node.get('lat'), node.get('lon')) for node in nodes])
    if nodes and np.isfinite(local).all():
        positions, remark = local, 'positions are local_x and local_y'
    elif nodes and np.isfinite(degrees).all():
        positions = tangent_plane(degrees)
        middle = 0.5 * (degrees.min(axis=0) + degrees.max(axis=0))
        remark = f'positions are metres from {middle[0]:.6f} N, {middle[1]:.6f} E'
    else:
        raise InputError('its nodes have neither latitude and longitude nor local_x and local_y',
                         source, 'export the map with one of them')
    for node, (latitude, longitude) in zip(nodes, mercator_degrees(positions), strict=True):
        node.set('lat', f'{latitude:.13f}')
        node.set('lon', f'{longitude:.13f}')
    # The converter fails where some nodes have a height, and others 0 or none.
    heights = [_tag(node, 'ele') for node in nodes]
    values = _numbers([(height, '0') for height in heights])[:, 0]
    if not (np.isfinite(values) & (values != 0.0)).all():
        for node in nodes:
            for height in node.findall('tag[@k="ele"]'):
                node.remove(height)
    return {node.get('id', ''): position
            for node, position in zip(nodes, positions, strict=True)}, remark


def _drop_unequal(root: etree._Element, positions: dict[str, FloatArray]) -> list[str]:
    """Remove lanelets of which one bound is far longer; the converter would fail on them all."""
    lengths = {way.get('id'): float(np.hypot(*np.diff(np.reshape([
        positions[node.get('ref', '')] for node in way.iterchildren('nd')
        if node.get('ref') in positions], (-1, 2)), axis=0).T).sum())
        for way in root.iterchildren('way')}
    gone = []
    for lanelet in root.findall('relation'):
        bounds = [lengths[ref] for member in lanelet.iterchildren('member')
                  if member.get('role') in ('left', 'right')
                  and (ref := member.get('ref')) in lengths]
        if _tag(lanelet, 'type') == 'lanelet' and len(bounds) == 2 \
                and max(bounds) > _FAR_LONGER * min(bounds) + _LONGER:
            gone.append(lanelet.get('id', ''))
            root.remove(lanelet)
    return [f'lanelets with one bound far longer than the other are left out: {len(gone)}, '
            f'the first {gone[0]}'] if gone else []


def _numbers(words: list[tuple[str | None, str | None]]) -> FloatArray:
    """Return pairs of numbers (N, 2), NaN for what is none."""
    def number(word: str | None) -> float:
        try:
            return float(word or 'nan')
        except ValueError:
            return np.nan
    return np.array([[number(first), number(second)] for first, second in words]).reshape(-1, 2)


def _write_limits(root: etree._Element) -> list[str]:
    """Write all speed limits as the converter reads them: as regulatory elements, in m/s."""
    gone = set()
    for element in root.findall('relation'):
        kind = _tag(element, 'type'), _tag(element, 'subtype')
        if kind == ('regulatory_element', 'speed_limit'):
            limit = _speed(_tag(element, 'sign_type') or '')
            if limit is None:
                gone.add(element.get('id'))
                root.remove(element)
            else:
                _set_tag(element, 'sign_type', limit)
    ids = count(1 + max((int(element.get('id')) for element in root.iter('node', 'way', 'relation')
                         if (element.get('id') or '').isdecimal()), default=0))
    written: dict[str, str] = {}
    for lanelet in root.findall('relation'):
        limit = _speed(_tag(lanelet, 'speed_limit') or '')
        if _tag(lanelet, 'type') != 'lanelet' or limit is None:
            continue
        if limit not in written:
            written[limit] = str(next(ids))
            element = etree.SubElement(root, 'relation', id=written[limit])
            for key, value in (('type', 'regulatory_element'), ('subtype', 'speed_limit'),
                               ('sign_type', limit)):
                _set_tag(element, key, value)
        etree.SubElement(lanelet, 'member', type='relation', role='regulatory_element',
                         ref=written[limit])
    return [f'{len(gone)} speed limits without a value are left out'] if gone else []


def _speed(text: str) -> str | None:
    """Return a speed limit as text [m/s]; None if it is none."""
    sign = _SIGN.search(text)
    if sign is not None:
        return repr(int(sign[1]) * _KMH)
    found = _LIMIT.fullmatch(text.strip())
    return None if found is None else repr(
        float(found[1]) * _TO_METRES_A_SECOND.get(found[2] or '', _KMH))


def tangent_plane(degrees: FloatArray) -> FloatArray:
    """
    Return positions on the ellipsoid in the plane that touches it in their middle.

    Distances are true to a part in a million within 5 km of the middle.

    :param degrees: (N, 2) latitude and longitude [deg] by WGS 84
    :return: (N, 2) east and north of the middle [m]
    """
    middle = 0.5 * (degrees.min(axis=0) + degrees.max(axis=0))
    latitude, longitude = np.radians(middle)
    east = np.array([-np.sin(longitude), np.cos(longitude), 0.0])
    up = np.array([np.cos(latitude) * np.cos(longitude), np.cos(latitude) * np.sin(longitude),
                   np.sin(latitude)])
    offsets = _geocentric(degrees) - _geocentric(middle[None])
    return np.stack((offsets @ east, offsets @ np.cross(up, east)), axis=-1)


def _geocentric(degrees: FloatArray) -> FloatArray:
    """Return the Cartesian coordinates (N, 3) of points on the ellipsoid [m]."""
    latitude, longitude = np.radians(degrees).T
    eccentricity = _FLATTENING * (2.0 - _FLATTENING)
    normal = _RADIUS / np.sqrt(1.0 - eccentricity * np.sin(latitude) ** 2)
    return np.stack((normal * np.cos(latitude) * np.cos(longitude),
                     normal * np.cos(latitude) * np.sin(longitude),
                     normal * (1.0 - eccentricity) * np.sin(latitude)), axis=-1)


def mercator_degrees(positions: FloatArray) -> FloatArray:
    """
    Return the latitude and longitude that web Mercator (EPSG:3857) maps to given positions.

    Converters project with it, which stretches a town at 50 degrees north by half. Positions of a
    plane with true distances, disguised as places near the origin of latitudes and longitudes,
    pass their projection unchanged.

    :param positions: (N, 2) [m]
    :return: (N, 2) latitude and longitude [deg]
    """
    x, y = positions.T / _RADIUS
    return np.degrees(np.stack((2.0 * np.arctan(np.exp(y)) - 0.5 * np.pi, x), axis=-1))
