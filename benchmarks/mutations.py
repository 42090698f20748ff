# Copyright 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Scenario files broken in one or two places: each is refused at once, or runs and is written."""

import argparse
from collections import Counter
from copy import deepcopy
from dataclasses import dataclass
from multiprocessing import Pool
from pathlib import Path
import random
import signal
import sys
import tempfile
import traceback

from lxml import etree

from crgame_ros.errors import InputError
from crgame_ros.recording.run_log import run_log_of
from crgame_ros.scenario.export import export_scenario
from crgame_ros.scenario.export_network import schema_errors
from crgame_ros.scenario.game import Game, HumanSpec
from crgame_ros.simulation.offline import run_offline
from crgame_ros.simulation.setup import build_setup

NUMBERS = ('NaN', 'inf', '-inf', '1e300', '-1', '0', '-0.0', '', 'abc', '1e8', '0.5', '7', '1e-9',
           '100000', '-3.5', '99999999999999999999', '3.2e5')
IDS = ('0', '-1', '-7', '1', '2', '99999999999999999999', 'x', '', ' 3 ', '1.5', '123456789')
HEADER = {
    'commonRoadVersion': ('2017a', '2018b', '2020a', '2021a', ''), 'date': ('', '27-Mar-2017'),
    'timeStepSize': ('0', '-0.1', '0.04', '0.2', 'NaN', '1', '0.123456789012', '100', '1e-3'),
    'benchmarkID': ('', 'a b', '../x', 'C-DEU_A-1_1_T-1', 'ZAM_Urban-3_3_Repair', 'é-1')}
SECONDS = 60


@dataclass(frozen=True)
class Outcome:
    """
    What became of a mutated file.

    :param kind: `refused` at once, `valid` after its run; all else is a defect: `late` (refused
        at the end of its run), `invalid`, `crash`, `several lines`, `hang`.
    :param mutation: what was done to the file.
    :param detail: the message or traceback.
    """

    kind: str
    mutation: str
    detail: str = ''

    @property
    def is_good(self) -> bool:
        """Tell whether a user would be served."""
        return self.kind in ('refused', 'valid')


def mutate(text: bytes, seed: object) -> tuple[bytes, str]:
    """Break a scenario in one or two places; the same seed gives the same file."""
    dice = random.Random(str(seed))
    if dice.random() < 0.01:
        end = dice.randrange(len(text))
        return text[:end], f'cut after {end} bytes'
    root = etree.fromstring(text, etree.XMLParser(huge_tree=True, remove_comments=True))
    done = []
    for _ in range(dice.choice((1, 1, 2))):
        step = dice.choice((_delete, _duplicate, _move, _attribute, _leaf, _leaf, _rename, _empty,
                            _time, _header, _same_id))
        done.append(step(root, dice))
    return etree.tostring(root), ' and '.join(done)


def _pick(root: etree._Element, dice: random.Random) -> etree._Element:
    """Choose an element: first a tag, for most elements are points."""
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


def outcome_of(text: bytes, mutation: str, folder: Path) -> Outcome:
    """Load a file, drive it for two scenario steps and export the run."""
    file = folder / 'mutated.xml'
    file.write_bytes(text)
    signal.signal(signal.SIGALRM, _give_up)
    signal.alarm(SECONDS)
    try:
        try:
            setup = build_setup(Game(file, humans=(HumanSpec('hv0', 'idle'),)))
        except InputError as error:
            return Outcome('several lines' if '\n' in str(error) else 'refused', mutation,
                           str(error))
        result = run_offline(setup, duration_s=2.0 * setup.scheduler.time_step_s)
        try:
            exported = export_scenario(run_log_of(result))
        except Exception as error:  # the kind that matters most: it comes after the whole run
            return Outcome('late', mutation, f'{type(error).__name__}: {error}')
        errors = schema_errors(etree.fromstring(exported.xml_text.encode()))
        return Outcome('invalid' if errors else 'valid', mutation, '; '.join(errors[:1]))
    except TimeoutError:
        return Outcome('hang', mutation, traceback.format_exc(limit=-2))
    except Exception:  # whatever escapes is the finding
        return Outcome('crash', mutation, traceback.format_exc(limit=-3))
    finally:
        signal.alarm(0)


def _give_up(*_: object) -> None:
    raise TimeoutError(f'more than {SECONDS} s')


def _try(job: tuple[Path, int]) -> tuple[str, Outcome]:
    path, seed = job
    text, mutation = mutate(path.read_bytes(), f'{path.stem} {seed}')
    with tempfile.TemporaryDirectory() as folder:
        return f'{path.stem} {seed}', outcome_of(text, mutation, Path(folder))


def main() -> int:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('scenarios', nargs='+', type=Path, help='CommonRoad files to break')
    parser.add_argument('--count', type=int, default=56, help='mutations of each file')
    parser.add_argument('--first', type=int, default=0, help='seed of the first')
    parser.add_argument('--jobs', type=int, default=2)
    values = parser.parse_args()
    jobs = [(path, seed) for seed in range(values.first, values.first + values.count)
            for path in values.scenarios]
    counts: Counter[str] = Counter()
    with Pool(values.jobs, maxtasksperchild=100) as pool:
        for name, outcome in pool.imap_unordered(_try, jobs):
            counts[outcome.kind] += 1
            if not outcome.is_good:
                print(f'{outcome.kind}: {name}: {outcome.mutation}\n    {outcome.detail}',
                      flush=True)
    print(f'{counts.total()} files: '
          + ', '.join(f'{count} {kind}' for kind, count in counts.most_common()))
    return 0 if set(counts) <= {'refused', 'valid'} else 1


if __name__ == '__main__':
    sys.exit(main())
