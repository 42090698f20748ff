# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Where a study's data come from: files, software, machine, delays, whose questionnaires."""

from collections.abc import Mapping
import hashlib
from pathlib import Path
import statistics
from typing import Any

from crgame_ros.schema.writing import write
from crgame_ros.software import software_with_commit
from crgame_ros.study.data.conducted_study import STUDY
from crgame_ros.study.data.study_data import StudyData
from crgame_ros.study.data.timing_quality import BOUNDS
from crgame_ros.study.trial_plan import conditions_of

# Columns of the table of trials about the picture.
_VIEWS = ('view_across_deg', 'screen_width_m', 'eye_distance_m', 'view_rate_hz')


def provenance_of(data: StudyData) -> dict[str, Any]:
    """
    Return where the data come from: nothing in it changes while the data do not.

    :raises InputError: if a file of the study cannot be read.
    """
    study, folder = data.folder.study, data.folder
    files = sorted(path for path in (folder.path / STUDY).rglob('*') if path.is_file())
    return {
        'study': study.name, 'title': study.title.in_language(study.language),
        'file': folder.relative(folder.study_path), 'seed': study.seed,
        'files': {folder.relative(path): _digest(path) for path in files},
        'data_written_by': software_with_commit(),
        # As the sessions have noted it: more than one where it changed on the way.
        'sessions_run_by': {record.id: record.software for record in data.records},
        'conditions': {f'{block.name}: {condition.name}': _plain(write(condition.settings))
                       for block in study.blocks for condition in conditions_of(study, block)},
        'random_seeds': sorted({row['random_seed'] for row in _rows(data)
                                if row.get('random_seed') is not None}),
        'questionnaires': [{
            'name': scale.name, 'title': scale.title.in_language(study.language),
            'citation': scale.citation, 'scores': [_plain(write(score)) for score in scale.scores]}
            for scale in data.asked.scales()],
        'delays_s': {name: spread([row.get(name) for row in _rows(data)])
                     for name in ('input_delay_s', 'link_delay_s')},
        'timing_bounds': BOUNDS.as_dict(),
        'view': {'geometry': 'docs/driver_view.md',
                 'shown': sorted({row['view'] for row in _rows(data) if row.get('view')}),
                 **{name: spread([row.get(name) for row in _rows(data)]) for name in _VIEWS}},
        'reference_points': {
            'positions and motion of vehicles': 'rear axle',
            'gaps, distances, times to collision': 'footprints, bumper to bumper',
            'lane keeping': 'center'}}


def spread(values: list[float | None]) -> dict[str, float] | None:
    """Return least, median and greatest of what is known; None where nothing is."""
    known = [value for value in values if value is not None]
    return {'min': min(known), 'median': statistics.median(known), 'max': max(known),
            'of': len(known)} if known else None


def _rows(data: StudyData) -> list[Mapping[str, Any]]:
    return [trial.row for trial in data.trials]


def _digest(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


def _plain(value: Any) -> Any:
    """Return values as JSON has them."""
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    return value if isinstance(value, str | int | float | bool | None) else str(value)
