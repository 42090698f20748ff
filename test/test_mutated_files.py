# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A seeded sample of `benchmarks/mutated_files.py`, which breaks files of every kind."""

from collections import Counter
from collections.abc import Iterator
import gc
from pathlib import Path
import sys
from typing import Any

import pytest

BENCHMARKS = Path(__file__).resolve().parents[1] / 'benchmarks'
SMALL = ('ZAM_Over-1_1', 'DEU_Test-1_1_T-1', 'more/ZAM_Zip-2_1_T-1', 'more/DEU_Gar-1_1_T-1',
         'more/GRL_Nuuk-6', 'more/DEU_Moabit-4_1_T-1', 'more/ZAM_Urban-3_3_Repair')

pytestmark = [
    pytest.mark.skipif(not BENCHMARKS.is_dir(), reason='part of the source tree only'),
    pytest.mark.exhaustive]


@pytest.fixture(scope='module')
def mutated_files() -> Iterator[Any]:
    """Import the benchmark."""
    sys.path.insert(0, str(BENCHMARKS))
    import mutated_files
    yield mutated_files
    # Garbage that a harness has frozen.
    gc.unfreeze()
    sys.path.remove(str(BENCHMARKS))


def test_broken_files_of_every_kind_are_refused_in_one_line_or_run(
        mutated_files: Any, shared_scenarios: Path, tmp_path: Path) -> None:
    """None ends in a traceback, a wrong result, 10 s or 1 GiB; both outcomes are common."""
    published = [shared_scenarios / f'{name}.xml' for name in SMALL]
    harness = mutated_files.Harness(tmp_path, 3, published)
    kinds: Counter[str] = Counter()
    counts: Counter[str] = Counter()
    for number in range(120):
        case = harness.case(number)
        assert case.outcome.is_good, case
        kinds[case.kind] += 1
        counts[case.outcome.kind] += 1
    assert len(kinds) > 12 and min(counts['loaded'], counts['refused']) > 30


def test_sound_files_of_every_kind_are_loaded(mutated_files: Any, tmp_path: Path) -> None:
    """Otherwise a refusal would prove nothing."""
    harness = mutated_files.Harness(tmp_path, 0)
    for kind in harness.kinds:
        case = harness.case(1, kind)
        assert case.outcome.kind == 'loaded', case
