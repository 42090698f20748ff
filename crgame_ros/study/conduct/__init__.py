# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Sessions of a study as they go on: drives, pages and journal together; and the command."""
