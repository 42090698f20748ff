# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Maps as OpenDRIVE for the converter: prepared, or made of SUMO networks and OpenStreetMap."""

from collections.abc import Callable, Iterable
import itertools
import math
from pathlib import Path

from crgame_ros.errors import CrgameError
from crgame_ros.worlds.environments import run_converter, SUMO_TOOLS
from lxml import etree

# Elements with ids, and where else these ids stand: (element, attribute, condition).
_REFERENCES = {
    'road': (('connection', 'incomingRoad'), ('connection', 'connectingRoad'),
             ('connection', 'linkedRoad')),
    'junction': (('road', 'junction'),),
    'signal': (('signalReference', 'id'), ('control', 'signalId')),
    'object': (('objectReference', 'id'),)}
# Of static signals: the converter fails on other countries' (some are written in two letters).
_COUNTRIES = {'DE': 'DEU', 'US': 'USA', 'CN': 'CHN', 'ES': 'ESP'}
_KNOWN = frozenset({*_COUNTRIES, *_COUNTRIES.values(), 'ZAM', 'OPENDRIVE'})
_NO_ROAD = '-1'
# A curve over 100 m with less deviates by a millimetre from a line or an arc [1/m].
_SAME_CURVATURE = 1e-7
_SAME_POINT = 0.01
# The limit of lanes without one, for the converter [km/h].
NO_LIMIT = 999.0
# SUMO's letters for the states of a light (its documentation, Simulation/Traffic_Lights).
_COLOURS = {'G': 'green', 'g': 'green', 's': 'green', 'y': 'yellow', 'Y': 'yellow', 'r': 'red',
            'u': 'redYellow', 'o': 'inactive', 'O': 'inactive'}
# As SUMO's documentation recommends for OpenStreetMap (Networks/Import/OpenStreetMap).
_OSM_OPTIONS = ('--geometry.remove', '--ramps.guess', '--junctions.join', '--roundabouts.guess',
                '--tls.guess-signals', '--tls.discard-simple', '--tls.join',
                '--tls.default-type', 'static', '--keep-edges.by-vclass', 'passenger',
                '--remove-edges.isolated', '--output.street-names')
# Nobody turns round on the spot, and limits are those of the roads in turns as well.
_OPTIONS = ('--no-turnarounds', '--junctions.limit-turn-speed', '-1')
# The cycle of a light: durations [s] and colours of CommonRoad.
LightCycle = list[tuple[float, str]]


def prepare_opendrive(root: etree._Element) -> list[str]:
    """
    Change a map such that the converter reads it, and its coordinates stay metres.

    :param root: of the map; changed in place.
    :return: remarks on what is lost, one line each.
    """
    _keep_coordinates(root)
    _number_ids(root)
    _plain_curves(root)
    _connect_directly(root)
    _limit_lanes(root)
    return _four_corners(root) + _changes_of_limits(root) + _drop_foreign_signals(root)


def _keep_coordinates(root: etree._Element) -> None:
    """Remove what would make the converter project the map: web Mercator stretches it."""
    for header in root.iterchildren('header'):
        for element in header.findall('geoReference') + header.findall('offset'):
            header.remove(element)


def _number_ids(root: etree._Element) -> None:
    """Replace ids that are no numbers; the standard allows any text."""
    for tag, references in _REFERENCES.items():
        named = [element for element in root.iter(tag) if element.get('id') is not None]
        others = [(element, name) for kind, name in references for element in root.iter(kind)]
        if tag in ('road', 'junction'):
            others += [(element, 'elementId') for link in root.iterfind('road/link')
                       for element in link if element.get('elementType') == tag]
        words = [element.get('id') for element in named] + [
            element.get(name) for element, name in others]
        if all(_is_number(word) for word in words if word is not None):
            continue
        numbers = {word: str(number) for number, word in enumerate(dict.fromkeys(
            word for word in words if word not in (None, _NO_ROAD)), 1)}
        for element, name in [(element, 'id') for element in named] + others:
            word = element.get(name)
            if word in numbers:
                element.set(name, numbers[word])


def _is_number(word: str) -> bool:
    return word.removeprefix('-').isdecimal()


def _plain_curves(root: etree._Element) -> None:
    """Write spirals of constant curvature as arcs, and arcs without curvature as lines."""
    for spiral in list(root.iter('spiral')):
        start, end = (float(spiral.get(name, 'nan')) for name in ('curvStart', 'curvEnd'))
        if abs(start - end) < _SAME_CURVATURE:
            spiral.getparent().replace(spiral, etree.Element('arc', curvature=repr(start)))
    for arc in list(root.iter('arc')):
        if abs(float(arc.get('curvature', 'nan'))) < _SAME_CURVATURE:
            arc.getparent().replace(arc, etree.Element('line'))


