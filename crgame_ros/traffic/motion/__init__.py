# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The motion of an agent along its lane and across it: lane changes, swerving, narrow places."""
