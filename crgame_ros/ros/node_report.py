# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The status of a companion node, published once a second on /diagnostics."""

from collections.abc import Mapping
import time

from crgame_ros.ros.endpoints import Endpoints
from diagnostic_msgs.msg import DiagnosticStatus
import numpy as np

PERIOD_S = 1.0


class NodeReport:
    """
    The durations of pieces of work, and a status published once a second.

    :param endpoints: of the node.
    :param name: of the status: node and subject.
    """

    def __init__(self, endpoints: Endpoints, name: str) -> None:
        self._diagnostics = endpoints.diagnostics
        self._name = name
        self._durations_s: list[float] = []
        self._sent_s = 0.0

    def worked(self, duration_s: float) -> bool:
        """Note the duration of a piece of work [s]; return whether a report is due."""
        self._durations_s.append(duration_s)
        return time.monotonic() - self._sent_s > PERIOD_S

    def publish(self, text: str, values: Mapping[str, object], stamp_ns: int) -> None:
        """
        Publish a status, with the times of the work since the last one.

        :param stamp_ns: simulation time [ns]
        """
        self._sent_s = time.monotonic()
        times_ms = 1e3 * np.array(self._durations_s or [0.0])
        self._durations_s.clear()
        work = {'work_ms_median': f'{np.median(times_ms):.3f}',
                'work_ms_worst': f'{times_ms.max():.3f}'}
        self._diagnostics.publish(self._name, DiagnosticStatus.OK, text, {**values, **work},
                                  stamp_ns)
