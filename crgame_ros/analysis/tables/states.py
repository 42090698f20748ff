# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The table of states: all vehicles and objects at each scenario step, and drivers' inputs."""

from collections.abc import Iterator, Mapping

from crgame_ros.analysis.runs.run import Run
from crgame_ros.analysis.tables.column import (
    CENTER,
    Column,
    FLAG,
    INTEGER,
    NUMBER,
    REAR_AXLE,
    RUN,
    step_columns,
    TableDeclaration,
    TEXT,
)
from crgame_ros.analysis.tables.writer import PIECE_ROWS
from crgame_ros.game.objects import Role
from crgame_ros.geometry.reference_point import shifted, shifted_velocities
from crgame_ros.roads.network import RoadNetwork
from crgame_ros.scenario.loading import parse_scenario
from crgame_ros.timing.cycle_rows import COMMAND_COLUMNS
from crgame_ros.vehicle.lights import Light
from crgame_ros.vehicle.state import pose_rates, STATE_WIDTH, StateColumn
import numpy as np
from numpy.typing import NDArray
import pyarrow as pa

FloatArray = NDArray[np.float64]

OF_OBJECTS = 'of objects, which are not driven in this run'
OFF_ROAD = 'off the road'
UNCONSUMED = 'not driven by hand: objects, AVs on their plans, at the start, unrecorded cycles'
UNLIT = 'it has none: objects, humans at the start, unrecorded cycles, AVs of early versions'
IN_LANE = 'nearest point of the centre line, whose heading is interpolated between its vertices'

STATES = TableDeclaration(
    'states', 'a vehicle or object at a scenario time step at which it is there',
    ('run', 'k', 'id'), (
        RUN, *step_columns('the state, which is that of its own motion then'),
        Column('id', TEXT, '', 'of the vehicle or object: hv0, av0, o<obstacle id>, t0, …'),
        Column('role', TEXT, '', 'what moves it', values=tuple(role.value for role in Role)),
        Column('type', TEXT, '', 'CommonRoad obstacle type, as its XML spells it'),
        Column('length', NUMBER, 'm', 'extent along its heading'),
        Column('width', NUMBER, 'm', 'extent across its heading'),
        Column('x_center', NUMBER, 'm', 'first coordinate', CENTER),
        Column('y_center', NUMBER, 'm', 'second coordinate', CENTER),
        Column('x_rear_axle', NUMBER, 'm', 'first coordinate', REAR_AXLE, empty=OF_OBJECTS),
        Column('y_rear_axle', NUMBER, 'm', 'second coordinate', REAR_AXLE, empty=OF_OBJECTS),
        Column('yaw', NUMBER, 'rad', 'heading, counter-clockwise from the first axis'),
        Column('vx_center', NUMBER, 'm/s', 'velocity along the first axis', CENTER),
        Column('vy_center', NUMBER, 'm/s', 'velocity along the second axis', CENTER),
        Column('speed', NUMBER, 'm/s', 'velocity along its heading, negative backwards',
               'any on its axis: the same at rear axle and center'),
        Column('yaw_rate', NUMBER, 'rad/s', 'rate of the heading'),
        Column('acceleration_rear_axle', NUMBER, 'm/s^2', 'acceleration along its heading',
               REAR_AXLE, 'state of its motion model, no difference of speeds', OF_OBJECTS),
        Column('steering_angle', NUMBER, 'rad', 'of the front wheels, positive to the left',
               empty=OF_OBJECTS),
        Column('steering_rate', NUMBER, 'rad/s', 'rate of the steering angle', empty=OF_OBJECTS),
        Column('throttle', NUMBER, '1', 'pedal, 0 to 1, consumed by the simulation step that led '
               'to this state', empty=UNCONSUMED),
        Column('brake', NUMBER, '1', 'pedal, 0 to 1, of the same step', empty=UNCONSUMED),
        Column('steering', NUMBER, '1', 'wheel, -1 to 1, positive to the left, of the same step',
               empty=UNCONSUMED),
        Column('reverse', FLAG, '', 'whether the gear was reverse, of the same step',
               empty=UNCONSUMED),
        Column('left_indicator', FLAG, '', 'whether the left indicator was on (with the right '
               'one: hazard lights), of the same step; an AV by itself '
               'indicates what its plan is about to do', empty=UNLIT),
        Column('right_indicator', FLAG, '', 'whether the right indicator was on, of the same step',
               empty=UNLIT),
        Column('horn', FLAG, '', 'whether the horn sounded, of the same step', empty=UNLIT),
        Column('lanelet_id', INTEGER, '', 'of the lanelet under it; of several, whose direction '
               'agrees best', CENTER, empty=OFF_ROAD),
        Column('lane_s', NUMBER, 'm', "arc length along that lanelet's centre line, from its "
               'first vertex', CENTER, IN_LANE, OFF_ROAD),
        Column('lane_offset', NUMBER, 'm', 'distance from that centre line, positive to the left',
               CENTER, IN_LANE, OFF_ROAD)))