def _connect_directly(root: etree._Element) -> None:
    """Name the road that a direct junction links as the one that leads through it."""
    for connection in root.iterfind('junction/connection'):
        if connection.get('connectingRoad') is None and connection.get('linkedRoad') is not None:
            connection.set('connectingRoad', connection.get('linkedRoad'))


def _limit_lanes(root: etree._Element) -> None:
    """
    Give every lane a speed limit in km/h: its own, or that of its road, or else `NO_LIMIT`.

    The converter overlooks limits in m/s, and all changes of limits after a lane without one.
    """
    for road in root.iterchildren('road'):
        types = [(float(kind.get('s', '0')), limit) for kind in road.iterchildren('type')
                 if (limit := _kmh(kind.find('speed'))) is not None]
        for section in road.iterfind('lanes/laneSection'):
            start = float(section.get('s', '0'))
            # A type holds from its start on; some maps begin the first one too late.
            here = [limit for at, limit in types if at <= start + 1e-3] or [
                limit for _, limit in types[:1]]
            for lane in section.iterfind('*/lane'):
                limit = _kmh(lane.find('speed')) or (here[-1] if here else NO_LIMIT)
                for speed in lane.findall('speed'):
                    lane.remove(speed)
                etree.SubElement(lane, 'speed', sOffset='0', max=repr(limit), unit='km/h')


def _changes_of_limits(root: etree._Element) -> list[str]:
    """Tell where limits change between roads or sections, which the converter joins to a lane."""
    ends: dict[str | None, tuple[set[str], set[str]]] = {}
    count = 0
    for road in root.iterchildren('road'):
        sections = [{speed.get('max', '') for speed in section.iterfind('*/lane/speed')}
                    for section in road.iterfind('lanes/laneSection')]
        count += sum(before != after for before, after in itertools.pairwise(sections))
        if sections:
            ends[road.get('id')] = sections[0], sections[-1]
    for road in root.iterchildren('road'):
        after = road.find('link/successor')
        if after is not None and after.get('elementType') == 'road' \
                and road.get('id') in ends and after.get('elementId') in ends:
            first = 0 if after.get('contactPoint') == 'start' else 1
            count += ends[road.get('id')][1] != ends[after.get('elementId')][first]
    return [f'limits change at {count} places between roads or their sections; where the '
            'converter joins these to one lane, its first limit holds'] if count else []


def _kmh(speed: etree._Element | None) -> float | None:
    """Return a limit [km/h]; None without one. Without a unit it is in m/s."""
    if speed is None or not _is_float(speed.get('max', '')):
        return None
    factor = {'km/h': 1.0, 'mph': 1.609344}.get(speed.get('unit', ''), 3.6)
    return float(speed.get('max')) * factor or None


def _four_corners(root: etree._Element) -> list[str]:
    """
    Give each crosswalk an outline of four corners in its own axes; the converter reads no other.

    The road counts as straight along the crosswalk.
    """
    gone = []
    for crosswalk in root.iterfind('road/objects/object[@type="crosswalk"]'):
        corners = _corners(crosswalk)
        for outline in crosswalk.findall('outline') + crosswalk.findall('outlines'):
            crosswalk.remove(outline)
        if corners is None:
            gone.append(crosswalk)
            continue
        outline = etree.SubElement(crosswalk, 'outline')
        for u, v in corners:
            etree.SubElement(outline, 'cornerLocal', u=repr(u), v=repr(v), z='0', height='0')
    _remove(gone)
    return [f'{len(gone)} crosswalks without four corners are left out'] if gone else []


def _corners(crosswalk: etree._Element) -> list[tuple[float, float]] | None:
    """Return the corners of a crosswalk in its own axes [m]; None if they are not four."""
    def number(element: etree._Element, name: str) -> float:
        return float(element.get(name, 'nan'))

    heading = float(crosswalk.get('hdg', '0'))
    cosine, sine = math.cos(heading), math.sin(heading)
    found = [(number(corner, 'u'), number(corner, 'v'))
             for corner in crosswalk.iter('cornerLocal')]
    for corner in crosswalk.iter('cornerRoad'):
        along, aside = (number(corner, name) - number(crosswalk, name) for name in 'st')
        found.append((along * cosine + aside * sine, aside * cosine - along * sine))
    if not found:
        u, v = (0.5 * number(crosswalk, name) for name in ('length', 'width'))
        found = [(-u, -v), (u, -v), (u, v), (-u, v)]
    if len(found) > 1 and math.dist(found[0], found[-1]) < _SAME_POINT:
        found.pop()
    return found if len(found) == 4 and all(map(math.isfinite, sum(found, ()))) else None


