# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Jobs that read runs for the page, in a process of their own: scores, pictures, reports."""

from collections.abc import Sequence
import math
from pathlib import Path

from crgame_ros.analysis.pictures.frame_svg import frame_svg
from crgame_ros.analysis.pictures.scene_frame import FrameScene
from crgame_ros.analysis.report.file import write_report
from crgame_ros.analysis.runs.run import Run
from crgame_ros.analysis.scores.nuplan import NuplanScore, WEIGHTS
from crgame_ros.analysis.scores.scored_run import scores_of
from crgame_ros.analysis.scores.vehicle import SCORE_MEASURES
from crgame_ros.cockpit.job_process import serve_jobs
from crgame_ros.finite_json import finite
from crgame_ros.recording.run_record import read_run_record, RunRecord
from crgame_ros.recording.run_trajectories import read_trajectories
from crgame_ros.vehicle.state import StateColumn
from crgame_ros.whole_file import write_text
import numpy as np

# Time limit of a job [s]: runs can last hours, and several can be compared.
MOST_CPU_S = 120.0
# Size of a picture [px].
_WIDTH = 420


def score(path: Path) -> dict[str, object]:
    """
    Return the score of a run by nuPlan's measures, which need only the motion of all objects.

    :param path: recording of the run.
    :return: the answer of /api/runs/score.
    :raises InputError: if it cannot be read.
    """
    record = read_run_record(path)
    scores = scores_of(record, {}, drives_only=True)
    return {'vehicles': [
        {'vehicle': each.vehicle_id, 'role': each.role, **_score_values(each.nuplan),
         **_motion(record, number), 'remarks': list(each.remarks)}
        for number, each in enumerate(scores.vehicles)], 'refusal': scores.refusal}


def picture(path: Path, out: str) -> dict[str, object]:
    """
    Draw the end of a run and the paths of the driven vehicles up to it.

    :param path: recording of the run.
    :param out: the file to write, SVG.
    :raises InputError: if it cannot be read.
    """
    log = read_trajectories(path)
    scene = FrameScene(log)
    last = int(log.ks[-1])
    spread = range(0, len(log.ks), max(1, len(log.ks) // 20))
    window = scene.windows([*spread, scene.row(last)])[-1]
    frame = scene.at(last, window, trace_s=math.inf if len(log.ks) < 2 else float(
        len(log.ks) * log.game.scheduler.time_step_s))
    write_text(frame_svg(frame, _WIDTH), Path(out))
    return {}


def compare(path: Path, others: Sequence[str], names: Sequence[str],
            out: str) -> dict[str, object]:
    """
    Write one report of several runs.

    :param path: recording of the first.
    :param others: recordings of the others.
    :param names: readable names of all, in that order.
    :param out: the file to write, HTML.
    :raises InputError: if one of them cannot be read.
    """
    write_report([Run.of_recording(bag, name=name, scoring='drives') for bag, name in zip(
        (path, *map(Path, others)), names, strict=True)], Path(out))
    return {}


def _score_values(found: NuplanScore | None) -> dict[str, object]:
    if found is None:
        return {'score': None, 'parts': []}
    parts = [(name, value, 0.0) for name, value in found.multipliers.items()]
    parts += [(name, value, WEIGHTS[name]) for name, value in found.weighted.items()]
    return {'score': finite(float(found.score)), 'parts': [
        {'name': SCORE_MEASURES[name].label, 'value': finite(float(value)), 'weight': weight,
         'definition': SCORE_MEASURES[name].definition} for name, value, weight in parts]}


def _motion(record: RunRecord, number: int) -> dict[str, object]:
    """Return the distance and the greatest speed of a vehicle [m, m/s]."""
    speeds = record.log.vehicle_states[:, number, StateColumn.SPEED]
    return {'distance': finite(float(record.ways()[number])),
            'fastest': finite(float(np.nanmax(np.abs(speeds), initial=0.0)))}


def main() -> None:
    """Answer jobs until the standard input ends."""
    serve_jobs({'score': score, 'picture': picture, 'compare': compare}, 'run', MOST_CPU_S)


if __name__ == '__main__':
    main()
