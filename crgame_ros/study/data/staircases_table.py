# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The table of staircases: one row for each participant and staircase, with its threshold."""

from collections.abc import Iterator, Mapping
from dataclasses import replace

from crgame_ros.analysis.tables.column import Column, INTEGER, NUMBER, TableDeclaration, TEXT
from crgame_ros.study.data.conducted_study import ParticipantRecord
from crgame_ros.study.data.study_row_table import plain_name, unlike
from crgame_ros.study.data.trials_table import PARTICIPANT
from crgame_ros.study.file import StudyFile
from crgame_ros.study.staircase import Track
from crgame_ros.study.trial_plan import BlockStaircases

_LEVELS = 'in the numbers of the levels: values, names, or places in the file'
_RESULTS = (
    Column('threshold', NUMBER, '1', 'mean of the levels at the last even number of reversals, '
           f'without those of the first steps; {_LEVELS}', variant='Levitt 1971',
           empty='there are fewer than two reversals that count'),
    Column('threshold_sd', NUMBER, '1', 'standard deviation of these levels', variant='N - 1',
           empty='likewise'),
    Column('reversals', INTEGER, '1', 'changes of direction'),
    Column('reversals_used', INTEGER, '1', 'number of them in the threshold'),
    Column('trials', INTEGER, '1', 'trials that succeeded or failed'),
    Column('steps_beyond', INTEGER, '1', 'steps that an end of the scale prevented: the next '
           'trial stayed at the level'),
    Column('end', TEXT, '', 'why it ended', empty='it has not',
           values=('reversals', 'at_most')))
STAIRCASES = TableDeclaration(
    'staircases', 'a staircase of a participant', ('participant', 'block', 'staircase'), (
        PARTICIPANT, Column('block', TEXT, '', 'name of its block'),
        Column('staircase', TEXT, '', 'levels of the other factors of the block, with / between '
               'them; all without any'),
        Column('factor', TEXT, '', 'whose levels are the steps'),
        Column('rule', TEXT, '', 'N-down M-up'), *_RESULTS))


def counted_tracks(record: ParticipantRecord) -> Mapping[tuple[str, str], Track]:
    """Return a participant's tracks by block and staircase; none of one who was excluded."""
    return record.tracks if record.exclusion is None else {}


def staircase_rows(record: ParticipantRecord) -> Iterator[dict[str, object]]:
    """Yield the rows of a participant."""
    blocks = {block.name: block.staircase for block in record.study.blocks}
    for (block, name), track in counted_tracks(record).items():
        staircase = blocks[block]
        assert staircase is not None
        yield {'participant': record.id, 'block': block, 'staircase': name,
               'factor': staircase.factor, 'rule': staircase.rule, **_results(track)}


def _results(track: Track) -> dict[str, object]:
    threshold = track.threshold
    return {'threshold': None if threshold is None else threshold.mean,
            'threshold_sd': None if threshold is None else threshold.sd,
            'reversals': len(track.reversals),
            'reversals_used': 0 if threshold is None else threshold.reversals,
            'trials': len(track.judged), 'steps_beyond': track.beyond, 'end': track.ended}


class StaircaseColumns:
    """
    The columns of the staircases in the table of participants.

    :param study: the study.
    :param taken: names of other columns.
    :ivar columns: their declarations.
    """

    def __init__(self, study: StudyFile, taken: set[str]) -> None:
        self._names: dict[tuple[str, str], dict[str, str]] = {}
        self.columns: list[Column] = []
        known = set(taken)
        for block in study.blocks:
            for name in () if block.staircase is None else BlockStaircases(study, block).names:
                names = self._names[block.name, name] = {}
                for column in _RESULTS:
                    names[column.name] = unlike(
                        f'{plain_name(f"{block.name} {name}")}_{column.name}', known)
                    known.add(names[column.name])
                    self.columns.append(replace(
                        column, name=names[column.name], definition=f'{column.definition}; of '
                        f'the staircase {name} in {block.name}',
                        empty='; '.join(filter(None, (
                            column.empty, 'the participant was excluded, or in no group yet')))))

    def values(self, record: ParticipantRecord) -> dict[str, object]:
        """Return the values of a participant."""
        return {self._names[whose][name]: value for whose, track in counted_tracks(record).items()
                for name, value in _results(track).items()}
