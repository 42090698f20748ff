# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What sim_node does when a run has ended; the launcher chooses."""

EXIT = 'exit'
# Until a reset or a signal.
STAY = 'stay'
# As `STAY` if the run's game was chosen after the start, else as `EXIT`.
STAY_IF_CHOSEN = 'stay-if-chosen'
