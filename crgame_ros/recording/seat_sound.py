# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What people in the cockpit's seats heard and felt, from what cockpit_node told of it."""

from collections.abc import Mapping
import math
import re
import statistics
from typing import Any

from crgame_ros.messages.status_values import Status, status_truth

_NAME = re.compile(r'cockpit_node: ((?:hv|av)[0-9]{1,3}) sound')


class SeatSound:
    """Sums up the statuses of each seat's sound, which come once a second and at each change."""

    def __init__(self) -> None:
        self._told: dict[str, list[tuple[bool, float, float]]] = {}

    def take(self, status: Status) -> None:
        """Take a status; one of something else, or of somebody who tells no shares, is no news."""
        found = _NAME.fullmatch(status.name)
        if found is None:
            return
        values = status.values
        volume, rumble = _share(values, 'volume'), _share(values, 'rumble')
        if volume is not None and rumble is not None:
            told = (status_truth(values, 'on'), volume, rumble)
            self._told.setdefault(found[1], []).append(told)

    def as_dict(self) -> dict[str, dict[str, Any]]:
        """
        Return by seat: the share of the statuses that had it on, median volume then, and rumble.

        :return: `on_share`, `volume` (null if it was never on) and `rumble`, each 0 to 1.
        """
        summary = {}
        for seat, told in sorted(self._told.items()):
            volumes = [volume for on, volume, _ in told if on]
            summary[seat] = {
                'on_share': round(len(volumes) / len(told), 3),
                'volume': statistics.median(volumes) if volumes else None,
                'rumble': statistics.median(rumble for _, _, rumble in told)}
        return summary


def _share(values: Mapping[str, str], name: str) -> float | None:
    try:
        share = float(values.get(name, ''))
    except ValueError:
        return None
    return share if math.isfinite(share) and 0.0 <= share <= 1.0 else None
