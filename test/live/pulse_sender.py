# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Another program of a laboratory: it hears the run's clock and sends a pulse at every tenth stamp.

    python pulse_sender.py NAME FILE

A pulse's value is the stamp [s]. Its time is when the simulation published this stamp, by the
system clock, carried over to LSL's clock. FILE gets a line for each pulse that somebody was
connected to receive: the stamp [ns], and when it was on the kernel's own steady clock [s].
"""

import ctypes
from pathlib import Path
import platform
import sys
import time

from crgame_ros.instruments.outlets import CONFIGURATION
from crgame_ros.ros.environment import prepare_environment
import pylsl

EVERY = 10
# Longest time for reading several clocks [s].
TOGETHER_S = 5e-5
# Of clock_gettime on x86-64 and ARM.
CLOCK_GETTIME = {'x86_64': 228, 'aarch64': 113}[platform.machine()]


def kernel_steady_s() -> float:
    """Ask the kernel itself for its steady clock [s], whatever is loaded before the library."""
    now = (ctypes.c_long * 2)()
    assert ctypes.CDLL(None).syscall(CLOCK_GETTIME, time.CLOCK_MONOTONIC, now) == 0
    return now[0] + 1e-9 * now[1]


def moment() -> tuple[float, float, float]:
    """Read LSL's, the kernel's steady and the system clock [s] together, however busy it is."""
    while True:
        before_s = kernel_steady_s()
        foreign_s, system_s = pylsl.local_clock(), time.time()
        after_s = kernel_steady_s()
        if after_s - before_s < TOGETHER_S:
            return foreign_s, 0.5 * (before_s + after_s), system_s


def main(name: str, file: Path) -> None:
    """Send until killed."""
    prepare_environment()
    import rclpy
    from rosgraph_msgs.msg import Clock
    pylsl.set_config_content(CONFIGURATION)
    info = pylsl.StreamInfo(name, 'Pulses', 1, 0, pylsl.cf_double64, f'device {name}')
    info.set_channel_labels(['stamp'])
    info.set_channel_units(['s'])
    outlet = pylsl.StreamOutlet(info)
    rclpy.init()
    node = rclpy.create_node(f'{name}_sender')
    stamps: set[int] = set()

    def pulse(message: Clock, told: dict[str, int]) -> None:
        stamp_ns = message.clock.sec * 10**9 + message.clock.nanosec
        # The first stamp is repeated until the run starts.
        if stamp_ns in stamps or not outlet.have_consumers():
            return
        stamps.add(stamp_ns)
        if len(stamps) % EVERY:
            return
        foreign_s, steady_s, system_s = moment()
        age_s = system_s - 1e-9 * told['source_timestamp']
        outlet.push_sample([1e-9 * stamp_ns], foreign_s - age_s)
        with file.open('a') as stream:
            stream.write(f'{stamp_ns} {steady_s - age_s!r}\n')

    node.create_subscription(Clock, '/clock', pulse, 1000)
    rclpy.spin(node)


if __name__ == '__main__':
    main(sys.argv[1], Path(sys.argv[2]))
