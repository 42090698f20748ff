# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Runs the planned comparisons of a study on rows of its trials, recorded or simulated."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
import math
from typing import Any

from crgame_ros.study.analysis.paired_test import holm, paired_test, PairedTest
from crgame_ros.study.analysis.unpaired_test import unpaired_test, UnpairedTest
from crgame_ros.study.file import StudyFile
from crgame_ros.study.planned_analysis import Comparison
import numpy as np

FLAGS = ('timing_flag', 'page_flag')


@dataclass(frozen=True)
class PlannedTest:
    """
    A test of the planned analysis.

    :param comparison: that it belongs to.
    :param pair: the compared levels: the difference is the second less the first.
    :param test: its result: within participants, or between groups.
    :param p_holm: the p-value of the t-test, corrected in its family.
    """

    comparison: Comparison
    pair: tuple[str, str]
    test: PairedTest | UnpairedTest
    p_holm: float


def used_rows(study: StudyFile, rows: Iterable[Mapping[str, Any]]) -> list[Mapping[str, Any]]:
    """Return the trials that the planned analysis uses: none of staircases."""
    stepped = {block.name for block in study.blocks if block.staircase is not None}
    flags = () if study.analysis.flagged == 'use' else FLAGS
    return [row for row in rows if row.get('block') not in stepped
            and not any(row.get(flag) for flag in flags)]


def level_means(rows: Iterable[Mapping[str, Any]], column: str,
                measure: str) -> dict[str, dict[str, float]]:
    """
    Compute each participant's mean of a measure in each level, over all trials of the level.

    :param column: of the factor.
    :return: by level and participant; missing and infinite values are left out.
    """
    sums: dict[str, dict[str, list[float]]] = {}
    for row in rows:
        value, level = row.get(measure), row.get(column)
        if value is None or level is None or not math.isfinite(value):
            continue
        sums.setdefault(level, {}).setdefault(row['participant'], []).append(float(value))
    return {level: {person: sum(values) / len(values) for person, values in people.items()}
            for level, people in sums.items()}


def planned_tests(study: StudyFile, rows: Sequence[Mapping[str, Any]],
                  columns: Mapping[str, str]) -> list[PlannedTest]:
    """
    Run all planned comparisons.

    A participant's value in a level is the mean over its trials in the level. Within
    participants, one without a value in one of both levels is not in that test.

    :param rows: of the table of trials.
    :param columns: of the factors, by their names.
    """
    factors = {factor.name: factor for factor in study.all_factors}
    rows = used_rows(study, rows)
    alpha = study.analysis.alpha
    found: list[tuple[Comparison, tuple[str, str], PairedTest | UnpairedTest]] = []
    for comparison in study.analysis.comparisons:
        means = level_means(rows, columns[comparison.factor], comparison.measure)
        for pair in comparison.pairs(factors[comparison.factor]):
            first, second = (means.get(level, {}) for level in pair)
            if comparison.factor == study.between:
                found.append((comparison, pair, unpaired_test(
                    np.array([first[person] for person in sorted(first)]),
                    np.array([second[person] for person in sorted(second)]),
                    comparison.alternative, alpha)))
                continue
            people = sorted(first.keys() & second.keys())
            found.append((comparison, pair, paired_test(
                np.array([first[person] for person in people]),
                np.array([second[person] for person in people]), comparison.alternative, alpha)))
    families: dict[int | None, list[int]] = {}
    for place, (comparison, _, _) in enumerate(found):
        family = None if study.analysis.family == 'analysis' else id(comparison)
        families.setdefault(family, []).append(place)
    corrected = [math.nan] * len(found)
    for places in families.values():
        for place, p in zip(places, holm([found[each][2].p for each in places]), strict=True):
            corrected[place] = p
    return [PlannedTest(*each, p) for each, p in zip(found, corrected, strict=True)]
