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
"""
The launcher as a study starts it: it ends, in good order, when whoever started it has died.

    python -m crgame_ros.study.conduct.watched_launcher PARENT ARGUMENTS
"""

import ctypes
import os
import signal
import sys

from crgame_ros.launcher.main import main
from crgame_ros.ros.node_main import PR_SET_PDEATHSIG

if __name__ == '__main__':
    ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGTERM)
    if os.getppid() != int(sys.argv[1]):
        sys.exit('whoever started this is gone')
    sys.exit(main(sys.argv[2:]))
