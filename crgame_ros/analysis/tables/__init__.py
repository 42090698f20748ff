# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A run as tables that everybody reads, with a data dictionary beside them."""
