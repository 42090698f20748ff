# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Steps of highway-env, timed in a Python of its own.

`gym.py` calls this with a JSON line for each environment on the standard input: `id`, `config` and
`steps`. The answer is a JSON line: processor time of a step [s], without resets.
"""

import json
import sys
import time
from typing import Any

import gymnasium
import highway_env  # noqa: F401 - registers its environments
import numpy as np

made: dict[str, Any] = {}
for line in sys.stdin:
    asked = json.loads(line)
    key = json.dumps([asked['id'], asked['config']])
    if key not in made:
        # Without Gymnasium's own checks of every step, as ours.
        made[key] = gymnasium.make(asked['id'], config=asked['config'],
                                   disable_env_checker=True)
        made[key].reset(seed=0)
    env = made[key]
    spent, action = 0.0, np.zeros(2, np.float32)
    for _ in range(asked['steps']):
        start = time.process_time()
        _, _, terminated, truncated, _ = env.step(action)
        spent += time.process_time() - start
        if terminated or truncated:
            env.reset()
    print(json.dumps(spent / asked['steps']), flush=True)
