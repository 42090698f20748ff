# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Rows of text that compare runs of a recorded human against several planners."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from crgame_ros.analysis.measure_command import TOLD_S

NEVER = '-'
HEAD = ('planner', 'vehicle', 'gap [m]', 'ttc [s]', 'a_req [m/s^2]', 'distance [m]', 'tet [s]',
        'contacts', 'human differs', 'others differ')


def replay_rows(found: Sequence[Mapping[str, Any]]) -> Iterator[tuple[str, ...]]:
    """
    Yield a row for each planner and vehicle, with the cells that `HEAD` names.

    :param found: entries of `Alternative.as_dict`; the entry of the recorded run itself lacks the
        comparison.
    """
    for each in found:
        for vehicle_id, vehicle in each['criticality']['vehicles'].items():
            worst = {name: f'{entry["value"]:.2f}' for name, entry in vehicle['worst'].items()
                     if entry['unit'] != 's' or entry['value'] < TOLD_S}
            touched = [item for item in each.get('contacts') or ()
                       if vehicle_id in (item['vehicle'], item['with'])]
            yield (
                each['planner'], vehicle_id,
                *(worst.get(name, NEVER) for name in ('gap', 'ttc', 'a_req', 'min_distance')),
                f'{vehicle["tet_s"]:.1f}',
                str(len(touched)) if each.get('contacts') is not None else NEVER,
                *(NEVER if each.get(name) is None else f'from {each[name]:.1f} s'
                  for name in ('human_differs_s', 'others_differ_s')))
