# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The streams of a run for other programs, as LSL outlets."""

from collections.abc import Sequence
import platform
from typing import Any

from crgame_ros.game.instruments_spec import InstrumentsSpec
from crgame_ros.instruments.loopback import CONFIGURATION, on_loopback
from crgame_ros.instruments.stream_description import StreamDescription
from crgame_ros.version import __version__

# Begins the ids of streams of this package.
OWN = 'crgame_ros/'


def configure(spec: InstrumentsSpec) -> None:
    """Keep liblsl on this machine, unless the game opens it; before all else of liblsl."""
    if spec.scope == 'machine':
        import pylsl
        pylsl.set_config_content(CONFIGURATION)


class Outlet:
    """
    A stream.

    :param stream: its description.
    :param domain: the ROS domain: two runs on one machine send different streams.
    :param local: whether it stays on this machine.
    :raises CrgameError: if it cannot.
    """

    def __init__(self, stream: StreamDescription, domain: str, local: bool) -> None:
        import pylsl
        self.source_id = f'{OWN}{platform.node()}/{domain}/{stream.name}'
        info = pylsl.StreamInfo(
            stream.name, stream.type, len(stream.channels), stream.rate_hz or
            pylsl.IRREGULAR_RATE, pylsl.cf_string if stream.texts else pylsl.cf_double64,
            self.source_id)
        _describe(info, stream)
        self._outlet: Any = on_loopback(lambda: pylsl.StreamOutlet(info)) if local \
            else pylsl.StreamOutlet(info)

    def push(self, values: Sequence[float] | Sequence[str], steady_s: float) -> None:
        """Send a sample with its time on the steady clock [s]."""
        self._outlet.push_sample(values, steady_s)


def _describe(info: Any, stream: StreamDescription) -> None:
    """Describe the channels as XDF has it (https://github.com/sccn/xdf/wiki/Meta-Data)."""
    channels = info.desc().append_child('channels')
    for channel in stream.channels:
        entry = channels.append_child('channel')
        entry.append_child_value('label', channel.name)
        entry.append_child_value('unit', channel.unit)
        entry.append_child_value('type', channel.what)
    made_by = info.desc().append_child('acquisition')
    made_by.append_child_value('manufacturer', 'crgame_ros')
    made_by.append_child_value('version', __version__)
