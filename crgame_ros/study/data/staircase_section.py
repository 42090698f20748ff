# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The report section on staircases: thresholds, and the track of each."""

from collections.abc import Callable, Sequence

from crgame_ros.analysis.report.section import (
    axis_ticks,
    free,
    note,
    NOTHING,
    number,
    plain,
    table,
    tick_text,
)
from crgame_ros.study.data.staircases_table import counted_tracks, STAIRCASES
from crgame_ros.study.data.study_data import StudyData
from crgame_ros.study.staircase import StaircaseTrial, Track

# Sizes of a plot, which is scaled as a whole [px].
_WIDTH, _PLOT, _TOP, _BOTTOM, _LEFT = 560, 170, 12, 30, 52
_ENDS = {'reversals': 'reversals', 'at_most': 'number of trials'}
_WORDS = {True: 'success', False: 'failure', None: 'neither'}


def staircase_section(data: StudyData) -> str:
    """Return the section."""
    rules = {block.name: block.staircase.told for block in data.folder.study.blocks
             if block.staircase is not None}
    html = note('; '.join(f'{free(name)}: {plain(told)}' for name, told in rules.items()) + '.')
    rows = [(free(row['participant']), free(row['block']), free(row['staircase']),
             number(row['threshold'], 3), number(row['threshold_sd'], 3),
             f'{row["reversals_used"]} of {row["reversals"]}', str(row['trials']),
             str(row['steps_beyond']), plain(_ENDS.get(row['end'], NOTHING)))
            for row in data.tables[STAIRCASES.name].to_pylist()]
    if not rows:
        return html + note('No staircase has begun yet.')
    html += table('Thresholds', ('', 'block', 'staircase', 'threshold', 'SD', 'reversals used',
                                 'trials', 'steps beyond the scale', 'ended by'), rows, 'numbers')
    html += note('The threshold is the mean of the levels at the last even number of reversals, '
                 'without those of first steps (Levitt 1971). In the tracks, a filled point is a '
                 'success, a hollow one a failure; squares mark reversals, the broken line the '
                 'threshold.')
    return html + '<div class="plots">' + ''.join(
        _figure(f'{record.id}, {block}' + (f': {name}' if name != 'all' else ''), track)
        for record in data.records for (block, name), track in counted_tracks(record).items()
        if track.judged) + '</div>'


def _figure(words: str, track: Track) -> str:
    return f'<figure class="chart"><figcaption>{plain(words)}</figcaption>' \
        f'{track_svg(track, words)}</figure>'


def track_svg(track: Track, words: str) -> str:
    """
    Draw the levels of a track's trials, as SVG.

    :param words: alternative text of the plot.
    """
    trials = [(index, trial) for index, trial in enumerate(track.trials) if trial.done]
    # The whole scale, so that tracks can be compared.
    ticks = axis_ticks(track.numbers, 5)
    low, high = ticks[0], ticks[-1]
    count = max(2, len(trials))

    def y(value: float) -> float:
        return _TOP + (high - value) / (high - low) * _PLOT

    def x(place: int) -> float:
        return _LEFT + 12 + (place / (count - 1)) * (_WIDTH - _LEFT - 24)

    marks = [f'<line class="grid" x1="{_LEFT}" x2="{_WIDTH}" y1="{y(tick):.1f}" '
             f'y2="{y(tick):.1f}"/><text class="tick" x="{_LEFT - 6}" y="{y(tick) + 4:.1f}">'
             f'{tick_text(tick)}</text>' for tick in ticks]
    marks += [f'<text class="trial" x="{x(place):.1f}" y="{_TOP + _PLOT + 22}">{place + 1}</text>'
              for place in sorted({0, len(trials) - 1})]
    threshold = track.threshold
    if threshold is not None:
        marks.append(f'<line class="threshold" x1="{_LEFT}" x2="{_WIDTH}" '
                     f'y1="{y(threshold.mean):.1f}" y2="{y(threshold.mean):.1f}"/>')
    marks += _points(track, trials, x, y)
    told = f'{words}: {len(track.judged)} trials, {len(track.reversals)} reversals' + (
        '' if threshold is None else f', threshold {number(threshold.mean, 3)}')
    return (f'<svg class="track" viewBox="0 0 {_WIDTH} {_TOP + _PLOT + _BOTTOM}" role="img" '
            f'aria-label="{plain(told)}">{"".join(marks)}</svg>')


def _points(track: Track, trials: Sequence[tuple[int, StaircaseTrial]],
            x: Callable[[int], float], y: Callable[[float], float]) -> list[str]:
    """Draw the trials, and the line through them."""
    line = ' '.join(f'{x(place):.1f},{y(track.value_of(trial)):.1f}'
                    for place, (_, trial) in enumerate(trials))
    marks = [f'<polyline points="{line}"/>']
    for place, (index, trial) in enumerate(trials):
        at_x, at_y, word = x(place), y(track.value_of(trial)), _WORDS[trial.success]
        reversal = index in track.reversals
        if reversal:
            marks.append(f'<rect x="{at_x - 8:.1f}" y="{at_y - 8:.1f}" width="16" height="16"/>')
        marks.append(f'<circle class="{word}" cx="{at_x:.1f}" cy="{at_y:.1f}" r="4">'
                     f'<title>trial {trial.place} of the block: {word}'
                     f'{", reversal" if reversal else ""}</title></circle>')
    return marks
