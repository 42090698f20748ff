# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The topics of a run that the recorder reports as received."""

from crgame_ros.messages.status_values import read_status
from crgame_ros.ros.endpoints import Endpoints

# Subject of the recorder's status, and the value that names the run [ns].
RECORDED = 'recorded topics'
OFFSET = 'clock_offset_ns'


class HeardTopics:
    """
    The recorder's reports while a run waits for its start.

    A message that comes before the bag of its run is open is recorded with the previous run, if
    there is one. And two companions may not have discovered each other yet, though the simulation
    has discovered both. The recording would then lack the messages of one.
    """

    def __init__(self, endpoints: Endpoints, clock_offset_ns: int) -> None:
        self._endpoints = endpoints
        self._offset = str(clock_offset_ns)
        self._slot = endpoints.polled('/diagnostics')
        self._names: set[str] = set()

    def has_begun(self) -> bool:
        """Return whether the recorder has opened a bag for the run."""
        self._listen()
        return bool(self._names)

    def missing(self, wanted: set[str]) -> set[str]:
        """Return the topics from which the recorder has no message yet."""
        self._listen()
        return wanted - self._names

    def _listen(self) -> None:
        for message in self._slot.waiting():
            for status in message.status:
                values = read_status(status).values
                if status.name == f'recorder_node: {RECORDED}' \
                        and values.get(OFFSET) == self._offset:
                    self._names.update(values)

    def close(self) -> None:
        """Release the subscription."""
        self._endpoints.release(self._slot)
