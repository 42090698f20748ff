# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The list `objects` of game files: every key, every refusal, written and read again."""

from collections.abc import Callable
import json
import math
from pathlib import Path
from typing import Any

from crgame_ros.errors import InputError
from crgame_ros.game.object_spec import MAX_OBJECTS, MOVER_TYPES, ObjectList, ObjectSpec
from crgame_ros.geometry.shape import Shape
from crgame_ros.schema.reading import read
from crgame_ros.schema.writing import write
import numpy as np
import pytest
import yaml

OBJECTS = """\
- {id: bin, kind: static, type: unknown, at: [12.0, 3.0, 0.0], size: [0.6, 0.6]}
- {kind: static, type: pillar, at: [1, 2], radius: 0.2}
- {id: walker, kind: particle, path: [[10, -4], [10, 6]], speed: 1.4, start: 2.0}
- {id: walker2, kind: particle, type: pedestrian, path: [[10, -4], [10, 6]], reactive: true,
   headway: 4.0, distance: 0.7, radius: 0.3, end: vanish}
- {id: cyclist, kind: bicycle, path: [[0, 0], [20, 0], [40, 5]], speeds: [3, 4.5, 0],
   reactive: true, acceleration: 0.8, deceleration: 1.2}
- {id: lead, kind: bicycle, type: car, lanelet: 12, s: 5, speed: 10, reactive: true}
- {id: rec, kind: bicycle, trajectory: ride.csv}
- {id: given, kind: particle, trajectory: [[0, 0, 0, 1.5], [1.0, 0, 1.2, 1.5]], end: stay}
"""
WALK = {'kind': 'particle', 'path': [[0, 0], [5, 0]]}
RIDE = {'kind': 'bicycle', 'path': [[0, 0], [5, 0]]}
BIN = {'kind': 'static', 'at': [0, 0, 0]}
ROWS = {'kind': 'particle', 'trajectory': [[0, 0, 0], [1, 1, 0]]}


def parse(entries: Any, base: Path = Path()) -> tuple[ObjectSpec, ...]:
    """Check a list of entries."""
    return read(ObjectList, entries, 'game.yaml: objects', base)


def test_every_key_is_read(tmp_path: Path) -> None:
    """It reads keys, defaults by kind and type, and the content of a CSV file."""
    (tmp_path / 'ride.csv').write_text('t,x,y\n0,0,0\n1,0,3\n2,0,3\n3,-3,3\n', encoding='utf-8')
    specs = {spec.id: spec for spec in parse(yaml.safe_load(OBJECTS), tmp_path)}
    assert list(specs) == ['bin', 'b1', 'walker', 'walker2', 'cyclist', 'lead', 'rec', 'given']
    assert specs['bin'].shape == Shape.rectangle(0.6, 0.6)
    assert (specs['b1'].at, specs['b1'].shape) == ((1.0, 2.0, 0.0), Shape.circle(0.2))
    walker = specs['walker']
    assert (walker.type, walker.start, walker.end) == ('pedestrian', 2.0, 'stay')
    assert (walker.path, walker.reactive) == (((10.0, -4.0), (10.0, 6.0)), False)
    # As wide as pedestrians of our own scenarios, at the game's speed.
    assert (walker.shape, walker.mover.speed) == (Shape.circle(0.35), 1.4)
    other = specs['walker2'].mover
    assert (other.headway, other.distance, other.shape.radius) == (4.0, 0.7, 0.3)
    assert (specs['walker2'].end, specs['walker2'].reactive) == ('vanish', True)
    cyclist = specs['cyclist']
    assert (cyclist.type, cyclist.speeds) == ('bicycle', (3.0, 4.5, 0.0))
    assert (cyclist.mover.acceleration, cyclist.mover.deceleration) == (0.8, 1.2)
    lead = specs['lead']
    assert (lead.lanelet, lead.s, lead.end, lead.shape.length) == (12, 5.0, 'vanish', 4.508)
    # The heading is that of the motion and stays during a stop.
    assert specs['rec'].trajectory == ((0.0, 0.0, 0.0, math.pi / 2), (1.0, 0.0, 3.0, math.pi / 2),
                                       (2.0, 0.0, 3.0, math.pi), (3.0, -3.0, 3.0, math.pi))
    assert specs['given'].trajectory[1] == (1.0, 0.0, 1.2, 1.5)
    assert (specs['rec'].end, specs['given'].end) == ('vanish', 'stay')


def test_entries_give_the_same_objects_again(tmp_path: Path) -> None:
    """Written entries are read back from any folder, through YAML and JSON."""
    (tmp_path / 'ride.csv').write_text('t,x,y,yaw\n0,0,0,0.1\n1,0,1.3,0.2\n', encoding='utf-8')
    specs = parse(yaml.safe_load(OBJECTS), tmp_path)
    entries = write(specs)
    assert parse(yaml.safe_load(yaml.safe_dump(entries))) == specs
    assert parse(json.loads(json.dumps(entries))) == specs


