# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Malformed scenario files: each is refused in one line that names file, element, remedy."""

import os
from pathlib import Path
import time

from crgame_ros.errors import InputError
from crgame_ros.scenario import guard
from crgame_ros.scenario.loading import load_scenario, parse_scenario
from crgame_ros.scenario.repair import mend
from lxml import etree
import pytest

BOUND = '<{name}><point><x>0</x><y>{y}</y></point><point><x>50</x><y>{y}</y></point></{name}>'
LEFT = BOUND.format(name='leftBound', y=2)
RIGHT = BOUND.format(name='rightBound', y=-2)
LANELET = f'<lanelet id="1">{LEFT}{RIGHT}</lanelet>'
HEADER = ('<commonRoad timeStepSize="0.1" commonRoadVersion="2020a" author="a" affiliation="b" '
          'benchmarkID="ZAM_Mini-1" source="c" date="2026-01-01">')
VALID = f'<?xml version="1.0"?>\n{HEADER}<scenarioTags/>{LANELET}</commonRoad>'
STATE = ('<{tag}><position><point><x>{x}</x><y>0</y></point></position><orientation><exact>0'
         '</exact></orientation><time><exact>{t}</exact></time><velocity><exact>5</exact>'
         '</velocity></{tag}>')
SHAPE = '<shape><rectangle><length>4</length><width>2</width></rectangle></shape>'


def obstacle(x: str = '10', t: str = '0', shape: str = SHAPE, kind: str = 'car') -> str:
    """Write a dynamic obstacle with one state after the initial one."""
    return (f'<dynamicObstacle id="7"><type>{kind}</type>{shape}'
            + STATE.format(tag='initialState', x='9', t='0') + '<trajectory>'
            + STATE.format(tag='state', x=x, t=t) + '</trajectory></dynamicObstacle>')


PROBLEM = ('<planningProblem id="9">' + STATE.format(tag='initialState', x='5', t='0')
           + '<goalState><time><intervalStart>{}</intervalStart><intervalEnd>9</intervalEnd>'
           '</time></goalState></planningProblem>')


def with_obstacle(text: str) -> str:
    """Return the valid scenario with an obstacle added."""
    return VALID.replace('</commonRoad>', text + '</commonRoad>')


BOMB = ('<!DOCTYPE lolz [<!ENTITY a "ha">' + ''.join(
    f'<!ENTITY {b} "{f"&{a};" * 10}">' for a, b in zip('abcdefghi', 'bcdefghij', strict=True))
    + ']>' + VALID.split('\n')[1].replace('author="a"', 'author="&j;"'))
EXTERNAL = ('<!DOCTYPE x [<!ENTITY x SYSTEM "file:///etc/passwd">]>'
            + VALID.split('\n')[1].replace('<x>0</x>', '<x>&x;</x>', 1))

