# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What a game file says: vehicles, events, objects, perception, traffic; and its documents."""
