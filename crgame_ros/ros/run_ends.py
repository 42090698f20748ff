# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The actions of sim_node after a run's end; the launcher chooses one."""

EXIT = 'exit'
# Stay until a reset or a signal.
STAY = 'stay'
# As `STAY` if the run's game was chosen after the start, else as `EXIT`.
STAY_IF_CHOSEN = 'stay-if-chosen'
AT_END = (EXIT, STAY, STAY_IF_CHOSEN)
