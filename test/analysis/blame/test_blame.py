# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""An AV is blamed where closed forms say that it could have avoided its contact."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import ClassVar

from crgame_ros.analysis.blame.blame import Blame, blame_of
from crgame_ros.analysis.blame.manoeuvres import BRAKING, Manoeuvre, MANOEUVRES
from crgame_ros.analysis.runs.run import Run
from crgame_ros.evaluation.results.cell_rows import vehicle_rows
from crgame_ros.game.game import load_game, parse_game
from crgame_ros.geometry.polyline import ReferencePath
from crgame_ros.messages.plan import Plan, PlanRequest
from crgame_ros.occupancy.map_file import map_text
from crgame_ros.occupancy.sources import write_pgm
from crgame_ros.paths import config_directory, scenarios_directory
from crgame_ros.planner.constant_velocity import ConstantVelocityPlanner
from crgame_ros.planner.interface import PlannerContext
from crgame_ros.planner.path_following import PathFollower
from crgame_ros.planner.registry import PLANNERS
from crgame_ros.simulation.contacts import contacts_of
from crgame_ros.simulation.offline import OfflineResult, run_offline
from crgame_ros.simulation.setup import build_setup
from crgame_ros.variation.space import game_of
import numpy as np
import pytest

# Of the AV [m/s]; its front is at x = 12.254 m at first. A planner reacts one tick later [s].
SPEED, FRONT, TICK_S = 20.0, 12.254, 0.1
MOST = 1.0489 * 9.81
# UN R157, the careful and competent driver: perceives after 0.4 s, brakes 0.75 s later with
# 0.774 g, which takes 0.6 s to build up.
CAREFUL_S, CAREFUL, BUILD_UP_S = 1.15, 0.774 * 9.81, 0.6

Object = Mapping[str, object]


class LaneChanger(ConstantVelocityPlanner):
    """Changes to the lane on its left between x = 60 m and 100 m, and looks at nobody."""

    name: ClassVar[str] = 'lane-changer'

    def setup(self, context: PlannerContext) -> None:
        x = np.linspace(0.0, 500.0, 501)
        y = 3.75 * 0.5 * (1.0 - np.cos(np.pi * np.clip((x - 60.0) / 40.0, 0.0, 1.0)))
        self._context = context
        self._follow = PathFollower(
            ReferencePath.from_polyline(np.column_stack((x, y))), context.vehicle)

    def plan(self, request: PlanRequest) -> Plan:
        ego = request.ego
        place = self._follow.locate(ego.x, ego.y, ego.yaw, ego.x)
        return self.answer(request, self._follow.drive(
            ego, place, 30, request.time_step_s, lambda i, s, speed: 0.0))


class Braking(ConstantVelocityPlanner):
    """Brakes gently from x = 50 m on, whatever is ahead."""

    name: ClassVar[str] = 'braking'

    def plan(self, request: PlanRequest) -> Plan:
        return self.answer(request, self.follower.drive(
            request.ego, self.locate(request), 30, request.time_step_s,
            lambda i, s, speed: -3.0 if request.ego.x > 50.0 else 0.0))


class Racer(ConstantVelocityPlanner):
    """Accelerates from x = 50 m on, and looks at nobody."""

    name: ClassVar[str] = 'racer'

    def plan(self, request: PlanRequest) -> Plan:
        return self.answer(request, self.follower.drive(
            request.ego, self.locate(request), 30, request.time_step_s,
            lambda i, s, speed: 2.0 if request.ego.x > 50.0 else 0.0))


def driven(objects: Sequence[Object], planner: str = 'constant-velocity', vehicle: str = 'auto',
           duration_s: float = 8.0, **rest: object) -> OfflineResult:
    values = {
        **rest,
        'scenario': 'ZAM_CutIn-1_1_T-1.xml', 'duration': duration_s, 'humans': [],
        'avs': [{'id': 'av0', 'planning_problem': 100, 'planner': planner, 'vehicle': vehicle}],
        'objects': list(objects)}
    with PLANNERS.giving({planner.name: planner for planner in (LaneChanger, Racer, Braking)}):
        return run_offline(build_setup(parse_game(values, 'game', scenarios_directory())))


