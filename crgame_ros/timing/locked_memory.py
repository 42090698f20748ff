# Copyright 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.
"""Keeping the loop's memory: pages that the system took back cost a wait for a disk."""

import ctypes

# Of sys/mman.h: what is there, what will be, each from its first use on.
MCL_CURRENT, MCL_FUTURE, MCL_ONFAULT = 1, 2, 4


def lock_memory() -> bool:
    """
    Ask for the pages of this process, as it comes to use them, to stay in memory.

    :return: whether the system does; it asks for CAP_IPC_LOCK, or for a limit `memlock` in
        /etc/security/limits.d above the whole address space.
    """
    return bool(ctypes.CDLL(None).mlockall(MCL_CURRENT | MCL_FUTURE | MCL_ONFAULT) == 0)
