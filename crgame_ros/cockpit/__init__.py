# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The cockpit: a web page in which people drive, watch and steer a run."""