def pedestrian(ahead: float) -> Object:
    """Stand beside the AV's path, and step into it when its front is that far away [m]."""
    x = FRONT + 60.0 + ahead
    return {'id': 'walker', 'kind': 'particle', 'type': 'pedestrian', 'path': [[x, -1.3], [x, 4]],
            'speed': 1.5, 'acceleration': 20.0, 'start': 3.0}


def parked(x: float, y: float = 0.0, name: str = 'parked') -> Object:
    return {'id': name, 'kind': 'static', 'type': 'parkedVehicle', 'at': [x, y, 0.0],
            'size': [4.5, 1.8]}


def walls() -> list[Object]:
    """Leave 15 cm beside the AV and the pedestrian."""
    return [{'id': f'wall{number}', 'kind': 'static', 'type': 'roadBoundary',
             'at': [90.0, side * 2.3, 0.0], 'size': [150.0, 1.0]}
            for number, side in enumerate((1.0, -1.0))]


def slippery(folder: Path, friction: float) -> str:
    """Write the usual vehicle with another friction, and return its file."""
    source = config_directory() / 'vehicles'
    for name in ('bmw_320i.yaml', 'steering_ratio.yaml'):
        (folder / name).write_text((source / name).read_text().replace(
            'friction: 1.0489', f'friction: {friction}'))
    return str(folder / 'bmw_320i.yaml')


def ways(speed: float, begin_s: float, braking: float, build_up_s: float = 0.0) -> np.ndarray:
    """Integrate the way of a vehicle that brakes to a halt, in steps of 1 ms [m]."""
    t = np.arange(0.0, 12.0, 1e-3)
    share = (t >= begin_s) * 1.0 if not build_up_s else np.clip(
        (t - begin_s) / build_up_s, 0.0, 1.0)
    speeds = np.maximum(speed - np.cumsum(share * braking) * 1e-3, 0.0)
    return np.cumsum(speeds) * 1e-3


def judged(result: OfflineResult, manoeuvres: tuple[Manoeuvre, ...] = MANOEUVRES) -> Blame:
    return blame_of(result, contacts_of(result), 'av0', manoeuvres)


def needed_gap(difference: float, deceleration: float, *own: float) -> float:
    return float((ways(SPEED, *own) - ways(SPEED - difference, 0.0, deceleration)).max())


def in_family(gap: float, difference: float, deceleration: float,
              vehicle: str = 'auto') -> OfflineResult:
    """Drive on at constant speed behind a vehicle that has cut in and brakes to a halt."""
    game = game_of(load_game(scenarios_directory() / 'cut_in_family.yaml'), {
        'gap': gap, 'difference': difference, 'deceleration': deceleration}, '')
    assert game.avs is not None
    av = replace(game.avs[0], planner='constant-velocity', vehicle=vehicle)
    return run_offline(build_setup(replace(game, avs=(av,))))


FAMILY = [(10.0, 2.0), (10.0, 6.0), (12.0, 4.0), (15.0, 8.0)]


@pytest.mark.parametrize(('difference', 'deceleration'), FAMILY)
def test_braking_avoids_what_the_closed_form_says(difference: float,
                                                  deceleration: float) -> None:
    gap = needed_gap(difference, deceleration, TICK_S, MOST)
    for offset, kind in ((-0.3, 'no_escape'), (0.3, 'avoidable')):
        result = in_family(gap + offset, difference, deceleration)
        assert judged(result, BRAKING).kind == kind
        # On a motorway there is room beside the other: moves aside avoid more, and never less.
        assert judged(result).kind == 'avoidable'


@pytest.mark.parametrize(('difference', 'deceleration'), [*FAMILY, (0.0, 9.0), (5.0, 5.0)])
def test_what_a_careful_driver_avoids_is_avoidable(difference: float,
                                                   deceleration: float) -> None:
    gap = needed_gap(difference, deceleration, CAREFUL_S, CAREFUL, BUILD_UP_S)
    found = judged(in_family(gap, difference, deceleration), BRAKING)
    assert found.kind == 'avoidable'
    # It reacts later than the AV must, and no more softly than physics allows.
    assert found.escape_s is not None and found.escape_s >= 0.5


