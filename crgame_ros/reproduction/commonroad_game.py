# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Repeats CommonRoad-Game's evaluation (CRG section IV): recordings, figures, report."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
import json
import os
from pathlib import Path
import platform
from typing import Any

from crgame_ros.analysis.counterfactual import Alternative
from crgame_ros.analysis.pictures.figure_style import figure_bytes
from crgame_ros.analysis.pictures.frames_figure import frames_figure
from crgame_ros.analysis.pictures.profiles_figure import profiles_figure
from crgame_ros.analysis.pictures.scene_frame import FrameScene
from crgame_ros.analysis.pictures.timing_figure import timing_figure
from crgame_ros.analysis.pictures.timing_table import TIMING_ROWS
from crgame_ros.finite_json import finite
from crgame_ros.paths import scenarios_directory
from crgame_ros.recording.export import write_scenario
from crgame_ros.reproduction.expectation import Judgement
from crgame_ros.reproduction.recorded_human import (
    read_recorded,
    record_offline,
    RecordedHuman,
    run_live,
)
from crgame_ros.reproduction.single_av_evaluation import (
    Encounter,
    judge_multi_av,
    judge_single_av,
    MultiAvRun,
    run_alone,
)
from crgame_ros.reproduction.synchronization import (
    judge_synchronization,
    measure_synchronization,
    PAPER_TABLE,
    Synchronization,
)
from crgame_ros.version import __version__
from crgame_ros.whole_file import write_bytes, write_text
from matplotlib.figure import Figure

# Number of panels, as in the paper. There they are 0.2 s apart; ours cover the whole encounter.
PANELS = 12
# Captions of the figures, by file name: which figure of the paper each corresponds to.
CAPTIONS = {
    'figure_08_idm_frames': 'fig. 8: the IDM planner from the cut-in until the AV stands',
    'figure_09_idm_profiles': 'fig. 9: heading, position and velocity with the IDM planner',
    'figure_10_reactive_frames': 'fig. 10: the reactive planner, until it has passed',
    'figure_11_reactive_profiles': 'fig. 11: profiles with the reactive planner',
    'figure_12_two_avs_idm_frames': 'fig. 12: two AVs, IDM, the whole encounter',
    'figure_13_two_avs_idm_profiles': 'fig. 13: profiles of the two AVs and the human, IDM',
    'figure_12_two_avs_reactive_frames': 'fig. 12: two AVs, reactive, the whole encounter',
    'figure_13_two_avs_reactive_profiles': 'fig. 13: the same with the reactive planner',
    'figure_14_timing': 'fig. 14: timelines and errors of our loop and the naive one'}
NAME, NUMBERS = 'REPRODUCTION.md', 'comparison.json'
# File formats that a Markdown file can show.
_SHOWN = ('.svg', '.png')


def write_timing_figure(found: Synchronization, folder: Path,
                        formats: Sequence[str]) -> tuple[Path, ...]:
    """Draw figure 14 and write table I; return the files."""
    written = _write(timing_figure((found.proposed, found.naive)), folder / 'figure_14_timing',
                     formats)
    table = found.table
    for suffix, text in (('txt', table.text()), ('csv', table.csv()), ('md', table.markdown())):
        path = folder / f'table_1.{suffix}'
        write_text(text, path)
        written.append(path)
    return tuple(written)


