# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""One constant force on a wheel's motor, the effect that every driver of wheels has."""

from typing import Protocol

from evdev import ecodes, ff

FULL_LEVEL = 0x7fff
# Of effects, in the kernel's units: a force to the left.
LEFTWARDS = 0x4000
# The kernel ends the force by itself if it is not renewed for so long: of a process that hangs.
LENGTH_MS = 250
RENEWAL_S = 0.05


class ForceDevice(Protocol):
    """What is used of an `evdev.InputDevice`; each call is one ioctl or write."""

    def upload_effect(self, effect: ff.Effect) -> int:
        """Make an effect, or change the one whose id it has; give its id."""

    def write(self, etype: int, code: int, value: int) -> None:
        """Write one event."""

    def erase_effect(self, ff_id: int) -> None:
        """Remove an effect."""


class ForceEffect:
    """
    A constant force that is uploaded once and then changed in place.

    When the descriptor is closed, by whatever end of the process, the kernel removes it.

    :param device: open for writing.
    :raises OSError: if it has no room for an effect, or is gone.
    """

    def __init__(self, device: ForceDevice) -> None:
        self.device = device
        kind = ff.EffectType()
        kind.ff_constant_effect = ff.Constant(0, ff.Envelope(0, 0, 0, 0))
        self._effect = ff.Effect(ecodes.FF_CONSTANT, -1, LEFTWARDS, ff.Trigger(0, 0),
                                 ff.Replay(LENGTH_MS, 0), kind)
        self._renewed_s = float('-inf')
        # The driver's own spring would add to ours; what a device does not have is passed over.
        device.write(ecodes.EV_FF, ecodes.FF_AUTOCENTER, 0)
        device.write(ecodes.EV_FF, ecodes.FF_GAIN, 0xffff)
        self._effect.id = device.upload_effect(self._effect)

    def set(self, level: int, now_s: float) -> None:  # noqa: A003
        """
        Change the force and let it go on.

        :param level: -0x7fff to 0x7fff.
        :param now_s: steady clock [s]
        :raises OSError: if the device is gone.
        """
        self._effect.u.ff_constant_effect.level = max(-FULL_LEVEL, min(FULL_LEVEL, level))
        self.device.upload_effect(self._effect)
        if now_s - self._renewed_s >= RENEWAL_S:
            self._renewed_s = now_s
            self.device.write(ecodes.EV_FF, self._effect.id, 1)

    def remove(self) -> None:
        """
        End the force.

        :raises OSError: if the device is gone.
        """
        self.device.write(ecodes.EV_FF, self._effect.id, 0)
        self.device.erase_effect(self._effect.id)