def test_every_type_has_a_size_and_limits() -> None:
    """Each type of each mover can be made and turns about as sharply as a real one."""
    for name, mover in MOVER_TYPES.items():
        kind = WALK if mover.wheelbase == 0.0 else RIDE
        spec, = parse([{**kind, 'type': name}])
        assert spec.mover == mover
    # A turning circle of 11 m between kerbs gives the rear axle a radius of 4.1 m.
    assert 1.0 / MOVER_TYPES['car'].sharpest == pytest.approx(4.1, abs=0.1)


REFUSED: list[tuple[Any, str]] = [
    ({}, 'objects: is no list'),
    ([1], r'objects\[0\]: is no mapping'),
    ([BIN] * (MAX_OBJECTS + 1), 'has 201 entries'),
    ([{**BIN, 'id': 'Bin'}], r'objects\[0\]: "id" is .Bin.'),
    ([{**BIN, 'id': 'hv0'}], '"id" is .hv0.'),
    ([{**BIN, 'id': 'o12'}], '"id" is .o12.'),
    ([{**BIN, 'id': 'o30_2'}], '"id" is .o30_2.'),
    ([{**BIN, 'id': 'e_x'}], '"id" is .e_x.'),
    ([{**BIN, 'id': 7}], '"id" is 7'),
    ([{**BIN, 'id': 'a'}, {**BIN, 'id': 'a'}], r'objects\[1\]: "a" is there already'),
    ([{**BIN, 'id': 'b1'}, BIN], r'objects\[1\]: "b1" is there already'),
    ([{'at': [0, 0]}], '"kind" is missing; use one of static, particle, bicycle'),
    ([{'kind': 'train'}], '"kind" is .train.; use'),
    ([{'kind': 'static'}], 'has none of "at"; kind static needs "at"'),
    ([{'kind': 'static', 'path': [[0, 0], [1, 0]]}], 'has "path"; kind static needs "at"'),
    ([{**RIDE, 'lanelet': 3}], 'has "path" and "lanelet"; kind bicycle needs ex'),
    ([{**WALK, 'colour': 'red'}], '"colour" is unknown for kind particle'),
    ([{**BIN, 'speed': 3}], '"speed" is unknown for kind static with "at"; known are'),
    ([{**ROWS, 'reactive': True}], '"reactive" is unknown for kind particle with "traject'),
    ([{**WALK, 's': 3}], '"s" is unknown'),
    ([{**WALK, 'type': 'car'}], '"type" is .car.; kind particle has one of pedestrian'),
    ([{**BIN, 'type': []}], r'"type" is \[\]'),
    ([{**BIN, 'at': [0]}], r'"at" is \[0\]; give \[x, y, yaw\], numbers from'),
    ([{**BIN, 'at': [0, math.nan]}], '"at" holds nan'),
    ([{**BIN, 'at': [0, '1']}], "\"at\" holds '1'"),
    ([{**BIN, 'size': [1]}], r'"size" is \[1\]'),
    ([{**BIN, 'size': [1, 0]}],
     r'"size" holds 0; give \[length, width\], numbers above 0, to 200'),
    ([{**BIN, 'size': [1, 1], 'radius': 1}], 'has a size and a radius'),
    ([{**BIN, 'radius': 0}], '"radius" is 0; give a number above 0, to 100'),
    ([{**WALK, 'speed': 0}], '"speed" is 0; give a number above 0, to 100'),
    ([{**WALK, 'speed': True}], '"speed" is True'),
    ([{**WALK, 'start': -1}], '"start" is -1; give a number from 0 to'),
    ([{**WALK, 'start': math.nan}], '"start" is nan'),
    ([{**WALK, 'acceleration': math.inf}], '"acceleration" is inf'),
    ([{**WALK, 'end': 'explode'}], '"end" is .explode.; use one of stay, vanish'),
    ([{**WALK, 'reactive': 'yes'}], '"reactive" is .yes.; give true or false'),
    ([{**WALK, 'path': [[0, 0]]}], r'path: has 1 entries; give 2 to 1000'),
    ([{**WALK, 'path': [[0, 0], [1]]}], r'path\[1\]: is \[1\]; give \[x, y\]'),
    ([{**WALK, 'path': [[0, 0], [1, 1e300]]}], r'path\[1\]: holds 1e\+300'),
    ([{**WALK, 'path': [[0, 0], [0, 0]]}], r'path\[1\]: is the same place'),
    ([{**WALK, 'path': [[0, 0], [30000, 0]]}], 'path: is 30 km long'),
    ([{**WALK, 'speed': 1, 'speeds': [1, 1]}], 'has "speed" and "speeds"'),
    ([{**WALK, 'speeds': [1]}], r'"speeds" is \[1.0\]; give 2 numbers'),
    ([{**WALK, 'speeds': [0, 1]}], 'the last may be 0'),
    ([{**WALK, 'speeds': [1, 0], 'end': 'vanish'}], 'its last speed is 0'),
    ([{'kind': 'bicycle', 'lanelet': 'A'}], '"lanelet" is .A.; give the id of a lanelet'),
    ([{**ROWS, 'trajectory': [[0, 0, 0]]}], 'trajectory: the trajectory has 1 rows'),
    ([{**ROWS, 'trajectory': 3}], 'the trajectory is no list'),
    ([{**ROWS, 'trajectory': [[0, 0, 0], [1, 0]]}], r'trajectory\[1\]: \[1, 0\] is no row'),
    ([{**ROWS, 'trajectory': [[0, 0, 0], [0, 1, 1]]}], 't = 0 s comes after 0 s'),
    ([{**ROWS, 'trajectory': [[0, 0, 0], [1, 101, 0]]}], 'it moves by 101 m in 1 s'),
    ([{**ROWS, 'trajectory': [[0, 0, 0], [1, math.nan, 0]]}], 'nan is no number'),
]


