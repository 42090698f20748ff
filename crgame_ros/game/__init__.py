# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The content of a game file: vehicles, events, objects, perception, traffic; its documents."""
