# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Columns of the table of vehicles on how they kept traffic rules."""

from collections.abc import Mapping, Sequence

from crgame_ros.analysis.rules.vehicle_rules import RULE_MEASURES
from crgame_ros.analysis.runs.run import Run
from crgame_ros.analysis.tables.column import Column, INTEGER, NUMBER
from crgame_ros.analysis.tables.part import TablePart


def _rules(run: Run) -> Mapping[str, Sequence[object]]:
    return {name: [each.values[name] for each in run.usual_rules] for name in RULE_MEASURES}


VEHICLE_RULES = TablePart(tuple(
    Column(name, INTEGER if measure.is_count else NUMBER, measure.unit, measure.definition,
           measure.reference, measure.variant, measure.empty)
    for name, measure in RULE_MEASURES.items()), _rules)
