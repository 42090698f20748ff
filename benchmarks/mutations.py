# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Scenario files broken in one or two places, element by element."""

from copy import deepcopy
import random

from lxml import etree

NUMBERS = ('NaN', 'inf', '-inf', '1e300', '1e308', '-1', '0', '-0.0', '', 'abc', '1e6', '1e8',
           '1e9', '0.5', '7', '1e-9', '100000', '-3.5', '99999999999999999999', '3.2e5', '5.5e6',
           '\u0661',           '1_0', '0x10', '9' * 5000)
IDS = ('0', '-1', '-7', '1', '2', '99999999999999999999', 'x', '', ' 3 ', '1.5', '123456789')
HEADER = {
    'commonRoadVersion': ('2017a', '2018b', '2020a', '2021a', ''), 'date': ('', '27-Mar-2017'),
    'timeStepSize': ('0', '-0.1', '0.04', '0.2', 'NaN', '1', '0.123456789012', '100', '1e-3'),
    'benchmarkID': ('', 'a b', '../x', 'C-DEU_A-1_1_T-1', 'ZAM_Urban-3_3_Repair', 'é-1')}
OFFSETS = ((6.9e5, 5.5e6), (0.0, 5.5e6), (-1e8, 3e8))


def mutate(text: bytes, dice: random.Random) -> tuple[bytes, str]:
    """Break a scenario in one or two places; return the change, too."""
    if dice.random() < 0.01:
        end = dice.randrange(len(text))
        return text[:end], f'cut after {end} bytes'
    root = etree.fromstring(text, etree.XMLParser(huge_tree=True, remove_comments=True))
    done = []
    for _ in range(dice.choice((1, 1, 2))):
        step = dice.choice((_delete, _duplicate, _move, _attribute, _leaf, _leaf, _rename, _empty,
                            _time, _header, _same_id, _move_all, _stretch, _many))
        done.append(step(root, dice))
    return etree.tostring(root), ' and '.join(done)


def _pick(root: etree._Element, dice: random.Random) -> etree._Element:
    """Choose an element: first a tag, because most elements are points."""
    tags = sorted({str(node.tag) for node in root.iterdescendants()})
    return dice.choice(list(root.iter(dice.choice(tags))))


def _name(node: etree._Element) -> str:
    parent = node.getparent()
    return f'{"" if parent is None else parent.tag + "/"}{node.tag}'


def _delete(root: etree._Element, dice: random.Random) -> str:
    node = _pick(root, dice)
    node.getparent().remove(node)
    return f'delete {node.tag}'


def _duplicate(root: etree._Element, dice: random.Random) -> str:
    node = _pick(root, dice)
    node.addnext(deepcopy(node))
    return f'duplicate {_name(node)}'


def _move(root: etree._Element, dice: random.Random) -> str:
    node, place = _pick(root, dice), _pick(root, dice)
    name = f'copy {_name(node)} into {_name(place)}'
    place.append(deepcopy(node))
    return name


def _attribute(root: etree._Element, dice: random.Random) -> str:
    holders = [node for node in root.iterdescendants() if node.attrib]
    if not holders:
        return 'nothing'
    tag = dice.choice(sorted({str(node.tag) for node in holders}))
    node = dice.choice([node for node in holders if node.tag == tag])
    name = dice.choice(sorted(node.attrib))
    if dice.random() < 0.2:
        del node.attrib[name]
        return f'delete {_name(node)}@{name}'
    # The same value stays the same element's in half of the cases: 0 for each reference as well.
    value, before = dice.choice(IDS), node.get(name)
    node.set(name, value)
    if name == 'id' and dice.random() < 0.5:
        for other in root.iterfind(f'.//*[@ref="{before}"]'):
            other.set('ref', value)
    return f'{_name(node)}@{name} = {value!r}'


def _same_id(root: etree._Element, dice: random.Random) -> str:
    named = [node for node in root.iter() if node.get('id') is not None]
    tags = sorted({str(node.tag) for node in named})
    first, second = (dice.choice([node for node in named if node.tag == tag])
                     for tag in (dice.choice(tags), dice.choice(tags)))
    first.set('id', second.get('id'))
    return f'{first.tag} has the id of a {second.tag}'


