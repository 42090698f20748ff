# Copyright 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Everything that traffic runs is compiled, and loaded, before it is needed."""

import json
from pathlib import Path
import subprocess
import sys

# Counts what each compiled function has been compiled or loaded for, before and after drives.
SCRIPT = """
import importlib, json, pkgutil, sys
from pathlib import Path
sys.path[:0] = sys.argv[1:2]
import crgame_ros.traffic
from crgame_ros.traffic.warm_up import drive_everything
modules = [importlib.import_module(f'crgame_ros.traffic.{x.name}')
           for x in pkgutil.iter_modules(crgame_ros.traffic.__path__)]
def count():
    return {f'{x.__module__}.{x.__name__}': len(x.overloads)
            for module in modules for x in vars(module).values() if hasattr(x, 'overloads')}
drive_everything()
before = count()
from traffic_drive import drive
from crgame_ros.traffic.spec import TrafficSpec
for path in sys.argv[2:]:
    drive(Path(path), TrafficSpec(recorded='reactive', agents=30, flow=600.0), 25.0)
print(json.dumps([len(before), {x: n for x, n in count().items() if n != before[x]}]))
"""


def test_a_run_compiles_and_loads_nothing_more(maps: Path,
                                               shared_scenarios: Path) -> None:
    """Lights, junctions, lane changes, swerves, recorded vehicles, parked cars, pedestrians."""
    paths = [shared_scenarios / 'USA_Lanker-1_3_T-1.xml',
             shared_scenarios / 'OSC_PedestrianCollision-1_1_T-1.xml',
             maps / 'ZAM_ParkedCars-1_1_T-1.xml', maps / 'ZAM_Merge-1_1_T-1.xml']
    benchmarks = Path(__file__).resolve().parents[2] / 'benchmarks'
    done = subprocess.run([sys.executable, '-c', SCRIPT, str(benchmarks), *map(str, paths)],
                          capture_output=True, text=True, timeout=240)
    assert done.returncode == 0, done.stderr
    functions, more = json.loads(done.stdout.splitlines()[-1])
    assert functions > 40 and more == {}
