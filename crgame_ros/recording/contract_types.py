# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Which type of message a topic of a run has, by the contract."""

import functools
import re

from crgame_ros.messages.contract import load_contract

_VEHICLE = re.compile(r'/(hv|av)\d{1,3}(/.+)')


@functools.lru_cache(maxsize=4096)
def contract_type(topic: str) -> str | None:
    """Return package/msg/Type of a topic; None for a topic that is none of a run."""
    topics = load_contract().topics
    names = [topic]
    vehicle = _VEHICLE.fullmatch(topic)
    if vehicle is not None:
        names += [f'/<{vehicle.group(1)}>{vehicle.group(2)}', f'/<v>{vehicle.group(2)}']
    return next((topics[name].type_name for name in names if name in topics), None)


def is_foreign(topic: str, type_name: str) -> bool:
    """Return whether a message cannot be one of a run: another type on a topic of the contract."""
    return contract_type(topic) not in (None, type_name)
