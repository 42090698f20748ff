# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Make the package's own scenarios: `python scripts/make_scenarios.py [--out DIR]`."""

import argparse
from pathlib import Path

from scenario_crossing import crossing
from scenario_engines import blocked_lane, dense_merge, fog, occluded_pedestrian
from scenario_motorways import cut_in, lane_change, merge, traffic, two_avs
from scenario_towns import intersection, parked_cars, roundabout_, t_junction
from scenario_xml import write

SCENARIOS = (cut_in, lane_change, merge, t_junction, intersection, roundabout_, parked_cars,
             two_avs, traffic, crossing, occluded_pedestrian, dense_merge, blocked_lane, fog)


def main() -> None:
    """Write every scenario and name the files."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--out', type=Path, metavar='DIR',
                        default=Path(__file__).resolve().parent.parent / 'scenarios')
    directory: Path = parser.parse_args().out
    directory.mkdir(parents=True, exist_ok=True)
    for scenario in SCENARIOS:
        print(write(scenario(), directory))


if __name__ == '__main__':
    main()
