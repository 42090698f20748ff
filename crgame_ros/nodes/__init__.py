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
"""One thin ROS 2 node per file."""

import os
import signal
import sys

from crgame_ros.errors import CrgameError
from crgame_ros.ros.environment import require_ros

# A node imports for half a second before it can end in good order (`StopFlag`): until then Ctrl-C
# ends it without a traceback. Only in a process that is a node, of which this is the first import.
if sys.argv[0] == '-m' or sys.argv[0].removesuffix('.py').endswith('_node'):
    signal.signal(signal.SIGINT, lambda _number, _frame: os._exit(130))
    try:
        require_ros()
    except CrgameError as error:
        sys.exit(f'error: {error}')
