# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Pictures, and the cockpit's page on an environment."""

import asyncio
import struct
import time
from typing import Any

from aiohttp import ClientSession, WSMsgType
from crgame_ros.cockpit.frames import FrameKind, STATE_COLUMNS
from crgame_ros.gym.driving_env import DrivingEnv
from crgame_ros.gym.parallel_env import ParallelDrivingEnv
from crgame_ros.gym.scene_painter import AGENT, HUMAN, ROAD
import gymnasium
import numpy as np

STILL = np.zeros(2, np.float32)


def test_a_picture_shows_road_agent_and_human_where_they_are() -> None:
    env = gymnasium.make('crgame/CutIn-v0', render_mode='rgb_array')
    env.reset(seed=0)
    before = env.render()
    assert isinstance(before, np.ndarray)
    assert before.shape == (432, 720, 3)
    colours = before.reshape(-1, 3)
    # The agent is in the middle; 4.5 m by 1.6 m at 6 px/m are some 260 px, less the outline.
    assert tuple(before[216, 360]) == AGENT
    assert 180 < (colours == AGENT).all(axis=1).sum() < 270
    assert (colours == ROAD).all(axis=1).mean() > 0.05
    for _ in range(70):
        env.step(STILL)
    after = env.render()
    # By then the human has come into the picture, ahead.
    rows = np.argwhere((np.asarray(after) == HUMAN).all(axis=2))
    assert 150 < len(rows) < 400


def test_several_agents_are_in_one_picture() -> None:
    env = ParallelDrivingEnv(game='two_avs', render_mode='rgb_array')
    env.reset(seed=0)
    picture = env.render()
    assert picture is not None
    assert (picture.reshape(-1, 3) == AGENT).all(axis=1).sum() > 400


async def _watched(url: str) -> tuple[dict[str, Any], list[tuple[float, ...]]]:
    """Open the page's connection; return its documents, and the received states."""
    documents: dict[str, Any] = {}
    states: list[tuple[float, ...]] = []
    async with ClientSession() as session:
        async with session.get(url) as answer:
            assert answer.status == 200
            assert '<html' in await answer.text()
        async with session.ws_connect(f'{url}ws') as socket:
            async for message in socket:
                if message.type is WSMsgType.TEXT:
                    content = message.json()
                    documents[content['type']] = content
                elif message.type is WSMsgType.BINARY:
                    numbers = struct.unpack(f'<{len(message.data) // 8}d', message.data)
                    if numbers[0] == FrameKind.STATE:
                        states.append(numbers)
                if len(states) >= 3 and 'scene' in documents and 'status' in documents:
                    await socket.send_json({'type': 'control', 'action': 'pause', 'id': 1})
                    if 'reply' in documents:
                        return documents, states
    raise AssertionError(f'the page was closed: {documents.keys()}, {len(states)} states')


def test_the_page_shows_the_environment_and_steers_nothing() -> None:
    env = DrivingEnv(game='cut_in', render_mode='human')
    assert env.page is None
    try:
        env.reset(seed=0)
        assert env.page is not None
        assert env.page.startswith('http://127.0.0.1:')

        async def watch() -> tuple[dict[str, Any], list[tuple[float, ...]]]:
            watching = asyncio.create_task(_watched(env.page or ''))
            while not watching.done():
                await asyncio.to_thread(env.step, STILL)
            return await watching

        documents, states = asyncio.run(watch())
        assert documents['scene']['planners'] == {'av0': 'agent'}
        assert documents['status']['run'] == 'running'
        assert not documents['reply']['ok']
        assert 'agent drives' in documents['reply']['text']
        vehicles = np.array(states[-1][6:]).reshape(2, STATE_COLUMNS)
        # 20 m/s, and the engine's position at that step.
        assert vehicles[1, 3] == 20.0
        assert states[-1][2] <= env.agent.game.simulation.n
        env.reset(seed=1)
        # A second of an environment takes a second for a client that watches.
        began_s = time.monotonic()
        for _ in range(5):
            env.step(STILL)
        assert time.monotonic() - began_s > 0.3
    finally:
        env.close()
    assert env.page is None
    slower = DrivingEnv(game='cut_in', render_mode='human', ticks=4)
    try:
        slower.reset(seed=0)
        began_s = time.monotonic()
        for _ in range(2):
            slower.step(STILL)
        # Also if a decision takes several scenario steps.
        assert time.monotonic() - began_s > 0.6
    finally:
        slower.close()
