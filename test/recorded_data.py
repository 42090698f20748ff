# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Small data sets in the formats of the published ones, whose licences forbid to pass them on.

Vehicles follow one another along a lane of the map that the converter has for a location; some
appear later, some leave. `write` makes the files, and `read` reads them again by the data set's
documentation, independently of the converter.
"""

from collections.abc import Callable, Sequence
import csv
from dataclasses import dataclass, replace
import math
from pathlib import Path

from crgame_ros.geometry.curve import Curve
from crgame_ros.roads.network import RoadNetwork
from crgame_ros.scenario.loading import load_scenario
import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
Row = dict[str, object]

FRAMES, SPEED, SPACING = 60, 8.0, 18.0
# The lane markings of a recording of highD [m], the y axis pointing down.
_UPPER, _LOWER = (8.51, 12.59, 16.43), (21.0, 24.96, 28.8)
# Of the map USA_Roundabout-2 [m]: its coordinates are those of the tracks without this.
_INTERACTION_OFFSET = (945.5, 993.5)
_MONA_ORIGIN = (692_000.0, 5_340_000.0)
_MONA_CENTER = (48.17722803371593, 11.59292664305758)


@dataclass(frozen=True)
class Track:
    """
    A road user's recorded course.

    :param kind: as the data set names it.
    :param frames: (n) consecutive frames.
    :param poses: (n, 3) of its centre in the map, y up: x [m], y [m], yaw [rad]
    :param speeds: (n) [m/s]
    """

    number: int
    kind: str
    length: float
    width: float
    frames: NDArray[np.int64]
    poses: FloatArray
    speeds: FloatArray


@dataclass(frozen=True)
class Format:
    """
    A data set's format.

    :param map_file: of the converter, below its folder `datasets`.
    :param kinds: names of its types of road users, and those of CommonRoad.
    :param step_s: between frames [s]
    :param write: writes the tracks into a folder.
    :param read: returns the tracks that a folder holds.
    :param folder: of the published archive, in which the files are.
    """

    map_file: str
    kinds: dict[str, str]
    step_s: float
    folder: str
    write: Callable[[Path, Sequence[Track]], None]
    read: Callable[[Path], list[Track]]


def tracks_on(map_file: Path, kinds: Sequence[str], step_s: float, seed: int) -> list[Track]:
    """Return tracks along the longest lane of a map; its kinds of road users take turns."""
    network = RoadNetwork(load_scenario(map_file).scenario.lanelet_network)
    lanes = [network.lane_path(lanelet, 120.0) for lanelet in network.lanelet_ids
             if network.is_drivable(lanelet)]
    line = Curve.from_polyline(max(lanes, key=lambda points: Curve.from_polyline(points).length))
    return _in_a_row(line, kinds, step_s, seed)


def _in_a_row(line: Curve, kinds: Sequence[str], step_s: float, seed: int) -> list[Track]:
    draw = np.random.default_rng(seed)
    tracks = []
    frames = np.arange(FRAMES)
    # The last appears later; on a short lane the first leaves it.
    first = min(line.length - 0.5 * SPEED * step_s * FRAMES, (len(kinds) - 1.5) * SPACING)
    for number, kind in enumerate(kinds, 1):
        begin = first - (number - 1) * SPACING
        size = {'pedestrian': (0.5, 0.5), 'bicycle': (1.8, 0.7)}.get(
            kind.lower(), (12.0, 2.5) if 'truck' in kind.lower() or 'bus' in kind.lower()
            else (float(draw.uniform(3.8, 5.0)), float(draw.uniform(1.7, 2.0))))
        times = frames * step_s
        swing, phase = draw.uniform(0.0, 0.3), draw.uniform(0.0, 6.0)
        s = begin + SPEED * times + swing * np.sin(times + phase)
        speeds = SPEED + swing * np.cos(times + phase)
        there = (s > 0.0) & (s < line.length)
        if there.sum() > 1:
            poses = line.poses(s[there], np.zeros(int(there.sum())))
            tracks.append(Track(number, kind, round(size[0], 2), round(size[1], 2), frames[there],
                                poses, speeds[there]))
    return tracks


def _write(path: Path, rows: Sequence[Row]) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open('w', newline='') as stream:
        table = csv.DictWriter(stream, list(rows[0]))
        table.writeheader()
        table.writerows(rows)


def _read(path: Path) -> list[dict[str, str]]:
    with path.open(newline='') as stream:
        return list(csv.DictReader(stream))


def _tracks(rows: Sequence[Row | dict[str, str]],
            parse: Callable[[Row | dict[str, str]], tuple[object, ...]]) -> list[Track]:
    """Return tracks of rows, each parsed as id, kind, length, width, frame, x, y, yaw, speed."""
    found: dict[object, list[tuple[object, ...]]] = {}
    for row in rows:
        values = parse(row)
        found.setdefault(values[0], []).append(values[1:])
    return [Track(index, str(mine[0][0]), float(mine[0][1]), float(mine[0][2]),
                  np.array([int(each[3]) for each in mine]),
                  np.array([[float(v) for v in each[4:7]] for each in mine]),
                  np.array([float(each[7]) for each in mine]))
            for index, mine in enumerate(found.values())]


# ---------------------------------------------------------------------------------------- highD

def highd_tracks(seed: int) -> list[Track]:
    """Return tracks on both carriageways of highD; on the upper one they drive to the left."""
    y = [-0.5 * (_UPPER[0] + _UPPER[1]), -0.5 * (_LOWER[0] + _LOWER[1])]
    upper = Curve.from_polyline(np.array([[400.0, y[0]], [0.0, y[0]]]))
    lower = Curve.from_polyline(np.array([[0.0, y[1]], [400.0, y[1]]]))
    kinds = ('Car', 'Truck', 'Car', 'Car', 'Car')
    ups = _in_a_row(upper, kinds, 0.04, seed)
    downs = _in_a_row(lower, kinds, 0.04, seed + 1)
    return [*ups, *(replace(track, number=track.number + len(ups)) for track in downs)]


def _write_highd(folder: Path, tracks: Sequence[Track]) -> None:
    rows: list[Row] = []
    metas: list[Row] = []
    for track in tracks:
        upper = math.cos(track.poses[0, 2]) < 0.0
        for frame, (x, y, _), speed in zip(track.frames, track.poses, track.speeds, strict=True):
            rows.append({
                'frame': frame + 1, 'id': track.number, 'x': f'{x - 0.5 * track.length:.2f}',
                'y': f'{-y - 0.5 * track.width:.2f}', 'width': track.length,
                'height': track.width, 'xVelocity': f'{-speed if upper else speed:.2f}',
                'yVelocity': '0.00', 'xAcceleration': '0.00', 'yAcceleration': '0.00',
                'frontSightDistance': '100.00', 'backSightDistance': '100.00', 'dhw': '0.00',
                'thw': '0.00', 'ttc': '0.00', 'precedingXVelocity': '0.00', 'precedingId': 0,
                'followingId': 0, 'leftPrecedingId': 0, 'leftAlongsideId': 0,
                'leftFollowingId': 0, 'rightPrecedingId': 0, 'rightAlongsideId': 0,
                'rightFollowingId': 0, 'laneId': 2 if upper else 5})
        metas.append({
            'id': track.number, 'width': track.length, 'height': track.width,
            'initialFrame': track.frames[0] + 1, 'finalFrame': track.frames[-1] + 1,
            'numFrames': len(track.frames), 'class': track.kind,
            'drivingDirection': 1 if upper else 2, 'traveledDistance': '20.00',
            'minXVelocity': '8.00', 'maxXVelocity': '8.00', 'meanXVelocity': '8.00',
            'minDHW': '-1.00', 'minTHW': '-1.00', 'minTTC': '-1.00', 'numLaneChanges': 0})
    _write(folder / '05_tracks.csv', rows)
    _write(folder / '05_tracksMeta.csv', metas)
    _write(folder / '05_recordingMeta.csv', [{
        'id': 5, 'frameRate': 25, 'locationId': 1, 'speedLimit': '33.33', 'month': '9.2017',
        'weekDay': 'Tue', 'startTime': '10:00', 'duration': '2.4', 'totalDrivenDistance': '160.00',
        'totalDrivenTime': '20.00', 'numVehicles': len(tracks), 'numCars': len(tracks) - 2,
        'numTrucks': 2, 'upperLaneMarkings': ';'.join(map(str, _UPPER)),
        'lowerLaneMarkings': ';'.join(map(str, _LOWER))}])


def _read_highd(folder: Path) -> list[Track]:
    metas = {row['id']: row for row in _read(folder / '05_tracksMeta.csv')}

    def parse(row: dict[str, str]) -> tuple[object, ...]:
        meta = metas[row['id']]
        speed = float(row['xVelocity'])
        return (row['id'], meta['class'], row['width'], row['height'], row['frame'],
                float(row['x']) + 0.5 * float(row['width']),
                -float(row['y']) - 0.5 * float(row['height']),
                math.pi if speed < 0.0 else 0.0, abs(speed))
    return _tracks(_read(folder / '05_tracks.csv'), parse)


# ---------------------------------------------------------------------- inD, rounD, exiD and uniD

def _write_levelx(recording: str, location: int) -> Callable[[Path, Sequence[Track]], None]:
    def write(folder: Path, tracks: Sequence[Track]) -> None:
        rows: list[Row] = []
        for track in tracks:
            box = track.kind != 'pedestrian' and track.kind != 'bicycle'
            for age, (frame, (x, y, yaw), speed) in enumerate(
                    zip(track.frames, track.poses, track.speeds, strict=True)):
                rows.append({
                    'recordingId': int(recording), 'trackId': track.number - 1, 'frame': frame,
                    'trackLifetime': age, 'xCenter': f'{x:.5f}', 'yCenter': f'{y:.5f}',
                    'heading': f'{math.degrees(yaw) % 360.0:.5f}',
                    'width': track.width if box else 0.0, 'length': track.length if box else 0.0,
                    'xVelocity': f'{speed * math.cos(yaw):.5f}',
                    'yVelocity': f'{speed * math.sin(yaw):.5f}', 'xAcceleration': '0.0',
                    'yAcceleration': '0.0', 'lonVelocity': f'{speed:.5f}', 'latVelocity': '0.0',
                    'lonAcceleration': '0.0', 'latAcceleration': '0.0'})
        _write(folder / f'{recording}_tracks.csv', rows)
        _write(folder / f'{recording}_tracksMeta.csv', [{
            'recordingId': int(recording), 'trackId': track.number - 1,
            'initialFrame': track.frames[0], 'finalFrame': track.frames[-1],
            'numFrames': len(track.frames), 'width': track.width, 'length': track.length,
            'class': track.kind} for track in tracks])
        _write(folder / f'{recording}_recordingMeta.csv', [{
            'recordingId': int(recording), 'locationId': location, 'frameRate': '25.0',
            'speedLimit': '13.88889', 'weekday': 'tuesday', 'startTime': 11, 'duration': '2.4',
            'numTracks': len(tracks), 'numVehicles': len(tracks) - 2, 'numVRUs': 2,
            'latLocation': '50.78', 'lonLocation': '6.07', 'xUtmOrigin': '293487.1224',
            'yUtmOrigin': '5629711.58163', 'orthoPxToMeter': '0.00814636'}])
    return write


def _read_levelx(folder: Path) -> list[Track]:
    path = next(folder.glob('*_tracks.csv'))
    metas = {row['trackId']: row
             for row in _read(path.with_name(path.name.replace('tracks', 'tracksMeta')))}

    def parse(row: dict[str, str]) -> tuple[object, ...]:
        meta = metas[row['trackId']]
        return (row['trackId'], meta['class'], meta['length'], meta['width'], row['frame'],
                row['xCenter'], row['yCenter'], math.radians(float(row['heading'])),
                row['lonVelocity'])
    return _tracks(_read(path), parse)


# ------------------------------------------------------------------------------------ INTERACTION

def _write_interaction(folder: Path, tracks: Sequence[Track]) -> None:
    dx, dy = _INTERACTION_OFFSET
    place = folder / 'DR_USA_Roundabout_FT'
    _write(place / 'vehicle_tracks_000.csv', [{
        'track_id': track.number, 'frame_id': frame + 1, 'timestamp_ms': 100 * (frame + 1),
        'agent_type': track.kind, 'x': f'{x + dx:.3f}', 'y': f'{y + dy:.3f}',
        'vx': f'{speed * math.cos(yaw):.3f}', 'vy': f'{speed * math.sin(yaw):.3f}',
        'psi_rad': f'{yaw:.3f}', 'length': track.length, 'width': track.width}
        for track in tracks for frame, (x, y, yaw), speed
        in zip(track.frames, track.poses, track.speeds, strict=True)])
    # People have other columns; the converter does not read them.
    _write(place / 'pedestrian_tracks_000.csv', [{
        'track_id': 'P1', 'frame_id': frame + 1, 'timestamp_ms': 100 * (frame + 1),
        'agent_type': 'pedestrian/bicycle', 'x': 1000.0, 'y': 1000.0, 'vx': 0.0, 'vy': 0.0}
        for frame in range(FRAMES)])


def _read_interaction(folder: Path) -> list[Track]:
    dx, dy = _INTERACTION_OFFSET

    def parse(row: dict[str, str]) -> tuple[object, ...]:
        return (row['track_id'], row['agent_type'], row['length'], row['width'],
                round(int(row['timestamp_ms']) / 100), float(row['x']) - dx,
                float(row['y']) - dy, row['psi_rad'],
                math.hypot(float(row['vx']), float(row['vy'])))
    return _tracks(_read(next(folder.rglob('vehicle_tracks_000.csv'))), parse)


# ------------------------------------------------------------------------------------------- SinD

def _write_sind(folder: Path, tracks: Sequence[Track]) -> None:
    def common(track: Track, index: int, number: object) -> Row:
        x, y, yaw = track.poses[index]
        speed = track.speeds[index]
        return {'track_id': number, 'frame_id': track.frames[index],
                'timestamp_ms': round(100.1001 * float(track.frames[index]), 4),
                'agent_type': track.kind, 'x': f'{x:.6f}', 'y': f'{y:.6f}',
                'vx': f'{speed * math.cos(yaw):.6f}', 'vy': f'{speed * math.sin(yaw):.6f}'}

    vehicles, people = [], []
    for track in tracks:
        for index, (_, _, yaw) in enumerate(track.poses):
            if track.kind == 'pedestrian':
                people.append(common(track, index, f'P{track.number}') | {'ax': 0.0, 'ay': 0.0})
                continue
            vehicles.append(common(track, index, track.number) | {
                'yaw_rad': f'{yaw:.6f}', 'heading_rad': f'{yaw:.6f}', 'length': track.length,
                'width': track.width, 'ax': 0.0, 'ay': 0.0,
                'v_lon': f'{track.speeds[index]:.6f}', 'v_lat': 0.0, 'a_lon': 0.0, 'a_lat': 0.0})
    place = folder / '8_2_1'
    _write(place / 'Veh_smoothed_tracks.csv', vehicles)
    _write(place / 'Ped_smoothed_tracks.csv', people)
    # Three raw frames make one; 0, 1 and 3 are red, green and yellow.
    _write(place / 'TrafficLight_8_02_1.csv', [
        {'RawFrameID': frame, 'timestamp(ms)': round(frame * 33.3667, 1),
         **{f'Traffic light {light}': colours[light % 2] for light in range(1, 9)}}
        for frame, colours in ((0, (0, 1)), (60, (0, 3)), (90, (1, 0)))])


def _read_sind(folder: Path) -> list[Track]:
    place = folder / '8_2_1'
    rows = [*_read(place / 'Veh_smoothed_tracks.csv'), *_read(place / 'Ped_smoothed_tracks.csv')]

    def parse(row: dict[str, str]) -> tuple[object, ...]:
        vx, vy = float(row['vx']), float(row['vy'])
        return (row['track_id'], row['agent_type'], row.get('length', 0.0), row.get('width', 0.0),
                row['frame_id'], row['x'], row['y'], row.get('yaw_rad', math.atan2(vy, vx)),
                math.hypot(vx, vy))
    return _tracks(rows, parse)


# ------------------------------------------------------------------------------------------- MONA

def _write_mona(folder: Path, tracks: Sequence[Track]) -> None:
    rows = []
    for track in tracks:
        latitude, longitude = _Mercator(*_MONA_CENTER, 1.0).inverse(track.poses[:, :2])
        places = _UTM32.forward(latitude, longitude) - _MONA_ORIGIN
        rows += [{'track_id': track.number, 'frame_id': frame, 'timestamp': 0.04 * frame,
                  'agent_type': track.kind, 'x': x, 'y': y, 'v': speed, 'a': 0.0,
                  'psi_rad': yaw, 'yaw_rate': 0.0, 'length': track.length, 'width': track.width}
                 for frame, (x, y), (_, _, yaw), speed
                 in zip(track.frames, places, track.poses, track.speeds, strict=True)]
    _write(folder / 'merge_001_002' / 'trajectories.csv', rows)


def _read_mona(folder: Path) -> list[Track]:
    def parse(row: dict[str, str]) -> tuple[object, ...]:
        utm = np.array([[float(row['x']), float(row['y'])]]) + _MONA_ORIGIN
        x, y = _Mercator(*_MONA_CENTER, 1.0).forward(*_UTM32.inverse(utm))[0]
        return (row['track_id'], row['agent_type'], row['length'], row['width'], row['frame_id'],
                x, y, row['psi_rad'], row['v'])
    return _tracks(_read(next(folder.rglob('trajectories.csv'))), parse)


class _Mercator:
    """
    The transverse Mercator projection of WGS 84, by Krueger's series to the fourth order.

    L. Krueger, Konforme Abbildung des Erdellipsoids in der Ebene, 1912; better than 1 mm here.
    """

    def __init__(self, latitude: float, longitude: float, scale: float, east: float = 0.0) -> None:
        n = 1.0 / (2.0 * 298.257223563 - 1.0)
        self._radius = scale * 6378137.0 / (1.0 + n) * (1.0 + n**2 / 4.0 + n**4 / 64.0)
        self._to = (n / 2 - 2 * n**2 / 3 + 5 * n**3 / 16 + 41 * n**4 / 180,
                    13 * n**2 / 48 - 3 * n**3 / 5 + 557 * n**4 / 1440,
                    61 * n**3 / 240 - 103 * n**4 / 140, 49561 * n**4 / 161280)
        self._back = (n / 2 - 2 * n**2 / 3 + 37 * n**3 / 96 - n**4 / 360,
                      n**2 / 48 + n**3 / 15 - 437 * n**4 / 1440,
                      17 * n**3 / 480 - 37 * n**4 / 840, 4397 * n**4 / 161280)
        self._e = 2.0 * math.sqrt(n) / (1.0 + n)
        self._meridian, self._origin = math.radians(longitude), np.zeros(2)
        self._origin = self.forward(np.radians([latitude]), np.array([self._meridian]))[0] \
            - (east, 0.0)

    def forward(self, latitude: FloatArray, longitude: FloatArray) -> FloatArray:
        """Return (n, 2) east and north [m] of angles [rad]."""
        sine = np.sin(latitude)
        t = np.sinh(np.arctanh(sine) - self._e * np.arctanh(self._e * sine))
        beside = longitude - self._meridian
        z = np.arctan2(t, np.cos(beside)) + 1j * np.arctanh(np.sin(beside) / np.hypot(1.0, t))
        z = z + sum(a * np.sin(2 * j * z) for j, a in enumerate(self._to, 1))
        return self._radius * np.column_stack((z.imag, z.real)) - self._origin

    def inverse(self, places: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return latitude and longitude [rad] of places (n, 2) [m]."""
        east, north = ((places + self._origin) / self._radius).T
        z = north + 1j * east
        z = z - sum(b * np.sin(2 * j * z) for j, b in enumerate(self._back, 1))
        conformal = np.arctanh(np.sin(z.real) / np.cosh(z.imag))
        latitude = np.arcsin(np.tanh(conformal))
        for _ in range(8):
            latitude = np.arcsin(np.tanh(
                conformal + self._e * np.arctanh(self._e * np.sin(latitude))))
        return latitude, self._meridian + np.arctan2(np.sinh(z.imag), np.cos(z.real))