def test_a_leader_that_brakes_is_foreseen_by_its_brake_lights(tmp_path: Path) -> None:
    # Equally fast at first, with half of the friction: at constant velocity, nothing would be
    # foreseeable for another second, and then the AV could not halt behind the other.
    vehicle = slippery(tmp_path, 0.5)
    gap = needed_gap(0.0, 9.0, TICK_S, 0.5 * 9.81)
    found = [judged(in_family(gap + offset, 0.0, 9.0, vehicle), BRAKING)
             for offset in (-0.3, 0.3)]
    assert [each.kind for each in found] == ['no_escape', 'avoidable']
    assert found[1].since_s == 0.0


@pytest.mark.parametrize(('ahead', 'narrow', 'kind'), [
    (3.0, False, 'no_escape'),  # Reached within a tick and a half.
    # 2 m until it brakes and 19.4 m to a halt are too much, but there is room to move aside.
    (14.0, True, 'no_escape'), (14.0, False, 'avoidable'),
    (60.0, True, 'avoidable')])
def test_a_pedestrian_steps_out(ahead: float, narrow: bool, kind: str) -> None:
    # The pedestrian waits on the way that it has, and then walks on.
    walker = {**pedestrian(ahead), 'speed': 1.5 if ahead < 30.0 else 0.45}
    result = driven([walker, *(walls() if narrow else ())])
    found = judged(result)
    assert found.kind == kind, found.told
    # Before, nothing told that it would walk.
    assert found.since_s is not None and found.since_s >= 3.0


def test_a_car_that_stands_ahead_is_avoidable_however_fast_one_drives(tmp_path: Path) -> None:
    assert judged(driven([parked(120.0)])).kind == 'avoidable'
    # 20 m/s with a friction of 0.3: a halt takes 68 m and 6.8 s, far more than the 3 s in which
    # others are foreseen at least.
    result = driven([parked(120.0)], vehicle=slippery(tmp_path, 0.3))
    assert judged(result, BRAKING).kind == 'avoidable'


def test_an_av_knows_its_own_path() -> None:
    # The car stands where the AV ends its lane change. Straight ahead of it, it comes to lie too
    # late for the 21.4 m that braking takes.
    found = judged(driven([parked(104.0, 3.75)], 'lane-changer'), BRAKING)
    assert found.kind == 'avoidable'
    # Foreseeable 3 s before, less than a tick.
    assert found.since_s is not None and found.since_s < 1.6


def test_an_av_knows_that_it_will_accelerate() -> None:
    # At its speed, it would come no nearer to the other for long.
    ahead = {'id': 'ahead', 'kind': 'bicycle', 'type': 'car', 'speed': 22.0,
             'path': [[26.0, 0.0], [900.0, 0.0]]}
    result = driven([ahead], 'racer')
    contact, = contacts_of(result)
    found = judged(result, BRAKING)
    assert found.kind == 'avoidable'
    assert found.since_s == pytest.approx(0.01 * contact.n - 3.0, abs=0.15)


def test_an_av_that_brakes_too_gently_knew_it_before() -> None:
    # The leader drives 10 m/s, and brakes when the AV has nearly become as slow. As the AV drove,
    # all would have been well until then; at its speed, it was 3 s away 29.7 m before.
    leader = {'id': 'leader', 'kind': 'bicycle', 'type': 'car', 'speeds': [10.0, 10.0, 0.0],
              'path': [[52.2, 0.0], [108.25, 0.0], [108.45, 0.0]], 'deceleration': 8.0}
    found = judged(driven([leader], 'braking'))
    assert found.kind == 'avoidable' and found.since_s == pytest.approx(0.8, abs=0.2)


