# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What an AV knows of the world: imperfect localisation and sensing (FS II-B)."""
