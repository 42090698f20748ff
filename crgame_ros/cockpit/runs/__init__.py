# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The runs of a folder for pages: replay, comparison, download and deletion."""