_UTM32 = _Mercator(0.0, 9.0, 0.9996, 500_000.0)


# ----------------------------------------------------------------------------------------- TUMdot

_TUMDOT_KINDS = ('car', 'pedestrian', 'bicycle', 'trailer', 'motorcycle', 'truck', 'bus')


def _write_tumdot(folder: Path, tracks: Sequence[Track]) -> None:
    _write(folder / 'Trajectory-Data' / 'drone_3.csv', [{
        'timestamp': round(2.16 + 0.08 * float(frame), 2), 'track_id': track.number,
        'category': _TUMDOT_KINDS.index(track.kind) + 1, 'translation_x': x, 'translation_y': y,
        'translation_z': 0.0, 'dimension_x': track.length, 'dimension_y': track.width,
        'dimension_z': 1.5, 'rotation_x': 0.0, 'rotation_y': 0.0, 'rotation_z': yaw,
        'velocity_x': speed * math.cos(yaw), 'velocity_y': speed * math.sin(yaw),
        'velocity_z': 0.0, 'acceleration_x': 0.0, 'acceleration_y': 0.0, 'acceleration_z': 0.0}
        for track in tracks for frame, (x, y, yaw), speed
        in zip(track.frames, track.poses, track.speeds, strict=True)])


def _read_tumdot(folder: Path) -> list[Track]:
    def parse(row: dict[str, str]) -> tuple[object, ...]:
        return (row['track_id'], _TUMDOT_KINDS[int(row['category']) - 1], row['dimension_x'],
                row['dimension_y'], round(float(row['timestamp']) / 0.08), row['translation_x'],
                row['translation_y'], row['rotation_z'],
                math.hypot(float(row['velocity_x']), float(row['velocity_y'])))
    return _tracks(_read(next(folder.rglob('drone_3.csv'))), parse)


