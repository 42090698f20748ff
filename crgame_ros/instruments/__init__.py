# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Other instruments of a laboratory: streams of LSL out and in, triggers, and their clocks."""
