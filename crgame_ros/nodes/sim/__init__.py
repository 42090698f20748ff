# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Parts of the simulation node alone: the live run, its inputs, outputs and control."""
