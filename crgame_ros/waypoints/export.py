# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Exports way-point roads as a CommonRoad 2020a scenario."""

from collections.abc import Sequence
from dataclasses import dataclass
import math
from pathlib import Path
import re
from typing import Literal
from xml.sax.saxutils import quoteattr

from crgame_ros.errors import CrgameError, InputError
from crgame_ros.scenario.export_elements import (
    exact_number,
    goal_state,
    lanelet_references,
    planning_problem,
)
from crgame_ros.scenario.export_network import schema_errors
from crgame_ros.scenario.loading import parse_scenario
from crgame_ros.waypoints.lanelets import Bounds, DECIMALS, FloatArray, lane_bounds
from crgame_ros.waypoints.pieces import (
    completed_links,
    cut_lanes,
    free_ids,
    is_reachable,
    Piece,
    turns,
)
from crgame_ros.waypoints.roads import WaypointRoads
from lxml import etree
import numpy as np

LaneletKind = Literal['urban', 'highway']

TIME_STEP_S = 0.1
# Greatest length of a map in a scenario file, and of a lane in a lanelet [m].
MAX_LENGTH, MAX_LANE_LENGTH = 600e3, 99e3
# Last time step of the goal: ten minutes.
_GOAL_STEPS = 6000
_MAX_SPEED = 100.0
_LIMIT_SIGN = '274'
_ERRORS_TOLD = 3
_ZAMUNDA = re.compile(r'ZAM_[A-Za-z0-9]+-[1-9]\d*_[1-9]\d*_T-[1-9]\d*')
_HEAD = ('<location><geoNameId>-999</geoNameId><gpsLatitude>999</gpsLatitude>'
         '<gpsLongitude>999</gpsLongitude></location>\n'
         '<scenarioTags><{}/><simulated/></scenarioTags>\n')


@dataclass(frozen=True)
class Drive:
    """
    The task of an AV, for a planning problem.

    :param lane: id of the lane on whose centre line it starts.
    :param station: station of the vehicle's centre at the start [m]
    :param speed: initial speed [m/s]
    :param goal: id of the lane to reach.
    """

    lane: int
    station: float
    speed: float
    goal: int


@dataclass(frozen=True)
class ExportedRoads:
    """
    Way-point roads as a scenario.

    :param benchmark_id: its benchmark id.
    :param xml_text: the content of the file.
    :param pieces: its lanelets, in order.
    :param problem_id: id of the planning problem; None without one.
    """

    benchmark_id: str
    xml_text: str
    pieces: tuple[Piece, ...]
    problem_id: int | None

    def lanelets(self, lane: int) -> tuple[int, ...]:
        """Return the lanelets of a lane, in driving direction."""
        return tuple(piece.number for piece in self.pieces if piece.lane == lane)


def export_roads(roads: WaypointRoads, name: str, kind: LaneletKind = 'urban',
                 drive: Drive | None = None, where: str = 'way-point roads') -> ExportedRoads:
    """
    Convert way-point lanes to a map of lanelets.

    Every lane becomes a lanelet, or several where its speed limit changes (`cut_lanes`). Without
    a drive there is no planning problem, although CommonRoad's schema requires one; everything
    else conforms to the schema.

    :param name: name of the map, part of the benchmark id.
    :param kind: lanelet type of all lanes.
    :param where: text for messages, before the lane.
    :raises InputError: if a lane or a link cannot be represented by lanelets.
    :raises CrgameError: if the schema refuses the result.
    """
    _refuse_long(roads, where)
    links = completed_links(roads, where)
    ids = free_ids(roads.lane_ids)
    pieces = tuple(cut_lanes(roads, links, ids, where))
    if drive is not None:
        _check_drive(roads, drive)
        if not is_reachable(links, drive.lane, drive.goal):
            raise InputError(f'no way leads from lane {drive.lane} to lane {drive.goal}',
                             '--goal', 'name another, or complete the links of the lanes')
    at_ends = turns(roads, links)
    lanelets, signs = [], []
    for piece in pieces:
        bounds = lane_bounds(roads.lane(piece.lane), piece.start, piece.end,
                             (at_ends[piece.lane, 0], at_ends[piece.lane, -1]),
                             f'{where}, lane {piece.lane}')
        sign = next(ids) if math.isfinite(piece.speed_limit) else None
        lanelets.append(_lanelet(piece, bounds, kind, sign))
        if sign is not None:
            signs.append(_sign(sign, piece.speed_limit, bounds.right[0]))
    problem_id = next(ids)
    problem = _problem(problem_id, roads, drive, pieces)
    benchmark_id = name if _ZAMUNDA.fullmatch(name) else (
        f'ZAM_{re.sub("[^A-Za-z0-9]", "", name)[:40] or "Roads"}-1_1_T-1')
    network = _HEAD.format(kind) + ''.join(lanelets + signs)
    _refuse_invalid(_document(benchmark_id, network + problem, where))
    text = _document(benchmark_id, network + (problem if drive is not None else ''), where)
    # Check that the file can be loaded: the loader refuses more than the schema, e.g. large files.
    parse_scenario(text, f'{where} as a scenario')
    return ExportedRoads(benchmark_id, text, pieces, None if drive is None else problem_id)