def state_rows(run: Run) -> Iterator[dict[str, object]]:
    """
    Yield the rows of a run, in pieces: by time step, driven vehicles first.

    :raises InputError: if its scenario cannot be used.
    """
    log = run.log
    if not log.descriptions:
        return
    maker, progress = _StateRows(run), run.telling('writing the states of')
    steps = max(1, PIECE_ROWS // len(log.descriptions))
    for start in range(0, len(log.ks), steps):
        end = min(start + steps, len(log.ks))
        yield maker.rows(slice(start, end))
        progress(end / len(log.ks))


class _StateRows:
    """Builder of the rows of consecutive steps of a run."""

    def __init__(self, run: Run) -> None:
        self._run, log = run, run.log
        self._vehicles = len(log.vehicles)
        self._rear_to_center = np.array([item.rear_to_center for item in log.vehicles])
        self._roads = RoadNetwork(parse_scenario(
            log.xml_text, '/scenario/xml').scenario.lanelet_network)
        items = log.descriptions
        self._texts = {'id': [item.id for item in items],
                       'role': [item.role.value for item in items],
                       'type': [item.type for item in items]}
        self._sizes = np.array([(item.shape.length, item.shape.width) for item in items])

    def rows(self, part: slice) -> dict[str, object]:
        """Return the columns of the steps in a part of the log."""
        log = self._run.log
        states = log.vehicle_states[part]
        count = len(states)
        centers = shifted(states[..., :3], self._rear_to_center)
        velocities = shifted_velocities(
            centers[..., 2], pose_rates(states.reshape(-1, STATE_WIDTH)).reshape(centers.shape),
            self._rear_to_center)
        poses = np.concatenate((centers, log.object_poses[part]), axis=1)
        moves = np.concatenate((velocities, log.object_velocities[part]), axis=1)
        own = np.full((count, poses.shape[1], STATE_WIDTH), np.nan)
        own[:, :self._vehicles] = states
        speed = (moves[..., 0] * np.cos(poses[..., 2]) + moves[..., 1] * np.sin(poses[..., 2]))
        speed[:, :self._vehicles] = states[..., StateColumn.SPEED]
        here = np.isfinite(poses[..., 0])
        ks = np.broadcast_to(log.ks[part, None], here.shape)
        who = np.broadcast_to(np.arange(here.shape[1]), here.shape)[here]
        commands = np.full((count, here.shape[1], len(COMMAND_COLUMNS)), np.nan)
        if log.commands is not None:
            commands[:, :self._vehicles] = log.commands[part]
        found: dict[str, object] = {
            'run': self._run.id, 'k': ks[here],
            'time_s': self._run.seconds_at(ks[here]),
            **{name: pa.DictionaryArray.from_arrays(pa.array(who), texts).cast(pa.string())
               for name, texts in self._texts.items()},
            'length': self._sizes[who, 0], 'width': self._sizes[who, 1],
            'x_center': poses[here, 0], 'y_center': poses[here, 1], 'yaw': poses[here, 2],
            'vx_center': moves[here, 0], 'vy_center': moves[here, 1], 'speed': speed[here],
            'yaw_rate': moves[here, 2],
            **{name: own[here, column] for name, column in (
                ('x_rear_axle', StateColumn.X), ('y_rear_axle', StateColumn.Y),
                ('acceleration_rear_axle', StateColumn.ACCELERATION),
                ('steering_angle', StateColumn.STEERING_ANGLE),
                ('steering_rate', StateColumn.STEERING_RATE))},
            **_consumed(commands[here])}
        return found | self._lanes(poses, here)

    def _lanes(self, poses: FloatArray, here: NDArray[np.bool_]) -> dict[str, object]:
        """Return lanelet, arc length and lateral offset of all that are present."""
        avs = self._run.game.avs
        transforms = {item.id: item.transform for item in avs}
        on_road = poses.copy()
        for column, item in enumerate(self._run.log.descriptions):
            # All but AVs are placed on the road by the first AV's transform, like humans (CRG 28).
            transform = transforms.get(item.id, avs[0].transform if avs else None)
            if transform is not None and not transform.is_identity:
                on_road[:, column] = transform.to_scenario(poses[:, column])
        wanted = on_road[here]
        places = self._roads.lanelets_at(wanted) if self._roads.lanelet_ids and len(wanted) \
            else np.full(len(wanted), -1)
        s, offset = np.full((2, len(wanted)), np.nan)
        for place in np.unique(places[places >= 0]):
            mine = places == place
            line = self._roads.line(self._roads.lanelet_ids[place])
            s[mine], offset[mine] = line.project(wanted[mine, :2])
        ids = np.array((*self._roads.lanelet_ids, 0), dtype=np.int64)[places]
        return {'lanelet_id': pa.array(ids, INTEGER, mask=places < 0),
                'lane_s': s, 'lane_offset': offset}


def _consumed(commands: FloatArray) -> Mapping[str, object]:
    """Return the columns of the commands consumed (R, 6)."""
    # Putting a vehicle back is an event (`events`).
    found = {name: column for name, column in zip(
        COMMAND_COLUMNS, commands.T, strict=True) if name != 'put_back'}
    shown, reverse = found.pop('lights'), found['reverse']
    lights = np.nan_to_num(shown).astype(int)
    flags = {name: pa.array(lights & light > 0, FLAG, mask=np.isnan(shown)) for name, light in (
        ('left_indicator', Light.LEFT), ('right_indicator', Light.RIGHT), ('horn', Light.HORN))}
    return found | {'reverse': pa.array(reverse > 0.5, FLAG, mask=np.isnan(reverse))} | flags
