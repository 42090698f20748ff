# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The page about the elements of CommonRoad: complete by the schema, and its notes are real."""

from collections import Counter
from pathlib import Path
import re
from typing import NamedTuple

import commonroad
from crgame_ros.errors import InputError
from crgame_ros.scenario.loading import parse_scenario
from lxml import etree
import pytest

PAGE = Path(__file__).resolve().parents[2] / 'docs' / 'commonroad_support.md'
SCHEMA = Path(commonroad.__path__[0]) / 'scenario_definition' / 'xml_definition_files' \
    / 'XML_commonRoad_XSD.xsd'
XS = '{http://www.w3.org/2001/XMLSchema}'
COLUMNS = ['Name', 'Loading', 'Map and 3D', 'Simulation', 'Planners', 'Export', 'Note']
CODE = re.compile('`([^`]+)`')
QUOTES = re.compile('(?:(start|export|refused): )?("[^"]*"(?:, "[^"]*")*)')


class Section(NamedTuple):
    """The types of a section, and the rows of its table as cells."""

    types: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]


def sections() -> list[Section]:
    """Read the page."""
    found = []
    for part in re.split('^## ', PAGE.read_text(encoding='utf-8'), flags=re.MULTILINE)[1:]:
        lines = [line.strip('| ').split(' | ') for line in part.splitlines()
                 if line.startswith('| ')]
        assert lines[0] == COLUMNS
        found.append(Section(tuple(CODE.findall(part.partition('\n')[0])),
                             tuple(tuple(line) for line in lines[1:])))
    return found


def schema_types() -> dict[str, set[str]]:
    """Return the elements and attributes in each type of the schema, attributes with @."""
    schema = etree.parse(str(SCHEMA)).getroot()
    types = [*schema.findall(f'{XS}complexType'), schema.find(f'{XS}element')]
    return {kind.get('name'): {
        ('@' if node.tag == f'{XS}attribute' else '') + node.get('name')
        for node in kind.iterdescendants(f'{XS}element', f'{XS}attribute')} for kind in types}


def quotes(prefix: str) -> set[str]:
    """Return the lines that the notes quote: of loading without a prefix, or of another kind."""
    return {quote for section in sections() for row in section.rows
            for kind, many in QUOTES.findall(row[-1]) if kind == prefix
            for quote in re.findall('"([^"]*)"', many)}


def test_every_type_of_the_schema_has_one_section() -> None:
    """All complex types, the root, and nothing else."""
    named = Counter(kind for section in sections() for kind in section.types)
    assert named == Counter(list(schema_types()))


@pytest.mark.parametrize('section', sections(), ids=lambda section: section.types[0])
def test_a_section_names_all_that_its_types_have_and_nothing_else(section: Section) -> None:
    """Each element and attribute is in one row; rows have a cell in each column."""
    types = schema_types()
    named = Counter(name for row in section.rows for name in CODE.findall(row[0]))
    assert named == Counter(set().union(*(types[kind] for kind in section.types)))
    assert all(len(row) == len(COLUMNS) and all(row) for row in section.rows)


POINT = '<point><x>5</x><y>0</y></point>'
BOX = ('<rectangle><length>4</length><width>2</width><center><x>5</x><y>0</y></center>'
       '</rectangle>')
CIRCLE = '<circle><radius>{}</radius></circle>'
SIGN = ('<trafficSign id="5"><trafficSignElement><trafficSignID>{}</trafficSignID>'
        '</trafficSignElement>{}</trafficSign>')
PLACE = '<position><point><x>inf</x><y>0</y></point></position>'
LIGHT = ('<trafficLight id="6"><cycle><cycleElement><duration>9</duration><color>{}</color>'
         '</cycleElement></cycle>{}</trafficLight>')
EXACT, SPREAD = '<exact>{}</exact>', '<intervalStart>1</intervalStart><intervalEnd>2</intervalEnd>'
GOAL_TIME = f'<time>{SPREAD}</time>'


def lanelet(number: str, start: float, end: float, inside: str = '') -> str:
    """Write a straight lanelet."""
    bounds = [f'<{side}><point><x>{start}</x><y>{y}</y></point><point><x>{end}</x><y>{y}</y>'
              f'</point></{side}>' for side, y in (('leftBound', 2), ('rightBound', -2))]
    return f'<lanelet id="{number}">{"".join(bounds)}{inside}</lanelet>'


def scenario(rest: str = '', inside: str = '', second: str | None = None, head: str = '') -> str:
    """Write a scenario of two lanelets; `inside` goes into the first, `second` is the second."""
    other = lanelet('2', 50, 99) if second is None else second
    return (f'<commonRoad timeStepSize="0.1" commonRoadVersion="2020a" author="" affiliation="" '
            f'source="" date="2026-01-01" benchmarkID="ZAM_Mini-1_1_T-1">{head}<scenarioTags/>'
            + lanelet('1', 0, 50, '<successor ref="2"/>' + inside) + other + rest
            + '</commonRoad>')