def _refuse_long(roads: WaypointRoads, where: str) -> None:
    lengths = [(roads.lane(lane).length, lane) for lane in roads.lane_ids]
    longest, lane = max(lengths)
    if longest > MAX_LANE_LENGTH:
        raise InputError(f'is {longest / 1e3:.0f} km long', f'{where}, lane {lane}',
                         f'split it into lanes of {MAX_LANE_LENGTH / 1e3:.0f} km at most; '
                         'way-points are in metres')
    total = sum(length for length, _ in lengths)
    if total > MAX_LENGTH:
        raise InputError(f'the lanes are {total / 1e3:.0f} km long together', where,
                         f'split the map: {MAX_LENGTH / 1e3:.0f} km are a full scenario file')


def _check_drive(roads: WaypointRoads, drive: Drive) -> None:
    for option, lane in (('--start', drive.lane), ('--goal', drive.goal)):
        if lane not in roads.lane_ids:
            raise InputError(f'there is no lane {lane}', option, 'name a lane of the way-points')
    length = roads.lane(drive.lane).length
    if not 0.0 <= drive.station <= length:
        raise InputError(f'the station {drive.station:g} m is not on lane {drive.lane}',
                         '--start', f'give 0 to {length:.1f} m')
    if not 0.0 <= drive.speed <= _MAX_SPEED:
        raise InputError(f'the speed is {drive.speed:g} m/s', '--start',
                         f'give 0 to {_MAX_SPEED:g} m/s')


def _problem(number: int, roads: WaypointRoads, drive: Drive | None,
             pieces: Sequence[Piece]) -> str:
    """Return the XML of the planning problem, or of a substitute for the check by the schema."""
    if drive is None:
        drive = Drive(pieces[0].lane, 0.0, 0.0, pieces[0].lane)
    here = roads.lane(drive.lane).at(np.array([drive.station]))
    goals = lanelet_references(piece.number for piece in pieces if piece.lane == drive.goal)
    return planning_problem(
        number, (float(here.x[0]), float(here.y[0]), float(here.yaw[0]), drive.speed, 0.0,
                 float(here.curvature[0]) * drive.speed), [goal_state((0, _GOAL_STEPS), goals)])


def _lanelet(piece: Piece, bounds: Bounds, kind: LaneletKind, sign: int | None) -> str:
    parts = [f'<lanelet id="{piece.number}">\n'
             f'<leftBound>{_points(bounds.left)}</leftBound>\n'
             f'<rightBound>{_points(bounds.right)}</rightBound>\n']
    parts += [f'<predecessor ref="{number}"/>' for number in piece.predecessors]
    parts += [f'<successor ref="{number}"/>' for number in piece.successors]
    for tag, side in (('adjacentLeft', piece.left), ('adjacentRight', piece.right)):
        if side is not None:
            direction = 'same' if side[1] else 'opposite'
            parts.append(f'<{tag} ref="{side[0]}" drivingDir="{direction}"/>')
    parts.append(f'<laneletType>{kind}</laneletType>')
    if sign is not None:
        parts.append(f'<trafficSignRef ref="{sign}"/>')
    return ''.join(parts) + '\n</lanelet>\n'


def _sign(number: int, limit: float, position: FloatArray) -> str:
    # All digits, so that reading it again gives the same number.
    value = np.format_float_positional(limit, trim='0')
    return (f'<trafficSign id="{number}"><trafficSignElement><trafficSignID>{_LIMIT_SIGN}'
            f'</trafficSignID><additionalValue>{value}</additionalValue></trafficSignElement>'
            f'<position>{_points(position[None])}</position><virtual>false</virtual>'
            '</trafficSign>\n')


def _points(points: FloatArray) -> str:
    return ''.join(f'<point><x>{x:.{DECIMALS}f}</x><y>{y:.{DECIMALS}f}</y></point>'
                   for x, y in points.tolist())


def _document(benchmark_id: str, content: str, source: str) -> str:
    # The date is constant and the folder left out, so that equal way-points give equal bytes.
    name = ''.join(letter for letter in Path(source).name if letter.isprintable())
    header = {'timeStepSize': exact_number(TIME_STEP_S), 'commonRoadVersion': '2020a',
              'author': '', 'affiliation': '', 'source': f'{name}, made by crgame roads',
              'benchmarkID': benchmark_id, 'date': '1970-01-01'}
    attributes = ' '.join(f'{name}={quoteattr(value)}' for name, value in header.items())
    return (f"<?xml version='1.0' encoding='UTF-8'?>\n<commonRoad {attributes}>\n{content}"
            '</commonRoad>\n')


def _refuse_invalid(text: str) -> None:
    errors = schema_errors(etree.fromstring(text.encode('utf-8'),
                                            etree.XMLParser(huge_tree=True)))
    if errors:
        raise CrgameError('the scenario would break the CommonRoad schema: '
                          + '; '.join(errors[:_ERRORS_TOLD]))
