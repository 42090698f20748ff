# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The contacts of a recorded run, named as those of an offline run are."""

from collections.abc import Sequence

from crgame_ros.drivability.monitor import VehicleDrivability
from crgame_ros.errors import InputError
from crgame_ros.game.events import FiredEvent
from crgame_ros.messages.joints import vehicles_from_joints
from crgame_ros.messages.world_messages import OBJECT_STATES_TOPIC, VEHICLES_TOPIC
from crgame_ros.recording.epochs import Epoch
from crgame_ros.recording.reader import BagReader
from crgame_ros.recording.run_points import read_points
from crgame_ros.simulation.contacts import Contact, find_contacts, Motions
from crgame_ros.vehicle.state import StateColumn
import numpy as np
from numpy.typing import NDArray


def recorded_contacts(reader: BagReader, run: Epoch, verdicts: Sequence[VehicleDrivability],
                      fired: Sequence[FiredEvent]) -> tuple[Contact, ...]:
    """
    Find the contacts of a recorded run.

    :param verdicts: of the run's vehicles as they were recorded, in order.
    :param fired: the run's events.
    :raises InputError: if the motion that led to one of them was not recorded.
    """
    known = {item.id for item in run.descriptions}
    told: set[tuple[str, str]] = set()
    touching = []
    for verdict in verdicts:
        # Heartbeats repeat a contact, also after the last state.
        new = tuple(name for name in verdict.hit
                    if name in known and (verdict.vehicle_id, name) not in told)
        if new:
            told.update((verdict.vehicle_id, name) for name in new)
            touching.append(verdict._replace(hit=new))
    stops = [event for event in fired if event.touching and known.issuperset(event.touching)]
    steps = [(verdict.n, verdict.vehicle_id, verdict.hit[0]) for verdict in touching]
    steps += [(event.n, *event.touching) for event in stops if event.touching]
    if not steps:
        return ()
    motions = _read_motions(reader, run)
    recorded = np.flatnonzero(np.isfinite(motions.vehicle_states).all(axis=(1, 2)))
    for n, vehicle, other in steps:
        if not recorded[0] <= n <= recorded[-1]:
            raise InputError(f'no states of step {n}, at which {vehicle} touches {other}',
                             str(reader.path), 'record from before the start of the run')
    return find_contacts(motions, touching, stops)


def _read_motions(reader: BagReader, run: Epoch) -> Motions:
    vehicles = [item.id for item in run.descriptions if item.role.is_ego]
    objects = [item.id for item in run.descriptions if not item.role.is_ego]
    points = read_points(reader, run, {VEHICLES_TOPIC: vehicles, OBJECT_STATES_TOPIC: objects})
    for topic, ids in ((VEHICLES_TOPIC, vehicles), (OBJECT_STATES_TOPIC, objects)):
        if ids and not points[topic]:
            raise InputError(f'no {topic} in it', str(reader.path), 'record this topic too')
    ns = np.array(sorted(points[VEHICLES_TOPIC]))
    joints = np.array([points[VEHICLES_TOPIC][n] for n in ns.tolist()])
    joints = joints.reshape(len(ns), 3, len(vehicles), 4)
    object_ns = np.array(sorted(points[OBJECT_STATES_TOPIC]), dtype=np.int64)
    others = np.array([points[OBJECT_STATES_TOPIC][n] for n in object_ns.tolist()])
    others = others.reshape(len(object_ns), 3, len(objects), 3)
    return Motions(
        run.descriptions,
        {av.id: av.vehicle.max_acceleration for av in run.game.avs},
        run.game.scheduler,
        _every_step(vehicles_from_joints(joints[:, 0], joints[:, 1], joints[:, 2]), ns),
        object_ns, others[:, 0], others[:, 1])


def _every_step(states: NDArray[np.float64], ns: NDArray[np.int64]) -> NDArray[np.float64]:
    """Return states (n + 1, V, 8) at every step, those between messages by interpolation."""
    if len(ns) == ns[-1] + 1:
        return states
    turned = states.copy()
    turned[:, :, StateColumn.YAW] = np.unwrap(states[:, :, StateColumn.YAW], axis=0)
    steps = np.arange(ns[-1] + 1)
    columns = [np.interp(steps, ns, column, left=np.nan)
               for column in turned.reshape(len(ns), -1).T]
    return np.column_stack(columns).reshape(len(steps), *states.shape[1:])
