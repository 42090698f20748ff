# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Another program of a laboratory: it hears the run's clock and sends a pulse at every tenth stamp.

    python pulse_sender.py NAME FILE

A pulse's value is the stamp [s]. Its time is when the simulation published this stamp, by the
system clock, carried over to LSL's clock. FILE gets a line for each pulse that somebody was
connected to receive.
"""

from pathlib import Path
import sys
import time

from crgame_ros.instruments.loopback import CONFIGURATION
from crgame_ros.ros.environment import prepare_environment
import pylsl

EVERY = 10


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
        age_s = 1e-9 * (time.time_ns() - told['source_timestamp'])
        outlet.push_sample([1e-9 * stamp_ns], pylsl.local_clock() - age_s)
        with file.open('a') as stream:
            stream.write(f'{stamp_ns}\n')

    node.create_subscription(Clock, '/clock', pulse, 1000)
    rclpy.spin(node)


if __name__ == '__main__':
    main(sys.argv[1], Path(sys.argv[2]))