_CAR_TRUCK = {'car': 'car', 'truck': 'truck'}
_STREET = {'car': 'car', 'bicycle': 'bicycle', 'pedestrian': 'pedestrian'}
FORMATS = {
    'highd': Format('', {'Car': 'car', 'Truck': 'truck'}, 0.04, 'highD-dataset-v1.0/data',
                    _write_highd, _read_highd),
    'ind': Format('inD/maps/DEU_AachenBendplatz-1.xml', _STREET | {'truck_bus': 'bus'}, 0.04,
                  'inD-dataset-v1.0/data', _write_levelx('07', 1), _read_levelx),
    'round': Format('rounD/maps/DEU_Neuweiler-1.xml',
                    _STREET | {'van': 'truck', 'trailer': 'truck'}, 0.04,
                    'rounD-dataset-v1.0/data', _write_levelx('00', 0), _read_levelx),
    'exid': Format('exiD/maps/DEU_MerzenichRather-1.xml', _CAR_TRUCK | {'van': 'truck'}, 0.04,
                   'exiD-dataset-v2.0/data', _write_levelx('78', 6), _read_levelx),
    'unid': Format('uniD/maps/DEU_AachenUniTemplergraben-1.xml', _STREET | {'van': 'car'}, 0.04,
                   'uniD-dataset-v1.0/data', _write_levelx('00', 0), _read_levelx),
    'interaction': Format('INTERACTION/maps/USA_Roundabout-2.xml', {'car': 'car'}, 0.1,
                          'INTERACTION-Dataset-DR-v1_1/recorded_trackfiles', _write_interaction,
                          _read_interaction),
    'sind': Format('sind/CHN_TIANJIN-1_1_T-1.xml', _STREET | {'tricycle': 'motorcycle'}, 0.1,
                   'SinD/Data', _write_sind, _read_sind),
    'mona': Format('mona/maps/DEU_MONAMerge-2.xml', _CAR_TRUCK, 0.04, 'MONA', _write_mona,
                   _read_mona),
    'tumdot': Format('tumdot/MUC_TUMDOT-1.xml', _STREET | {'bus': 'bus'}, 0.08, 'TUMDOT-MUC',
                     _write_tumdot, _read_tumdot)}


def write(name: str, folder: Path, data_sets: Path, seed: int = 1) -> Path:
    """
    Write a data set.

    :param folder: in which it gets the folders of the published archive.
    :param data_sets: the folder `datasets` of the converter.
    :return: the folder with its files.
    """
    form = FORMATS[name]
    kinds = list(form.kinds)
    tracks = highd_tracks(seed) if name == 'highd' else tracks_on(
        data_sets / form.map_file, [kinds[0], *kinds, kinds[0], kinds[0]], form.step_s, seed)
    place = folder / form.folder
    form.write(place, tracks)
    return place