def test_an_escape_stays_on_the_road() -> None:
    # To pass the block on its left, an AV moves aside by 2.3 m; in the left lane, there is 1.07 m.
    swerves = tuple(item for item in MANOEUVRES if item.aside > 0.0 and item.along >= 0.0)
    for planner, y, kind in (('constant-velocity', 0.0, 'avoidable'),
                             ('lane-changer', 3.75, 'no_escape')):
        block = {**parked(160.0, y - 1.5), 'size': [4.5, 6.0]}
        assert judged(driven([block], planner), swerves).kind == kind


def from_behind(x: float, y: float) -> Object:
    return {'id': 'racer', 'kind': 'bicycle', 'type': 'car', 'path': [[x, y], [600.0, y]],
            'speed': 35.0}


def test_who_is_hit_from_behind_is_to_blame_only_after_a_cut_in() -> None:
    found = judged(driven([from_behind(-30.0, 0.0)]))
    assert (found.kind, found.escape_s) == ('hit_from_behind', None)
    # It comes from nowhere, too late to brake, but the AV was there.
    rows = [[3.0, 55.0, 0.0], [13.0, 405.0, 0.0]]
    sudden = {'id': 'racer', 'kind': 'bicycle', 'type': 'car', 'trajectory': rows}
    assert judged(driven([sudden])).kind == 'hit_from_behind'
    # 1.3 s after the AV has come into its lane: too late for the other, which cannot be blamed.
    changed = judged(driven([from_behind(-59.0, 3.75)], 'lane-changer'))
    assert changed.kind == 'avoidable'


def test_who_stands_is_not_to_blame() -> None:
    walker = {'id': 'walker', 'kind': 'particle', 'type': 'pedestrian', 'start': 10.0,
              'path': [[130.0, 0.0], [60.0, 0.0]], 'speed': 3.0}
    result = driven([parked(110.0), walker], 'idm', duration_s=20.0)
    assert judged(result).kind == 'standing'


def test_others_count_and_followers_do_not() -> None:
    # Beside the AV, a car hinders moves to the left, and one behind it would brake as well.
    block = [parked(20.0 + 4.6 * number, side * 2.2, f'{name}{number}')
             for number in range(36) for name, side in (('left', 1.0), ('right', -1.0))]
    follower = {'id': 'follower', 'kind': 'bicycle', 'type': 'car', 'speed': 20.0,
                'path': [[0.0, 0.0], [600.0, 0.0]]}
    result = driven([parked(120.0), *block, follower])
    found = judged(result)
    assert found.kind == 'avoidable' and 'braking' in found.told and ' m to ' not in found.told
    swerves = tuple(item for item in MANOEUVRES if item.aside)
    assert judged(result, swerves).kind == 'no_escape'
    assert judged(driven([parked(120.0), follower]), swerves).kind == 'avoidable'


@pytest.mark.parametrize('half_width', [2.0, 9.0])
def test_walls_of_a_map(half_width: float, tmp_path: Path) -> None:
    # A wall across the road at x = 100 m, in cells of 0.5 m; white is free.
    pixels = np.full((40, 400), 254, dtype=np.uint8)
    pixels[np.abs(np.arange(40) - 19.5) * 0.5 < half_width, 200:202] = 0
    write_pgm(tmp_path / 'map.pgm', pixels)
    (tmp_path / 'map.yaml').write_text(map_text('map.pgm', 0.5, (0.0, -10.0)))
    result = driven([], occupancy=str(tmp_path / 'map.yaml'))
    found = judged(result)
    # Front and wall meet after 4.4 s.
    assert found.kind == 'avoidable' and found.since_s == pytest.approx(1.4, abs=0.05)
    swerves = tuple(item for item in MANOEUVRES if item.aside and item.along >= 0.0)
    assert judged(result, swerves).kind == ('avoidable' if half_width < 3.0 else 'no_escape')


def test_the_table_of_an_evaluation_has_it() -> None:
    for objects, blame in (([from_behind(-30.0, 0.0)], 'hit_from_behind'), ([], None)):
        result = driven(objects)
        row, = vehicle_rows(Run('run', result=result, scoring='none'), result,
                            contacts_of(result))
        assert (row['collided'], row['blame']) == (blame is not None, blame)
    assert judged(result) == Blame('', 'no contact')
