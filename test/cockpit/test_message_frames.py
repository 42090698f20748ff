# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A live node and a replay make the same frames of the same messages and refuse the same."""

from array import array
from typing import Any

from crgame_ros.cockpit.message_frames import Frame, MAX_POINTS, MessageFrames
from crgame_ros.errors import InputError
from crgame_ros.messages.joints import OBJECT_STATES_TOPIC, VEHICLES_TOPIC
from crgame_ros.recording.epochs import read_epoch
from crgame_ros.recording.reader import BagReader
from crgame_ros.ros.message_validator import message_type
from perception_recording import record_perceiving
import pytest
from rclpy.serialization import deserialize_message


class Both(list[tuple[str, Any, Any]]):
    """Return messages of a run as both libraries decode them: topic, rclpy's, rosbags'."""

    def __init__(self, bag: Any) -> None:
        super().__init__()
        with BagReader(bag) as reader:
            self.run = read_epoch(reader)
            for message in reader.messages():
                if message.topic.startswith(('/av0/', '/vehicles/state', '/traffic/objects',
                                             '/occupancy')):
                    self.append((message.topic, deserialize_message(
                        message.data, message_type(message.type_name)),
                        reader.decode(message).message))

    def frames(self) -> MessageFrames:
        return MessageFrames(self.run.game, self.run.descriptions)

    def first(self, topic: str) -> Any:
        return next(live for found, live, _ in self if found == topic)


@pytest.fixture(scope='module')
def both(tmp_path_factory: pytest.TempPathFactory) -> Both:
    """Record a second of a run with perception."""
    return Both(record_perceiving(tmp_path_factory.mktemp('run'), 1.0)[1])


def _made(frames: MessageFrames, topic: str, message: Any) -> list[Frame | None]:
    if topic == '/occupancy':
        return [frames.occupancy(frames.place(0), message)]
    place = frames.place_of(message)
    assert place is not None
    if topic == VEHICLES_TOPIC:
        return [frames.state(place, frames.states(message), None)]
    if topic == OBJECT_STATES_TOPIC:
        return [frames.objects(place, message)]
    _, av, kind = topic.split('/')
    if kind == 'plan_request':
        return [frames.seen(place, av, message), frames.prediction(place, av, message)]
    make = {'plan': frames.plan, 'scan': frames.scan, 'localization': frames.estimate}[kind]
    return [make(place, av, message)]


def test_both_libraries_messages_give_the_same_frames(both: Both) -> None:
    """The frames of every message agree byte by byte; all kinds but plans occur."""
    live, replayed = both.frames(), both.frames()
    slots = set()
    for topic, first, second in both:
        made = _made(live, topic, first)
        assert made == _made(replayed, topic, second)
        slots |= {frame.slot for frame in made if frame is not None}
    assert slots == {'state', 'objects', 'occupancy', 'estimate:1', 'scan:1:0', 'scan:1:1',
                     'seen:1', 'prediction:1'}


def _spoiled(message: Any, how: str) -> Any:
    if how == 'joints':
        message.joint_names = ['av1' + name[3:] for name in message.joint_names]
    elif how == 'positions':
        message.points[0].positions = message.points[0].positions[:-1]
    elif how == 'points':
        message.points = []
    elif how == 'many':
        message.points = [message.points[0]] * (MAX_POINTS + 1)
    return message


@pytest.mark.parametrize('how', ['joints', 'positions', 'points', 'many'])
def test_what_is_no_plan_or_request_is_refused(both: Both, how: str) -> None:
    """Refused are plans for another vehicle, with a short row, no rows, or too many rows."""
    frames, kind = both.frames(), type(both.first('/av0/plan_request'))
    plan = kind(joint_names=[f'av0/{name}' for name in ('x', 'y', 'yaw', 'steering')])
    point = type(both.first('/av0/plan_request').points[0])
    plan.points = [point(positions=array('d', (1.0, 2.0, 0.0, 0.0)),
                         velocities=array('d', (3.0, 4.0, 0.0, 0.0)))]
    place = frames.place(10)
    assert frames.plan(place, 'av0', plan).slot == 'plan:1'
    with pytest.raises(InputError):
        frames.plan(place, 'av0', _spoiled(plan, how))
    # The test spoils a copy of the request, as other tests read the original.
    whole = both.first('/av0/plan_request')
    request = kind(header=whole.header, joint_names=list(whole.joint_names), points=[
        point(positions=item.positions, velocities=item.velocities) for item in whole.points])
    assert frames.prediction(place, 'av0', request).slot == 'prediction:1'
    spoiled = _spoiled(request, how)
    for make in (frames.prediction, frames.seen):
        with pytest.raises(InputError):
            make(place, 'av0', spoiled)