def state(tag: str = 'initialState', position: str = POINT, time: str = EXACT.format(0),
          orientation: str = EXACT.format(0), velocity: str = EXACT.format(8)) -> str:
    """Write a state; without what is empty."""
    values = (('position', position), ('orientation', orientation), ('time', time),
              ('velocity', velocity))
    inside = ''.join(f'<{name}>{value}</{name}>' for name, value in values if value)
    return f'<{tag}>{inside}</{tag}>'


def problem(initial: str = '', goals: str = '', count: int = 1) -> str:
    """Write planning problems of one id."""
    return count * f'<planningProblem id="9">{initial or state()}{goals}</planningProblem>'


def goal(position: str) -> str:
    """Write a problem whose goal is a position."""
    return problem(goals=f'<goalState>{GOAL_TIME}<position>{position}</position></goalState>')


def dynamic(rest: str, shape: str = CIRCLE.format(1), initial: str = '') -> str:
    """Write a car."""
    return (f'<dynamicObstacle id="7"><type>car</type><shape>{shape}</shape>{initial or state()}'
            f'{rest}</dynamicObstacle>')


def drive(**values: str) -> str:
    """Write a car with a trajectory of one state."""
    step = state('state', **({'time': EXACT.format(1)} | values))
    return dynamic(f'<trajectory>{step}</trajectory>')


def more_values(*names: str) -> str:
    """Write a car whose state has more values."""
    values = ''.join(f'<{name}><exact>1.5</exact></{name}>' for name in names)
    return drive().replace('</state>', f'{values}</state>')


def signals(name: str, time: str = EXACT.format(0)) -> str:
    """Write a car with a signal."""
    return dynamic(f'<signalSeries><signalState><time>{time}</time><{name}>true</{name}>'
                   '</signalState></signalSeries>')


def static(kind: str = 'unknown', initial: str = '') -> str:
    """Write a static obstacle."""
    return (f'<staticObstacle id="7"><type>{kind}</type><shape>{CIRCLE.format(1)}</shape>'
            f'{initial}</staticObstacle>')


def occupancies(*radii: int) -> str:
    """Write occupancies of some radii from time step 1 on."""
    return '<occupancySet>' + ''.join(
        f'<occupancy><shape>{CIRCLE.format(radius)}</shape><time><exact>{step}</exact></time>'
        '</occupancy>' for step, radius in enumerate(radii, 1)) + '</occupancySet>'


def environment(time_of_day: str, weather: str, underground: str = 'clean') -> str:
    """Write a location with an environment."""
    return location('48', f'<environment><time>12:00:00</time><timeOfDay>{time_of_day}</timeOfDay>'
                    f'<weather>{weather}</weather><underground>{underground}</underground>'
                    '</environment>')


def location(latitude: str, rest: str = '') -> str:
    """Write a location."""
    return (f'<location><geoNameId>1</geoNameId><gpsLatitude>{latitude}</gpsLatitude>'
            f'<gpsLongitude>11</gpsLongitude>{rest}</location>')


def limit(*values: str) -> str:
    """Write a sign for a speed limit."""
    return SIGN.format(274, '').replace('</trafficSignID>', '</trafficSignID>' + ''.join(
        f'<additionalValue>{value}</additionalValue>' for value in values))


