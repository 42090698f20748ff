# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The flow of participants through a study, by groups, as CONSORT (2010) asks for."""

from collections import Counter

from crgame_ros.analysis.report.section import note, number, plain, table
from crgame_ros.study.data.participant_record import Part
from crgame_ros.study.data.study_data import StudyData

_PARTS: dict[Part, str] = {
    'excluded': 'excluded', 'declined': 'did not give consent', 'ended': 'session ended early',
    'under way': 'under way', 'completed': 'completed'}


def participant_flow(data: StudyData) -> list[tuple[str, dict[str, int]]]:
    """
    Return the numbers of participants: began, dropped out and why, completed.

    :return: words, and the number in each group by its name; an empty name stands for people
        without a group.
    """
    flow: dict[str, Counter[str]] = {}

    def count(words: str, group: str) -> None:
        flow.setdefault(words, Counter())[group] += 1

    rules = [record.exclusion['reason'] for record in data.records
             if record.exclusion is not None]
    # The order of the table.
    for words in ('began', 'excluded', *(f'excluded: {rule}' for rule in dict.fromkeys(rules)),
                  'did not give consent', 'session ended early', 'withdrew, data deleted',
                  'under way', 'completed'):
        flow[words] = Counter()
    for record in data.records:
        count('began', record.group)
        count(_PARTS[record.part], record.group)
        if record.exclusion is not None:
            count(f'excluded: {record.exclusion["reason"]}', record.group)
    for group in data.folder.withdrawn_groups:
        count('began', group)
        count('withdrew, data deleted', group)
    return [(words, dict(counts)) for words, counts in flow.items()]


def flow_table(data: StudyData) -> str:
    """Return the table of the flow; a column for each group if the study has groups."""
    flow = participant_flow(data)
    groups = data.folder.study.groups
    columns = () if groups is None else ('', *groups.names)
    head = ('', 'participants', *(name or 'without a group' for name in columns))
    return table('Flow of participants', tuple(map(plain, head)), [
        (plain(words), number(sum(counts.values()), 0),
         *(number(counts.get(name, 0), 0) for name in columns))
        for words, counts in flow], 'numbers') + (note(
            f'Groups by {plain(groups.told)}. Of those who dropped out, the place is free again.')
            if groups is not None else '')
