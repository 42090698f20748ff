# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""One thin ROS 2 node per file."""

import os
import signal
import sys

from crgame_ros.errors import CrgameError
from crgame_ros.ros.environment import require_ros

# A node imports for half a second before it can end in good order (`StopFlag`). Until then Ctrl-C
# ends it without a traceback. This holds only in a node's process, where this is the first import.
if sys.argv[0] == '-m' or sys.argv[0].removesuffix('.py').endswith('_node'):
    signal.signal(signal.SIGINT, lambda _number, _frame: os._exit(130))
    try:
        require_ros()
    except CrgameError as error:
        sys.exit(f'error: {error}')