def _panel_steps(run: Alternative) -> tuple[int, ...]:
    """Choose scenario steps, equally far apart, from before the cut-in to the AV's answer."""
    ks = run.log.ks
    begin, end = Encounter(run, run.log.game.avs[0].id).steps
    stride = max(1, -(-(end - begin) // (PANELS - 2)))
    first = min(max(0, begin - stride), max(0, len(ks) - 1 - (PANELS - 1) * stride))
    return tuple(ks[first::stride][:PANELS].tolist())


def _write(figure: Figure, place: Path, formats: Sequence[str]) -> list[Path]:
    paths = []
    for file_format in formats:
        path = place.with_name(f'{place.name}.{file_format}')
        write_bytes(figure_bytes(figure, file_format), path)
        paths.append(path)
    return paths


@dataclass(frozen=True)
class EvaluationRequest:
    """
    Settings of a repetition of the evaluation.

    :param folder: folder of all files, which exists.
    :param idm: planner that replaces the IDM planner.
    :param reactive: planner that replaces the reactive planner.
    :param is_live: whether the games are recorded live and the timing is measured.
    :param timed_s: wall time of each loop of the timing experiment [s]
    :param formats: file formats of figures.
    :param say: called with a line of progress, for people.
    """

    folder: Path
    idm: str
    reactive: str
    is_live: bool
    timed_s: float
    formats: Sequence[str]
    say: Callable[[str], object]

    @property
    def runs(self) -> Path:
        """Return the folder of the runs' own files."""
        return self.folder / 'runs'

    def record(self, game: Path) -> RecordedHuman:
        """Drive a game once."""
        if not self.is_live:
            self.say(f'recording {game.stem} offline …')
            return record_offline(game, self.idm)
        self.say(f'recording {game.stem} live, which takes as long as the game …')
        run_live(game, self.idm, self.runs / game.stem)
        return read_recorded(game.stem, self.idm, self.runs / game.stem)

    def repeat(self, recorded: RecordedHuman, planner: str) -> Alternative:
        """Drive the recorded human against a planner."""
        self.say(f'the human of {recorded.name} against {planner} …')
        return recorded.against(planner)


@dataclass(frozen=True)
class EvaluationPart:
    """
    The results of one of the three experiments.

    :param judgements: each expectation with what was found.
    :param numbers: results for JSON.
    :param files: figures and tables.
    """

    judgements: tuple[Judgement, ...]
    numbers: dict[str, object]
    files: tuple[Path, ...]


def evaluate_single_av(request: EvaluationRequest) -> EvaluationPart:
    """
    Repeat CRG section IV-A: figures 8 to 11.

    :raises CrgameError: if a run failed.
    """
    recorded = request.record(scenarios_directory() / 'cut_in.yaml')
    idm, reactive = (request.repeat(recorded, name) for name in (request.idm, request.reactive))
    request.say('drawing figures 8 to 11 …')
    av = recorded.log.game.avs[0].id
    files = (*_pictured(request, idm, (8, 9), 'idm'),
             *_pictured(request, reactive, (10, 11), 'reactive'))
    return EvaluationPart(
        judge_single_av(recorded.log, idm, reactive, recorded.live),
        {name: {'encounter': Encounter(run, av).as_dict(), **run.as_dict()}
         for name, run in (('idm', idm), ('reactive', reactive))}, files)


def evaluate_multi_av(request: EvaluationRequest) -> EvaluationPart:
    """
    Repeat CRG section IV-B: figures 12 and 13.

    :raises CrgameError: if a run failed.
    """
    game = scenarios_directory() / 'two_avs.yaml'
    recorded = request.record(game)
    runs: list[tuple[str, MultiAvRun]] = []
    files: tuple[Path, ...] = ()
    for name, planner in (('IDM', request.idm), ('reactive', request.reactive)):
        run = request.repeat(recorded, planner)
        request.say(f'{game.stem} against {planner} without the human …')
        alone = run_alone(game, planner, recorded.duration_s)
        if recorded.live is not None and not runs:
            runs.append((f'{name}, live', MultiAvRun(recorded.live, alone)))
        runs.append((name, MultiAvRun(run, alone)))
        files += _pictured(request, run, (12, 13), f'two_avs_{name.lower()}')
    return EvaluationPart(
        judge_multi_av(runs),
        {name: {'reactions': run.reactions(), **run.run.as_dict()} for name, run in runs}, files)


def evaluate_timing(request: EvaluationRequest) -> tuple[EvaluationPart, Synchronization]:
    """
    Repeat CRG section IV-C: figure 14 and table I.

    :raises CrgameError: if a run failed.
    """
    request.say(f'timing: the graph, then the naive loop, {request.timed_s:g} s each …')
    found = measure_synchronization(scenarios_directory() / 'cut_in.yaml', request.idm,
                                    request.timed_s, request.runs)
    numbers = {'table_1': found.rows(), 'load': found.load, 'is_valid': found.is_valid}
    return EvaluationPart(judge_synchronization(found), numbers,
                          write_timing_figure(found, request.folder, request.formats)), found


def _pictured(request: EvaluationRequest, run: Alternative, numbers: tuple[int, int],
              name: str) -> tuple[Path, ...]:
    """
    Write a run as a scenario, and draw its frames and profiles; return the figures.

    :param numbers: of the paper's figures of frames and of profiles.
    :param name: name of the run, for the files' names.
    """
    log, folder, formats = run.log, request.folder, request.formats
    request.runs.mkdir(exist_ok=True)
    write_scenario(log, request.runs / f'{name}.xml')
    frames, profiles = numbers
    return (*_write(frames_figure(FrameScene(log), _panel_steps(run)),
                    folder / f'figure_{frames:02}_{name}_frames', formats),
            *_write(profiles_figure(run.record, run.moments[:1]),
                    folder / f'figure_{profiles:02}_{name}_profiles', formats))


def write_report(request: EvaluationRequest, single: EvaluationPart, multi: EvaluationPart,
                 timing: EvaluationPart | None) -> tuple[Path, Path]:
    """
    Write the report and the numbers.

    :param timing: None where it was not measured.
    :return: the two files.
    :raises InputError: if they cannot be written.
    """
    parts = [single, multi, *([] if timing is None else [timing])]
    judgements = [each for part in parts for each in part.judgements]
    numbers = {
        'evaluation': 'commonroad-game', 'version': __version__,
        'mode': 'live' if request.is_live else 'offline',
        'planners': {'idm': request.idm, 'reactive': request.reactive},
        'machine': {'processor': platform.machine(), 'cores': os.cpu_count(),
                    'python': platform.python_version()},
        'met': all(each.is_met for each in judgements),
        'expectations': [asdict(each) for each in judgements],
        'single_av': single.numbers, 'multi_av': multi.numbers,
        **({} if timing is None else timing.numbers)}
    report, data = request.folder / NAME, request.folder / NUMBERS
    write_text(json.dumps(finite(numbers), indent=2) + '\n', data)
    files = [file for part in parts for file in part.files]
    write_text('\n'.join(_lines(request, judgements, numbers, files)) + '\n', report)
    return report, data


def _lines(request: EvaluationRequest, judgements: Sequence[Judgement],
           numbers: dict[str, Any], files: Sequence[Path]) -> Iterator[str]:
    unmet = sum(not each.is_met for each in judgements)
    yield from (
        '# The evaluation of CommonRoad-Game, repeated', '',
        f'crgame_ros {numbers["version"]}, Python {numbers["machine"]["python"]}, '
        f'{numbers["machine"]["cores"]} cores. The games were recorded {numbers["mode"]}; the '
        'recorded human was then driven, with the same inputs over the same intervals, against '
        f'`{request.idm}` (in the place of the IDM planner) and `{request.reactive}` (reactive).',
        '', f'{len(judgements)} expectations, {unmet or "none"} of them unmet.', '',
        '## What had to come out', '',
        '| experiment | expectation | the paper | here | |', '|---|---|---|---|---|')
    for each in judgements:
        yield (f'| {each.subject} | {each.name} | {each.paper} | {each.found} | '
               f'{"met" if each.is_met else "**unmet**"} |')
    yield ''
    for name, sentence in dict.fromkeys((each.name, each.sentence) for each in judgements):
        yield f'- *{name}*: {sentence}'
    yield from ('', '## Table I', '')
    if 'table_1' in numbers:
        yield from _table(numbers['table_1'])
        yield from ('', numbers['load'])
    else:
        yield 'Not measured: it is about runs in real time; leave --offline out.'
    yield from ('', '## Figures', '')
    # For a figure in several formats, the first format that a page can show.
    shown = {each.stem: each for each in reversed(files) if each.suffix in _SHOWN}
    for name, caption in CAPTIONS.items():
        if name in shown:
            yield from (caption, '', f'![{name}]({shown[name].name})', '')


def _table(rows: Sequence[Mapping[str, object]]) -> Iterator[str]:
    yield '| metric | ours | paper | naive, ours | naive, paper |'
    yield '|---|---:|---:|---:|---:|'
    for row, form in zip(rows, (each.form for each in TIMING_ROWS), strict=True):
        name = f'{row["metric"]} [{row["unit"]}]' if row['unit'] else row['metric']
        paper, paper_naive = PAPER_TABLE[str(row['metric'])]
        yield (f'| {name} | {row["proposed"]:{form}} | {paper} | {row["naive"]:{form}} '
               f'| {paper_naive} |')
