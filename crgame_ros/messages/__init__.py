# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The layout of messages between processes: the contract, joints, plans, CDR."""
