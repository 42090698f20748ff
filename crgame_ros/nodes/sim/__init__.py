# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What only the simulation node uses: the live run, its inputs, outputs and control."""