MALFORMED = {
    'truncated': (VALID[:len(VALID) // 2], 'well-formed'),
    'empty': ('', 'well-formed'),
    'not xml': ('P6 640 480 255 \x01\x02', 'well-formed'),
    'wrong root': ('<OpenDRIVE/>', '<OpenDRIVE>'),
    'no lanelets': (VALID.replace(LANELET, ''), 'no lanelets'),
    'entity expansion': (BOMB, 'entities'),
    'external entity': (EXTERNAL, 'entities'),
    'nan': (VALID.replace('<x>50</x>', '<x>NaN</x>', 1), "'NaN'"),
    'infinite': (VALID.replace('<x>50</x>', '<x>-inf</x>', 1), "'-inf'"),
    'huge number': (VALID.replace('<x>50</x>', '<x>1e300</x>', 1), "'1e300'"),
    'no number': (VALID.replace('<x>50</x>', '<x>fifty</x>', 1), "'fifty'"),
    'empty number': (VALID.replace('<x>50</x>', '<x/>', 1), "'empty'"),
    'number with a child': (VALID.replace('<x>0</x>', '<x>0<b/></x>', 1), '<x> is '),
    'time with a child': (with_obstacle(obstacle(t='<b/>')), "'empty', no usable whole number"),
    'speed with a child': (with_obstacle(PROBLEM.format('1').replace(
        '<exact>5</exact>', '<exact><b>5</b></exact>')), "'empty', no usable number"),
    'interval with a child': (with_obstacle(obstacle(t='1').replace(
        '<exact>1</exact>', '<intervalStart><b/></intervalStart><intervalEnd>2</intervalEnd>')),
        '<intervalStart> is '),
    'height with a child': (VALID.replace('<y>2</y>', '<y>2</y><z><b/></z>'), '<z> is '),
    'nan in the goal of 2017a': (with_obstacle(PROBLEM.format('nan')).replace('2020a', '2017a'),
                                 "<intervalStart> is 'nan'"),
    'infinite goal of 2017a': (with_obstacle(PROBLEM.format('inf')).replace('2020a', '2017a'),
                               "<intervalStart> is 'inf'"),
    'id of an incoming': (with_obstacle('<intersection id="3"><incoming id="--5"/>'
                                        '</intersection>'), 'commonroad-io cannot read it'),
    'endless id': (VALID.replace('id="1"', f'id="{10 ** 18}"'), 'at most 18 digits'),
    'duplicate ids': (VALID.replace(LANELET, LANELET * 2), 'the id 1 is used'),
    'duplicate ids of two kinds': (with_obstacle(obstacle().replace('"7"', '" 01"')),
                                   'the id 1 is used by a lanelet'),
    'id missing': (VALID.replace('<lanelet id="1">', '<lanelet>'), 'id None'),
    'no time step': (VALID.replace('timeStepSize="0.1"', ''), 'timeStepSize is missing'),
    'zero time step': (VALID.replace('"0.1"', '"0"'), "timeStepSize is '0'"),
    'negative time step': (VALID.replace('"0.1"', '"-0.1"'), "timeStepSize is '-0.1'"),
    'nan time step': (VALID.replace('"0.1"', '"nan"'), "timeStepSize is 'nan'"),
    'unknown version': (VALID.replace('2020a', '1999x'), "'1999x'"),
    'one point': (VALID.replace('<point><x>50</x><y>2</y></point>', ''), '1 points'),
    'unequal bounds': (VALID.replace('</leftBound>', '<point><x>60</x><y>2</y></point>'
                                     '</leftBound>'), '3 and 2 points'),
    'no right bound': (VALID.replace(RIGHT, ''), '<rightBound> has 0 points'),
    'point without y': (VALID.replace('<x>50</x><y>2</y>', '<x>50</x>'), 'no x or no y'),
    'no length': (VALID.replace('<x>50</x>', '<x>0</x>'), '0 m long'),
    'endless lanelet': (VALID.replace('<x>50</x>', '<x>1e8</x>'), '1e+08 m long'),
    'fractional time': (with_obstacle(obstacle(t='1.5')), 'whole number'),
    'negative time': (with_obstacle(obstacle(t='-3')), 'time step -3'),
    'endless time': (with_obstacle(obstacle(t='999999999')), 'time step 999999999'),
    'nan in a state': (with_obstacle(obstacle(x='nan', t='1')), 'dynamicObstacle 7'),
    'unknown type': (with_obstacle(obstacle(t='1', kind='spaceship')), 'spaceship'),
    'no shape': (with_obstacle(obstacle(t='1', shape='')), 'dynamicObstacle 7'),
    'goal off the map': (with_obstacle(
        '<planningProblem id="9">' + STATE.format(tag='initialState', x='5', t='0')
        + '<goalState><position><lanelet ref="99"/></position><time><intervalStart>1'
        '</intervalStart><intervalEnd>9</intervalEnd></time></goalState></planningProblem>'),
        'planningProblem 9'),
}


@pytest.mark.parametrize('name', MALFORMED)
def test_refusal_is_one_line_with_file_and_reason(name: str, tmp_path: Path) -> None:
    """Every malformed file ends as an InputError (exit code 2), never as another exception."""
    text, reason = MALFORMED[name]
    path = tmp_path / 'bad.xml'
    path.write_text(text, encoding='utf-8')
    with pytest.raises(InputError) as caught:
        load_scenario(path)
    message = str(caught.value)
    assert str(path) in message and reason in message and '\n' not in message
    assert caught.value.exit_code == 2 and caught.value.remedy


def test_the_valid_file_behind_the_malformed_ones_is_read() -> None:
    """The refusals above are due to the one change in each."""
    loaded = parse_scenario(with_obstacle(obstacle(t='1')), 'good.xml')
    assert [x.lanelet_id for x in loaded.scenario.lanelet_network.lanelets] == [1]
    assert loaded.scenario.obstacle_by_id(7).state_at_time(1).position.tolist() == [10.0, 0.0]


@pytest.mark.parametrize('text', [
    '<note id="abc"/>', f'<note id="{"9" * 5000}"/>',
    '<intersection id="3"><incoming id="4"><successorsLeft id="x" ref="1"/></incoming>'
    '</intersection>'])
def test_ids_that_nothing_reads_may_be_anything(text: str) -> None:
    """They are no reason to refuse a file."""
    assert parse_scenario(with_obstacle(text), 'good.xml').scenario.lanelet_network.lanelets


def test_repairs_take_time_in_proportion_to_the_file() -> None:
    """Small files of many repeated ids and references would block the program for minutes."""
    numbers = range(100, 10_100)
    signs = ''.join(f'<trafficSign id="{number}"/>' for number in numbers)
    references = ''.join(f'<trafficSignRef ref="{number}"/>' for number in numbers)
    root = etree.fromstring(VALID.split('\n')[1].replace(
        '</lanelet>', f'<stopLine>{references}</stopLine></lanelet>').replace(
        '</commonRoad>', signs + '<intersection id="2">' + '<incoming id="2"/>' * 30_000
        + '</intersection></commonRoad>'))
    guard.refuse_malformed(root, 'x')
    began_s = time.process_time()
    mend(root)
    assert time.process_time() - began_s < 5.0
    assert len(root.findall('lanelet/trafficSignRef')) == len(numbers)
    assert len({node.get('id') for node in root.iterfind('intersection/incoming')}) == 30_000


def test_positions_in_lanelets_count_as_points(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each becomes the outline of its lanelet: a small file would fill the memory."""
    text = with_obstacle(obstacle(t='1')).replace(
        '<point><x>10</x><y>0</y></point>', '<lanelet ref="1"/>')
    monkeypatch.setattr(guard, 'MAX_POINTS', 8)
    assert parse_scenario(text, 'x.xml').scenario.obstacle_by_id(7)
    monkeypatch.setattr(guard, 'MAX_POINTS', 7)
    with pytest.raises(InputError, match='positions of obstacles, have 8 points, more than 7'):
        guard.refuse_malformed(etree.fromstring(text.split('\n')[1]), 'x.xml')


def test_message_names_the_line_of_the_element(tmp_path: Path) -> None:
    """Line numbers are those of the file, for any XML declaration."""
    path = tmp_path / 'lines.xml'
    path.write_text(VALID.replace(RIGHT, '\n\n' + RIGHT.replace('<x>50', '<x>oops')))
    with pytest.raises(InputError, match=r'lines\.xml, line 4, lanelet 1: <x> is .oops.'):
        load_scenario(path)


def test_200_mib_of_whitespace_is_refused_unread(
        tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The size is checked first: the file is not even opened."""
    path = tmp_path / 'white.xml'
    with path.open('wb') as stream:
        stream.truncate(200 * 2 ** 20)
    opened: list[Path] = []
    monkeypatch.setattr(Path, 'open', lambda self, *_, **__: opened.append(self))
    with pytest.raises(InputError, match='200 MiB, more than 64'):
        load_scenario(path)
    assert not opened
    with pytest.raises(InputError, match='more than 64'):
        parse_scenario(' ' * (guard.MAX_BYTES + 1), '/scenario/xml')


def test_what_is_no_file_is_refused(tmp_path: Path) -> None:
    """A directory, a pipe (which would block for ever) and a missing file are told apart."""
    pipe = tmp_path / 'pipe.xml'
    os.mkfifo(pipe)
    for path, reason in ((tmp_path, 'is a directory'), (pipe, 'no regular file'),
                         (tmp_path / 'none.xml', 'No such file'), (Path('a\0b'), 'no file name')):
        with pytest.raises(InputError, match=reason):
            load_scenario(path)


@pytest.mark.skipif(os.geteuid() == 0, reason='root may read every file')
def test_unreadable_file_is_refused(tmp_path: Path) -> None:
    """A permission error names the file."""
    path = tmp_path / 'secret.xml'
    path.write_text(VALID)
    path.chmod(0)
    with pytest.raises(InputError, match='Permission denied'):
        load_scenario(path)


@pytest.mark.parametrize(('encoding', 'declared'), [
    ('utf-8', 'UTF-8'), ('utf-8-sig', 'UTF-8'), ('iso-8859-1', 'ISO-8859-1'),
    ('utf-16', 'UTF-16')])
def test_encodings_give_the_same_text(encoding: str, declared: str, tmp_path: Path) -> None:
    """A file in any declared encoding is read as the text it holds."""
    text = VALID.replace('?>', f' encoding="{declared}"?>').replace('author="a"', 'author="Bär"')
    path = tmp_path / 'encoded.xml'
    path.write_bytes(text.encode(encoding))
    loaded = load_scenario(path)
    assert loaded.scenario.author == 'Bär'
    assert loaded.xml_text == text


def test_text_that_is_no_text_is_refused(tmp_path: Path) -> None:
    """Wrong bytes, unknown encodings and non-text codecs do not escape as other errors."""
    path = tmp_path / 'bytes.xml'
    for data in (b'\xff\x00\x81', b'<?xml version="1.0" encoding="zlib"?><commonRoad/>',
                 b'<?xml version="1.0" encoding="klingon"?><commonRoad/>'):
        path.write_bytes(data)
        with pytest.raises(InputError, match='is no text of encoding'):
            load_scenario(path)
    with pytest.raises(InputError, match='well-formed'):
        parse_scenario('<commonRoad>\ud800</commonRoad>', '/scenario/xml')
