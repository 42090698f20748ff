# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
What commonroad-crime says of pairs of obstacles.

compare_crime.py runs it in an environment of its own. It reads what is asked from stdin, and
writes a line that begins with @: lists of values, None where it failed.
"""

from collections.abc import Iterable
import json
import math
from pathlib import Path
import sys
from typing import Any

from commonroad.common.file_reader import CommonRoadFileReader
from commonroad_crime.data_structure.configuration import CriMeConfiguration
from commonroad_crime.measure.time.pet import PET
from commonroad_crime.measure.time.thw import THW
from commonroad_crime.measure.time.ttc import TTC


def compute(measure: Any, scenario: Any, asked: Iterable[dict[str, Any]]) -> list[float | None]:
    """Return its value of each pair at a step; None where it fails."""
    found: list[float | None] = []
    for each in asked:
        try:
            configuration = CriMeConfiguration()
            configuration.vehicle.ego_id = each['ego']
            configuration.update(ego_id=each['ego'], sce=scenario)
            value = measure(configuration).compute(each['other'], each['step'], verbose=False)
            found.append(None if value is None or math.isnan(value) else float(value))
        except Exception:
            # Whatever its code stumbles over is told as a failure.
            found.append(None)
    return found


def main() -> None:
    """Answer what is asked."""
    asked = json.load(sys.stdin)
    scenario, _ = CommonRoadFileReader(str(Path(sys.argv[1]))).open(lanelet_assignment=True)
    found = {'thw': compute(THW, scenario, asked['pairs']),
             'ttc': compute(TTC, scenario, asked['pairs']),
             'pet': compute(PET, scenario, asked['crossings'])}
    print(f'\n@{json.dumps(found)}')


if __name__ == '__main__':
    main()
