# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Taking a message together with the id of its publisher, which rclpy does not pass on."""

import ctypes
from functools import cache
from typing import Any, NamedTuple

from rclpy.subscription import Subscription

# Of rcl: a message was taken; there was none.
_OK, _NONE = 0, 401


class _Allocator(ctypes.Structure):
    _fields_ = [(name, ctypes.c_void_p) for name in (
        'allocate', 'deallocate', 'reallocate', 'zero_allocate', 'state')]


class _Bytes(ctypes.Structure):
    """rcutils_uint8_array_t, which is rcl_serialized_message_t."""

    _fields_ = [('buffer', ctypes.c_void_p), ('length', ctypes.c_size_t),
                ('capacity', ctypes.c_size_t), ('allocator', _Allocator)]


class _Gid(ctypes.Structure):
    _fields_ = [('implementation', ctypes.c_char_p), ('data', ctypes.c_uint8 * 16)]


class _Info(ctypes.Structure):
    """rmw_message_info_t."""

    _fields_ = [('source_ns', ctypes.c_int64), ('received_ns', ctypes.c_int64),
                ('publication', ctypes.c_uint64), ('reception', ctypes.c_uint64),
                ('publisher', _Gid), ('from_intra_process', ctypes.c_bool)]


class SentMessage(NamedTuple):
    """
    A serialised message.

    :param published_ns: time of publication [ns since 1970]
    :param received_ns: time of reception [ns since 1970]
    :param publisher: its id, the `endpoint_gid` of rclpy's information on a topic.
    """

    data: bytes
    published_ns: int
    received_ns: int
    publisher: bytes


def take_sent(subscription: Subscription) -> SentMessage | None:
    """
    Remove and return the oldest message of a subscription, None if there is none.

    :raises RuntimeError: if the middleware fails.
    """
    rcl, message = _rcl()
    info = _Info()
    with subscription.handle:
        code = rcl.rcl_take_serialized_message(
            ctypes.c_void_p(subscription.handle.pointer), ctypes.byref(message),
            ctypes.byref(info), None)
    if code == _NONE:
        return None
    if code != _OK:
        raise RuntimeError(f'{subscription.topic_name}: cannot be read (rcl: {code})')
    return SentMessage(ctypes.string_at(message.buffer, message.length), info.source_ns,
                       info.received_ns, bytes(info.publisher.data))


@cache
def _rcl() -> tuple[Any, _Bytes]:
    """Return the library that rclpy has loaded, and a buffer that it fills and enlarges."""
    tools = ctypes.CDLL('librcutils.so')
    tools.rcutils_get_default_allocator.restype = _Allocator
    allocator, message = tools.rcutils_get_default_allocator(), _Bytes()
    if tools.rcutils_uint8_array_init(ctypes.byref(message), ctypes.c_size_t(0),
                                      ctypes.byref(allocator)):
        raise RuntimeError('there is no memory for messages')
    return ctypes.CDLL('librcl.so'), message
