# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Runs by the thousand: planner, scenario, human and seed crossed, on Dask."""
