# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Runs commonroad-dataset-converter 2025.1.0, in whose environment it is called.

It takes the converter's arguments and prints the name of each scenario once it is written. It
writes every window of a recording: the converter draws the vehicle of the planning problem by lot
and leaves out windows in which it drew a bad one. Whoever calls it chooses the vehicle instead.
"""

from pathlib import Path
import sys

from commonroad.common.file_writer import CommonRoadFileWriter
from crdata.conversion.tabular.factory import TabularConverterFactory
from crdata.main import cli
import pandas

# Of a recording of TUMdot [s].
_TUMDOT_STEP = 0.08
_read, _write = pandas.read_csv, CommonRoadFileWriter.write_to_file


def _read_interaction(path: Path) -> pandas.DataFrame:
    # The converter takes the y axis to point down, as in highD.
    table = _read(path)
    table['vy'] = -table['vy']
    return table


def _read_tumdot(path: Path) -> pandas.DataFrame:
    # The converter divides by the time step and rounds down: 2.32 / 0.08 becomes 28.
    table = _read(path)
    times = table['timestamp'] - table['timestamp'].min()
    table['timestamp'] = ((times / _TUMDOT_STEP).round() + 0.5) * _TUMDOT_STEP
    return table


def _write_and_tell(writer: CommonRoadFileWriter, name: str, *more: object) -> None:
    _write(writer, name, *more)
    print(Path(name).name, flush=True)


if __name__ == '__main__':
    pandas.read_csv = {'interaction': _read_interaction, 'tumdot': _read_tumdot}.get(
        sys.argv[-1], _read)
    CommonRoadFileWriter.write_to_file = _write_and_tell
    TabularConverterFactory.build_job_filter = lambda factory: lambda job: True
    cli()
