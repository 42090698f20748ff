# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Starts the launcher for a study; it shuts down cleanly when its parent process has died.

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
        sys.exit('the parent process has ended')
    sys.exit(main(sys.argv[2:]))