def _drop_foreign_signals(root: etree._Element) -> list[str]:
    """Remove signs without a type or of a country whose signs the converter does not know."""
    gone = [signal for signal in root.iter('signal') if not _is_kept(signal)]
    remarks = []
    if gone:
        kinds = sorted({f'{signal.get("country", "no country")} {signal.get("type", "no type")}'
                        for signal in gone})
        remarks.append(f'{len(gone)} signs of no known country or type are left out: '
                       + ', '.join(kinds[:5]))
    _remove(gone)
    kept = {signal.get('id') for signal in root.iter('signal')}
    _remove(reference for reference in list(root.iter('signalReference'))
            if reference.get('id') not in kept)
    return remarks


def _is_kept(signal: etree._Element) -> bool:
    """Return whether the converter knows a signal; complete what it needs of it."""
    country = signal.get('country', 'ZAM').upper()
    signal.set('country', _COUNTRIES.get(country, country))
    signal.set('subtype', signal.get('subtype', '-1'))
    if signal.get('orientation') not in ('+', '-', 'none'):
        signal.set('orientation', 'none')
    if not _is_float(signal.get('value', '-1')):
        del signal.attrib['value']
    if signal.get('dynamic') == 'yes':
        # Its country means nothing to the converter.
        signal.set('country', 'ZAM')
        return signal.get('type') is not None
    signal.set('dynamic', 'no')
    return country in _KNOWN and signal.get('type') not in (None, '', 'none', '-1')


def _is_float(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True


def _remove(elements: Iterable[etree._Element]) -> None:
    for element in elements:
        element.getparent().remove(element)


def to_opendrive(source: Path, is_osm: bool, folder: Path, timeout_s: float,
                 say: Callable[[str], object]) -> Path:
    """
    Convert a network or an extract to OpenDRIVE.

    :param source: the file; of a network the turns on the spot have to be gone already.
    :param folder: for the files; it gets `map.xodr` and `map.net.xml`.
    :param say: called with a line if SUMO's programs have to be installed.
    :return: the OpenDRIVE file.
    :raises InputError: if netconvert cannot read the file.
    """
    program = SUMO_TOOLS.program('netconvert', say)
    given = ['--osm-files', str(source), *_OSM_OPTIONS] if is_osm else ['-s', str(source)]
    if is_osm:
        types = next(program.parent.parent.glob('lib/*/site-packages/**/typemap/osmNetconvert.typ'
                                                '.xml'), None)
        if types is None:
            raise CrgameError(f'{program}: has no osmNetconvert.typ.xml; remove its environment')
        given += ['--type-files', str(types)]
    out = folder / 'map.xodr'
    run_converter([str(program), *given, *_OPTIONS, '--opendrive-output', str(out),
                   '--output-file', str(folder / 'map.net.xml')], folder,
                  f'{source}: netconvert', timeout_s)
    return out


def without_turns(network: etree._Element) -> etree._Element:
    """Return a network without its links for turning round on the spot, as at each junction."""
    for connection in list(network.iterchildren('connection')):
        if connection.get('dir') == 't':
            network.remove(connection)
    return network


def light_cycles(opendrive: etree._Element, network: etree._Element) -> list[LightCycle | None]:
    """
    Return the program of each light, which SUMO's OpenDRIVE leaves out.

    :param opendrive: the map as netconvert wrote it: its signals are named JUNCTION_LINK.
    :param network: the network, with the programs.
    :return: of the dynamic signals in the order of the map; None without a program.
    """
    programs: dict[str | None, list[tuple[float, str]]] = {}
    for logic in network.iterchildren('tlLogic'):
        # The first program of a junction runs.
        programs.setdefault(logic.get('id'), [
            (float(phase.get('duration')), phase.get('state')) for phase in logic.iter('phase')])
    return [_cycle(programs, signal.get('id') or '') for signal in opendrive.iter('signal')
            if signal.get('dynamic') == 'yes']


def _cycle(programs: dict[str | None, list[tuple[float, str]]], name: str) -> LightCycle | None:
    junction, _, link = name.rpartition('_')
    phases = programs.get(junction)
    if not phases or not link.isdecimal() or int(link) >= min(len(s) for _, s in phases):
        return None
    cycle: LightCycle = []
    for duration, states in phases:
        colour = _COLOURS.get(states[int(link)], 'inactive')
        if cycle and cycle[-1][1] == colour:
            cycle[-1] = (cycle[-1][0] + duration, colour)
        else:
            cycle.append((duration, colour))
    return cycle
