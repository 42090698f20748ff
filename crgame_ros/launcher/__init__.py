# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Starting, watching and ending the whole graph, for `run.sh` and `crgame run`."""