@pytest.mark.parametrize(('entries', 'message'), REFUSED,
                         ids=[str(number) for number in range(len(REFUSED))])
def test_wrong_entries_are_refused(entries: Any, message: str) -> None:
    """The message is one line that names the entry, the key, the value and valid values."""
    with pytest.raises(InputError, match=message) as caught:
        parse(entries)
    assert str(caught.value).startswith('game.yaml: objects')
    assert len(str(caught.value)) < 300


def outside(folder: Path) -> None:
    """Write a valid trajectory beside the folder of the game."""
    (folder.parent / 'ride.csv').write_text('t,x,y\n0,0,0\n1,0,3\n', encoding='utf-8')


def linked(folder: Path) -> None:
    """Create a link in the game's folder that leads out of it."""
    outside(folder)
    (folder / 'ride.csv').symlink_to(folder.parent / 'ride.csv')


def holding(content: bytes) -> Callable[[Path], None]:
    """Return a function that writes the trajectory's file."""
    def write(folder: Path) -> None:
        (folder / 'ride.csv').write_bytes(content)
    return write


@pytest.mark.parametrize(('name', 'prepare', 'message'), [
    ('ride.csv', lambda folder: None, "cannot read the trajectory 'ride.csv'"),
    ('../ride.csv', outside, 'is outside'),
    ('/etc/passwd', lambda folder: None, 'is outside'),
    ('ride.csv', linked, 'is outside'),
    ('ride\0.csv', lambda folder: None, 'cannot read the trajectory'),
    ('.', lambda folder: None, 'cannot read the trajectory'),
    ('ride.csv', holding(b'x,y\n1,2\n'), 'begin with t,x,y or t,x,y,yaw'),
    ('ride.csv', holding(b't,x,y\n0,0,0\n\n1,a,0\n'), r"ride.csv, line 4: 'a' is no number"),
    ('ride.csv', holding(b't,x,y\n0,0,0\n1,inf,0\n'), r'ride.csv, line 3: inf is no number'),
    ('ride.csv', holding(b't,x,y\n0,0,0\n1,0\n'), r'ride.csv, line 3: .* is no row'),
    ('ride.csv', holding(b't,x,y\n0,0,0\n'), 'the trajectory has 1 rows'),
    ('ride.csv', holding(b'\xff\xfe'), 'cannot read the trajectory'),
    ('ride.csv', holding(b't,x,y\n' + b''.join(b'%d,0,0\n' % i for i in range(5001))),
     'give 2 to 5000 rows'),
    ('ride.csv', holding(b' ' * ((1 << 20) + 1)), 'is larger than 1 MiB'),
], ids=['missing', 'above', 'absolute', 'link', 'nul', 'directory', 'header', 'text', 'inf',
        'short', 'one', 'bytes', 'rows', 'large'])
def test_wrong_trajectory_files_are_refused(name: str, prepare: Callable[[Path], None],
                                            message: str, tmp_path: Path) -> None:
    """Only files inside the game's folder and below a size are read; errors name the line."""
    folder = tmp_path / 'game'
    folder.mkdir()
    prepare(folder)
    with pytest.raises(InputError, match=message):
        parse([{'kind': 'bicycle', 'trajectory': name}], folder)


@pytest.mark.parametrize(('shift', 'factor'), [
    (0.0, 1.0), (0.7, 1.0), (-0.7, 1.0), (0.0, 1.5), (1.3, 0.8), (-2.2, 1.2)])
def test_a_trajectory_is_driven_later_and_faster(shift: float, factor: float) -> None:
    # x(t) = 8 t + t² along the x axis: where it is at t is where it was at factor (t - shift).
    rows = [[0.1 * n, 8.0 * 0.1 * n + (0.1 * n) ** 2, 0.0] for n in range(100)]
    spec, = parse([{'kind': 'bicycle', 'trajectory': rows, 'shift': shift,
                    'speed_factor': factor}])
    timed = spec.timed_trajectory
    times, places = [row[0] for row in timed], [row[1] for row in timed]
    assert times[0] == 0.0 and all(a < b for a, b in zip(times, times[1:], strict=False))
    for step in range(40):
        t = 0.1 * step
        then = factor * (t - shift)
        # Before its first row it comes at the first speed, 8.1 m/s as given.
        expected = 8.0 * then + then ** 2 if then >= 0.0 else 8.1 * then
        found = np.interp(t, times, places)
        assert found == pytest.approx(expected, abs=0.01)