NOTES = {
    'it is of version 2017a and was read as 2018b': scenario().replace('2020a', '2017a'),
    'the malformed benchmark id … is replaced by …':
        scenario().replace('ZAM_Mini-1_1_T-1', 'ZAM-Mini-1_1-T-1'),
    'the location is incomplete or holds no numbers and is ignored':
        scenario(head=location('NaN')),
    '… belongs to no lanelet and is ignored': scenario(SIGN.format(206, '')),
    'the scenario has no planning problem: the human drives alone': scenario(),
    'obstacle …: the uncertain velocity is reduced to its centre':
        scenario(drive(velocity=SPREAD)),
    'planning problem …: the uncertain initial velocity is reduced to its centre':
        scenario(problem(state(velocity=SPREAD))),
    'the heights of … points are for the eye alone':
        scenario().replace('</y>', '</y><z>7</z>'),
    'trafficSign …: its position is no number and is ignored':
        scenario(SIGN.format(206, PLACE), '<trafficSignRef ref="5"/>'),
    'trafficLight …: its position is no number and is ignored':
        scenario(LIGHT.format('red', PLACE), '<trafficLightRef ref="6"/>'),
    'obstacle …: the uncertain position is reduced to its centre': scenario(drive(position=BOX)),
    'planning problem …: the uncertain initial position is reduced to its centre':
        scenario(problem(state(position=BOX))),
    'obstacle …: the uncertain orientation is reduced to its centre':
        scenario(drive(orientation=SPREAD)),
    'its initial state has no time and counts as that of time step 0':
        scenario(problem(state(time=''))),
    'its goal has no time and may be reached at any': scenario(problem(goals='<goalState/>')),
    'obstacle …: its occupancies change their shape: each counts as one of its own shape at its '
    'centre': scenario(dynamic(occupancies(1, 2))),
    'obstacle …: its occupancies change their shape: each counts as one of its first occupancy at '
    'its centre': scenario(f'<phantomObstacle id="7">{occupancies(1, 2)}</phantomObstacle>'),
    '1 reference leads nowhere and is ignored': scenario(inside='<successor ref="77"/>'),
    'gaps of more than 5 m between lanelets and their successors, which agents of traffic do not '
    'cross': scenario(second=lanelet('2', 80, 99)),
    'the geoTransformation has no geoReference and is ignored':
        scenario(head=location('48', '<geoTransformation/>')),
    "the timeOfDay 'tea' is not known and is ignored": scenario(head=environment('tea', 'fog')),
    "the weather 'frogs' is not known and is ignored":
        scenario(head=environment('day', 'frogs')),
    "the signs of … are not known and count as Germany's": scenario(
        SIGN.format(206, ''), '<trafficSignRef ref="5"/>').replace('ZAM_', 'POL_'),
    'the weather … is not shown and does not change friction':
        scenario(head=environment('day', 'heavy_rain')),
    'the underground … does not change friction':
        scenario(head=environment('day', 'cloudy', 'ice')),
    'the times of its occupancies are intervals: each counts at its middle alone':
        scenario(dynamic(occupancies(1).replace(EXACT.format(1), SPREAD))),
    'it might be hidden there, and counts as if it were':
        scenario(f'<phantomObstacle id="7">{occupancies(1, 1)}</phantomObstacle>'),
    'the times of … states are intervals and count as their middle': scenario(drive(time=SPREAD)),
    'its stop line has one point and counts as at the end of the lanelet':
        scenario(inside=f'<stopLine>{POINT}<lineMarking>solid</lineMarking></stopLine>'),
    'links of lanelets more than 1000 m apart are ignored':
        scenario(second=lanelet('2', 8000, 8099)),
    'its adjacentRight closes a circle and is ignored':
        scenario(inside='<adjacentRight ref="1" drivingDir="same"/>'),
    'Unknown TrafficElementID! Default traffic sign ID is used':
        scenario(SIGN.format('none', ''), '<trafficSignRef ref="5"/>'),
    'traffic light … has no cycle and is inactive':
        scenario('<trafficLight id="6"/>', '<trafficLightRef ref="6"/>'),
    'incoming … has the id …: the schema wants positive ids':
        scenario('<intersection id="30"><incoming id="2"><incomingLanelet ref="1"/></incoming>'
                 '</intersection>'),
    'traffic sign …: … has no effect':
        scenario(SIGN.format(276, ''), '<trafficSignRef ref="5"/>'),
    'only the first value of its speed limit counts': scenario(
        limit('13.9', 'wet'), '<trafficSignRef ref="5"/>'),
    'its speed limit is no positive number and is ignored': scenario(
        limit('fast'), '<trafficSignRef ref="5"/>'),
    'vehicles wait for people who walk there, but not for those who stand before it':
        scenario(inside='<laneletType>crosswalk</laneletType>'),
    'cars use the bus lane as well': scenario(inside='<laneletType>busLane</laneletType>'),
    'the date … is no date of the form 2026-01-31 and is ignored':
        scenario().replace('2026-01-01', 'in May'),
    'without effect: the hour of the day': scenario(head=environment('day', 'fog')),
    'without effect: texts in tags':
        scenario().replace('<scenarioTags/>', '<scenarioTags><urban>old</urban></scenarioTags>'),
    'without effect: elements in geoReference': scenario(head=location(
        '48', '<geoTransformation><geoReference>utm<a>32</a></geoReference></geoTransformation>')),
    'the heights of … points are ignored: only those of lanelets whose points all have one are '
    'shown': scenario().replace('<y>2</y>', '<y>2</y><z>7</z>', 1),
    'its speeds do not fit its positions, which count': scenario(drive(velocity=EXACT.format(9))),
    'without effect: speeds of static obstacles': scenario(static(initial=state())),
    'without effect: acceleration of obstacles': scenario(more_values('acceleration')),
    'without effect: velocityY of obstacles': scenario(more_values('velocityY')),
    'without effect: jerk, positionZ of obstacles': scenario(more_values('positionZ', 'jerk')),
    'without effect: slip angles of planning problems':
        scenario(problem(state().replace('</init', '<slipAngle><exact>0.1</exact></slipAngle>'
                                         '</init'))),
    'the times of its signals are intervals: each holds until the next begins':
        scenario(signals('brakingLights', SPREAD)),
    'without effect: horns': scenario(signals('horn')),
    'lanelet …: the drivingDir of its adjacentLeft is … and counts as opposite':
        scenario(inside='<adjacentLeft ref="2" drivingDir="sane"/>'),
    'without effect: userBidirectional (agents drive one way only)':
        scenario(inside='<userBidirectional>car</userBidirectional>'),
    'traffic light …: its direction … is not known and counts as all':
        scenario(LIGHT.format('red', '<direction>up</direction>'), '<trafficLightRef ref="6"/>'),
    'without effect: isLeftOf':
        scenario('<intersection id="30"><incoming id="31"><incomingLanelet ref="1"/>'
                 '<isLeftOf ref="31"/></incoming></intersection>'),
    'without effect: crossings of intersections':
        scenario('<intersection id="30"><incoming id="31"><incomingLanelet ref="1"/></incoming>'
                 '<crossing><crossingLanelet ref="2"/></crossing></intersection>'),
    'its empty trajectory is ignored': scenario(dynamic('<trajectory/>')),
    'its empty occupancySet is ignored': scenario(dynamic('<occupancySet/>')),
}
REFUSALS = {
    "commonRoadVersion is '2099z'": scenario().replace('2020a', '2099z'),
    'timeStepSize is missing': scenario().replace('timeStepSize="0.1"', ''),
    "timeStepSize is '0.001'": scenario().replace('"0.1"', '"0.001"'),
    'has no lanelets': re.sub('<lanelet .*</lanelet>', '', scenario()),
    "is 'fast', no usable number": scenario(problem(state(velocity=EXACT.format('fast')))),
    'no usable number': scenario().replace('<y>2</y>', '<y>two</y>'),
    'the time step 200000 lies outside 0 to 100000':
        scenario(problem(state(time=EXACT.format(200000)))),
    'the goal names lanelet 22, which does not exist': scenario(goal('<lanelet ref="22"/>')),
    'the position names lanelet 22, which does not exist':
        scenario(drive(position='<lanelet ref="22"/>')),
    'has no position': scenario(drive(position='')),
    'the initial velocity is 800 m/s': scenario(problem(state(velocity=EXACT.format(800)))),
    'has 1 points': scenario().replace('<point><x>50</x><y>2</y></point>', '', 1),
    'the bounds have 2 and 3 points': scenario().replace('</rightBound>', POINT + '</rightBound>'),
    "'dotted' is not a valid LineMarking":
        scenario().replace('</leftBound>', '<lineMarking>dotted</lineMarking></leftBound>'),
    "refers to 'x'": scenario(inside='<predecessor ref="x"/>'),
    'the id 1 is used by a lanelet too': scenario(second=lanelet('1', 50, 99)),
    "has the id 'two'": scenario(second=lanelet('two', 50, 99)),
    "'urb' is not a valid LaneletType": scenario(inside='<laneletType>urb</laneletType>'),
    "'blue' is not a valid TrafficLightState":
        scenario(LIGHT.format('blue', ''), '<trafficLightRef ref="6"/>'),
    "'ufo' is not a valid ObstacleType": scenario(static('ufo', state())),
    'has no initialState': scenario(static()),
    'its <occupancySet> has no <occupancy>':
        scenario('<phantomObstacle id="7"><occupancySet/></phantomObstacle>'),
    'the id 9 is used by a planningProblem too': scenario(problem(count=2)),
}


def test_the_cases_below_are_the_quotes_of_the_page() -> None:
    """A note that the page quotes has a scenario here, and the other way round."""
    assert quotes('') == set(NOTES)
    assert quotes('refused') == set(REFUSALS)
    assert quotes('start') and quotes('export')


def has_quote(line: str, quote: str) -> bool:
    """Return whether a line has what the page quotes, with any text for each ellipsis."""
    return re.search('.*'.join(map(re.escape, quote.split('…'))), line) is not None


@pytest.mark.parametrize('quote', NOTES)
def test_a_quoted_note_is_one_of_loading(quote: str) -> None:
    """The user gets the line for a file with that element."""
    notices = parse_scenario(NOTES[quote], 'x').notices
    assert any(has_quote(notice, quote) for notice in notices), notices


@pytest.mark.parametrize('quote', REFUSALS)
def test_a_quoted_message_refuses_the_file(quote: str) -> None:
    """The file is not loaded, with that message."""
    with pytest.raises(InputError) as refusal:
        parse_scenario(REFUSALS[quote], 'x')
    assert has_quote(str(refusal.value), quote)
