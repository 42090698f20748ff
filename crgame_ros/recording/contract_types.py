# Copyright 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.
"""Which type of message a topic of a run has, by the contract."""

import functools
import re

from crgame_ros.messages.contract import load_contract

_VEHICLE = re.compile(r'/(hv|av)\d{1,3}(/.+)')


@functools.lru_cache(maxsize=4096)
def contract_type(topic: str) -> str | None:
    """Give package/msg/Type of a topic; None for a topic that is none of a run."""
    topics = load_contract().topics
    names = [topic]
    vehicle = _VEHICLE.fullmatch(topic)
    if vehicle is not None:
        names += [f'/<{vehicle.group(1)}>{vehicle.group(2)}', f'/<v>{vehicle.group(2)}']
    return next((topics[name].type_name for name in names if name in topics), None)


def is_foreign(topic: str, type_name: str) -> bool:
    """Tell whether a message cannot be one of a run: another type on a topic of the contract."""
    return contract_type(topic) not in (None, type_name)
