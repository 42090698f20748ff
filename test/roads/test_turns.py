# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Where made roads turn off: forks of long lanelets, roundabouts, merges, the opposite lane."""

from crgame_ros.roads.turns import Turns
from crgame_ros.vehicle.lights import Light
from made_roads import made, Piece, WIDTH
import pytest

BEFORE = Piece((0.0, 0.0, 0.0), 200.0, after=(2, 3))


@pytest.mark.parametrize(('own', 'other', 'expected'), [
    # A carriageway of 800 m radius beside a straight exit, and the exit.
    ((559.0, 40.0), (200.0, 0.0), None), ((200.0, 0.0), (559.0, 40.0), None),
    # A bent main road with a sharper way that turns off; a way that leaves the straight road.
    ((40.0, 35.0), (30.0, 100.0), None), ((30.0, 100.0), (40.0, 35.0), Light.LEFT),
    ((40.0, 35.0), (40.0, 0.0), Light.LEFT), ((40.0, -35.0), (40.0, 0.0), Light.RIGHT),
    # Where a road ends at another one at an angle there is no way straight on.
    ((30.0, 60.0), (30.0, -120.0), Light.LEFT)])
def test_a_fork_is_where_its_ways_begin(own: tuple[float, float], other: tuple[float, float],
                                        expected: Light | None) -> None:
    """A later bend of a long lanelet is no turn, and neither is the straightest way by far."""
    turns = Turns(made({1: BEFORE, 2: Piece(BEFORE.end, *own), 3: Piece(BEFORE.end, *other)}))
    assert turns.turn_on(2, 1) == turns.turn_on(2) == expected


def roundabout(gap: float) -> dict[int, Piece]:
    """Make quarters 1, 3, 5, 7 of a ring with straight gaps [m] behind them, and exit 9 from 1."""
    pieces: dict[int, Piece] = {}
    start = (0.0, 0.0, 0.0)
    for number in range(1, 9):
        following = number % 8 + 1
        length, bend = (gap, 0.0) if number % 2 == 0 else (23.56, 90.0)
        pieces[number] = Piece(start, length, bend, (following,))
        start = pieces[number].end
    pieces[9] = Piece(pieces[1].end, 30.0, 40.0)
    pieces[1] = pieces[1]._replace(after=(2, 9))
    return pieces


def test_a_vehicle_that_leaves_a_ring_straight_on_turns_off() -> None:
    """Right-hand traffic leaves to the right, although the ring itself is straight there."""
    turns = Turns(made(roundabout(5.0)))
    assert turns.turn_on(9, 1) is Light.RIGHT
    assert turns.turn_on(2, 1) is None


def test_a_ring_has_a_shorter_way_round_that_is_none() -> None:
    """A turn-round at once, over one lanelet, does not hide the ring."""
    pieces = roundabout(5.0)
    pieces[1] = pieces[1]._replace(after=(2, 9, 10))
    pieces[10] = Piece(pieces[1].end, 20.0, 170.0, (1,))
    assert Turns(made(pieces)).turn_on(9, 1) is Light.RIGHT


def test_a_vehicle_without_a_choice_does_not_turn_off() -> None:
    """Lanelet 1 only leads into the bend; lanelet 2 also leads straight on."""
    end = (0.0, 0.0, 0.0)
    turns = Turns(made({
        1: Piece((-50.0, 0.0, 0.0), 50.0, after=(3,)),
        2: Piece((-50.0, 0.0, 0.0), 50.0, after=(3, 4)),
        3: Piece(end, 30.0, 60.0), 4: Piece(end, 30.0)}))
    assert turns.turn_on(3, 1) is None
    assert turns.turn_on(3, 2) is turns.turn_on(3) is Light.LEFT


def test_the_lane_of_the_other_direction_lies_on_a_side() -> None:
    """Its lanelets also end at other places: they lie beside the next or the previous lanelet."""
    turns = Turns(made({
        1: Piece((0.0, 0.0, 0.0), 50.0, after=(2,), opposite=4),
        2: Piece((50.0, 0.0, 0.0), 50.0, opposite=3),
        3: Piece((100.0, WIDTH, 180.0), 50.0, after=(4,), opposite=2),
        4: Piece((50.0, WIDTH, 180.0), 50.0, opposite=1)}))
    assert {turns.side_of(*pair) for pair in (
        (1, 4), (1, 3), (2, 3), (2, 4), (3, 2), (3, 1), (4, 1), (4, 2))} == {Light.LEFT}
    assert turns.side_of(1, 2) is turns.side_of(3, 4) is None