def _leaf(root: etree._Element, dice: random.Random) -> str:
    leaves = [node for node in root.iterdescendants() if not len(node) and node.text]
    names = sorted({_name(node) for node in leaves})
    name = dice.choice(names)
    node = dice.choice([node for node in leaves if _name(node) == name])
    node.text = dice.choice(NUMBERS)
    return f'{name} = {node.text!r}'


def _rename(root: etree._Element, dice: random.Random) -> str:
    node, other = _pick(root, dice), _pick(root, dice)
    name = f'rename {_name(node)} to {other.tag}'
    node.tag = other.tag
    return name


def _empty(root: etree._Element, dice: random.Random) -> str:
    node = _pick(root, dice)
    for child in list(node):
        node.remove(child)
    return f'empty {_name(node)}'


def _time(root: etree._Element, dice: random.Random) -> str:
    times = list(root.iter('time'))
    if not times:
        return 'nothing'
    parents = sorted({node.getparent().tag for node in times})
    parent = dice.choice(parents)
    node = dice.choice([node for node in times if node.getparent().tag == parent])
    if dice.random() < 0.3:
        node.getparent().remove(node)
        return f'delete {parent}/time'
    for child in node:
        child.text = dice.choice(NUMBERS + ('1', '2', '50', '0'))
    return f'{parent}/time = {[child.text for child in node]}'


def _header(root: etree._Element, dice: random.Random) -> str:
    name = dice.choice(sorted(root.attrib))
    if dice.random() < 0.3:
        del root.attrib[name]
        return f'delete @{name}'
    value = dice.choice(HEADER.get(name, ('', 'ö "<&', 'x' * 5000)))
    root.set(name, value)
    return f'@{name} = {value[:20]!r}'


def _coordinates(root: etree._Element, dice: random.Random) -> tuple[list[etree._Element], str]:
    """Choose coordinates of positions: of everything, of the roads, of one element or one kind."""
    tags = sorted({str(node.tag) for node in root if node.tag != 'commonRoad'})
    tag = dice.choice(tags)
    scopes = {'everything': [root], 'the roads': root.findall('lanelet'),
              f'each {tag}': root.findall(tag), f'one {tag}': [dice.choice(root.findall(tag))]}
    name = dice.choice(sorted(scopes))
    found = [node for scope in scopes[name] for node in scope.iter('x', 'y')
             if not any(above.tag == 'shape' for above in node.iterancestors())]
    return found, name


def _move_all(root: etree._Element, dice: random.Random) -> str:
    nodes, name = _coordinates(root, dice)
    offset = dice.choice(OFFSETS)
    for node in nodes:
        node.text = _shifted(node.text, 1.0, offset[node.tag == 'y'])
    return f'move {name} by {offset}'


def _stretch(root: etree._Element, dice: random.Random) -> str:
    nodes, name = _coordinates(root, dice)
    factor = dice.choice((0.0, 1e-6, 0.1, -1.0, 10.0, 1e3, 1e6))
    for node in nodes:
        node.text = _shifted(node.text, factor, 0.0)
    return f'scale {name} by {factor:g}'


def _shifted(text: str | None, factor: float, offset: float) -> str:
    try:
        return repr(factor * float(text or '') + offset)
    except ValueError:
        return text or ''


def _many(root: etree._Element, dice: random.Random) -> str:
    """Repeat an element hundreds of times; give a lanelet 20,000 points."""
    lanelets = root.findall('lanelet')
    if lanelets and dice.random() < 0.5:
        lanelet = dice.choice(lanelets)
        for bound in lanelet.findall('leftBound') + lanelet.findall('rightBound'):
            points = bound.findall('point')
            if not points:
                continue
            for number in range(20_000 - len(points)):
                points[-1].addprevious(deepcopy(points[number % len(points)]))
        return f'lanelet {lanelet.get("id")} has 20,000 points'
    node, count = _pick(root, dice), dice.choice((50, 500))
    if sum(1 for _ in node.iter()) * count > 100_000:
        return 'nothing'
    ids = 10 ** 6
    for _ in range(count):
        copy = deepcopy(node)
        for named in copy.iter():
            if named.get('id') is not None:
                ids += 1
                named.set('id', str(ids))
        node.addnext(copy)
    return f'{count} times {_name(node)}'
