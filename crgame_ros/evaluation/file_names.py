# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The names of files and folders in the folder of an evaluation."""

# Its plan and its cells, the files that these need, and the reports of single cells.
GRID_FILE, FILES, REPORTS = 'evaluation.json', 'files', 'reports'
# Settings of a search, and the variants that it has chosen for its evaluation so far, one a line.
SEARCH_FILE, VARIANTS_FILE = 'search.json', 'variants.jsonl'
