# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Large evaluations: planners, scenarios, humans and seeds combined, computed on Dask."""
