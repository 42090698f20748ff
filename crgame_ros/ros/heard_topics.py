# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What the recorder has heard of a run so far, as it says itself."""

from crgame_ros.messages.status_values import read_status
from crgame_ros.ros.endpoints import Endpoints

# Subject of the recorder's status, and the value that names the run [ns].
RECORDED = 'recorded topics'
OFFSET = 'clock_offset_ns'


class HeardTopics:
    """
    Listens to the recorder while a run waits for its start.

    Two companions may not know of each other yet, though the simulation knows both: what one says
    would be missing in the recording.

    :param endpoints: of sim_node.
    :param clock_offset_ns: of the run [ns]
    """

    def __init__(self, endpoints: Endpoints, clock_offset_ns: int) -> None:
        self._endpoints = endpoints
        self._offset = str(clock_offset_ns)
        self._slot = endpoints.polled('/diagnostics')
        self._names: set[str] = set()

    def missing(self, wanted: set[str]) -> set[str]:
        """Return the topics of which the recorder has no message yet."""
        while (message := self._slot.pop()) is not None:
            for status in message.status:
                values = read_status(status).values
                if status.name == f'recorder_node: {RECORDED}' \
                        and values.get(OFFSET) == self._offset:
                    self._names.update(values)
        return wanted - self._names

    def close(self) -> None:
        """Listen no more."""
        self._endpoints.release(self._slot)
