# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Steps of the world are put together in order, also if half of one is lost or late."""

from collections.abc import Callable, Iterator, Mapping
import time

from crgame_ros.game.documents import GAME, OBJECTS
from crgame_ros.game.game import load_game
from crgame_ros.messages.joints import object_joint_names, vehicle_joint_names
from crgame_ros.ros.endpoints import Endpoints
from crgame_ros.ros.messages import StateMessage
from crgame_ros.ros.scenario_documents import DocumentCollector, KINDS, ScenarioSet
from crgame_ros.ros.world_follower import WorldFollower, WorldStep
from crgame_ros.simulation.run_texts import describe_game
from crgame_ros.simulation.setup import build_setup
from live_support import PATIENCE_S, SCENARIOS
import numpy as np
import pytest
import rclpy
from rclpy.context import Context
from rclpy.node import Node
from std_msgs.msg import String

STATES = '/vehicles/tick_state'


@pytest.fixture(scope='module')
def scenario() -> ScenarioSet:
    """Return the documents of a game with recorded traffic."""
    setup = build_setup(load_game(SCENARIOS / 'traffic.yaml'))
    collector = DocumentCollector()
    collector.add('xml', setup.loaded.xml_text)
    collector.add('objects', OBJECTS.write(setup.descriptions))
    collector.add('game', GAME.write(describe_game(setup)))
    documents = collector.complete()
    assert documents is not None and documents.others
    return documents


class Stage:
    """A follower, and what publishes to it."""

    def __init__(self, scenario: ScenarioSet, domain: int) -> None:
        self._context = Context()
        rclpy.init(context=self._context, domain_id=domain)
        self.node: Node = rclpy.create_node('stage', context=self._context)
        endpoints = Endpoints(self.node)
        self._scheduler = scenario.game.scheduler
        self._states = endpoints.publisher(STATES)
        self._objects = endpoints.publisher('/traffic/objects')
        self._state = StateMessage([name for item in scenario.driven
                                    for name in vehicle_joint_names(item.id)])
        self._object = StateMessage([name for item in scenario.others
                                     for name in object_joint_names(item.id)])
        self.follower = WorldFollower(endpoints, STATES)
        self.follower.follow(scenario)
        self._documents = {kind: endpoints.publisher(f'/scenario/{kind}') for kind in KINDS}
        self.steps: list[WorldStep] = []
        self.wait(lambda: all(item.get_subscription_count() == 1
                              for item in (self._states, self._objects)))

    def wait(self, condition: Callable[[], bool]) -> None:
        until_s = time.monotonic() + PATIENCE_S
        while not condition():
            assert time.monotonic() < until_s
            time.sleep(0.01)

    def documents(self, texts: Mapping[str, str]) -> None:
        """Publish a game's documents."""
        for kind, text in texts.items():
            self._documents[kind].publish(String(data=text))

    def state(self, k: int) -> None:
        """Publish the vehicles' places at tick k."""
        n = k * self._scheduler.steps_per_tick
        self._states.publish(self._state.stamp(self._scheduler.stamp_ns(n)))

    def objects(self, k: int) -> None:
        """Publish the objects' places at tick k: all at x = k."""
        n = k * self._scheduler.steps_per_tick
        self._object.positions[:] = k
        self._objects.publish(self._object.stamp(self._scheduler.stamp_ns(n)))

    def follow(self, count: int) -> list[tuple[int, float]]:
        """Wait for so many steps in all, and return tick and objects of each."""
        self.wait(lambda: len(self.take()) >= count)
        time.sleep(0.1)
        return [(step.n // self._scheduler.steps_per_tick, float(step.objects.poses[0, 0]))
                for step in self.take()]

    def take(self) -> list[WorldStep]:
        """Receive the complete steps."""
        self.steps += self.follower.steps()
        return self.steps

    def close(self) -> None:
        """End it."""
        self.node.destroy_node()
        rclpy.try_shutdown(context=self._context)


@pytest.fixture
def stage(scenario: ScenarioSet, ros_domain: int) -> Iterator[Stage]:
    found = Stage(scenario, ros_domain)
    yield found
    found.close()


def test_states_wait_for_the_objects_of_their_tick(stage: Stage) -> None:
    stage.objects(0)
    stage.state(0)
    stage.state(1)
    assert stage.follow(1) == [(0, 0.0)]
    stage.objects(1)
    assert stage.follow(2) == [(0, 0.0), (1, 1.0)]
    assert all(step.tick and np.isfinite(step.states).all() for step in stage.steps)


def test_a_tick_whose_objects_are_lost_holds_up_nothing(stage: Stage) -> None:
    """This happens at the start: the subscriber of objects may be matched later than the other."""
    stage.state(0)
    stage.state(1)
    stage.objects(1)
    # Before anything was heard of the objects there is no world.
    assert stage.follow(1) == [(1, 1.0)]
    for k in (2, 3):
        stage.state(k)
    stage.objects(3)
    # Of tick 2 the last known ones.
    assert stage.follow(3) == [(1, 1.0), (2, 1.0), (3, 3.0)]


def test_a_single_state_from_far_ahead_is_dropped(stage: Stage) -> None:
    """One message must not move the world by hours: time jumps only where others follow."""
    for k in (0, 1):
        stage.objects(k)
        stage.state(k)
    stage.state(200_000)
    for k in (2, 3):
        stage.objects(k)
        stage.state(k)
    assert [k for k, _ in stage.follow(4)] == [0, 1, 2, 3]


def test_a_run_that_goes_on_far_ahead_is_followed_without_a_gap(stage: Stage) -> None:
    """A node may hear nothing for a while; the first states that it hears then are kept."""
    for k in (0, 1, 100, 101, 102, 103):
        stage.objects(k)
        stage.state(k)
    assert [k for k, _ in stage.follow(6)] == [0, 1, 100, 101, 102, 103]


def test_a_run_that_is_played_again_begins_before_its_steps(stage: Stage) -> None:
    begun: list[int] = []
    stage.follower.begin = lambda: begun.append(len(stage.steps))
    for k in (100, 101, 102):
        stage.objects(k)
        stage.state(k)
    stage.follow(3)
    assert begun == []
    # The first ones could be errors: time runs back where three agree.
    for k in (0, 1, 2):
        stage.state(k)
    stage.wait(lambda: len(stage.take()) == 3 and len(begun) > 0)
    for k in (2, 3):
        stage.objects(k)
    stage.state(3)
    assert [k for k, _ in stage.follow(5)] == [100, 101, 102, 2, 3]
    assert begun == [3]


def test_a_game_begins_once_with_its_documents(stage: Stage, scenario: ScenarioSet) -> None:
    """States that came before them are kept: those of a run begin with it."""
    follower = stage.follower
    begun: list[ScenarioSet | None] = []
    follower.scenario, follower.begin = None, lambda: begun.append(follower.scenario)
    stage.objects(0)
    stage.state(0)
    time.sleep(0.2)
    assert stage.take() == [] and begun == []
    stage.documents(scenario.texts)

    def looked() -> bool:
        follower.look()
        return bool(begun)

    stage.wait(looked)
    follower.look()
    assert len(begun) == 1 and begun[0] is follower.scenario is not None
    assert [k for k, _ in stage.follow(1)] == [0]
