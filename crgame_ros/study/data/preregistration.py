# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Writes the plan of a study as one document for a preregistration, and checks it later."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
import hashlib
from pathlib import Path
import re
import tempfile

from crgame_ros.analysis.tables.column import Column, FLAG, TEXT
from crgame_ros.errors import InputError
from crgame_ros.recording.run_folder import STUDY_FILE
from crgame_ros.software import software_with_commit
from crgame_ros.study.analysis.mixed_model import model_formulas
from crgame_ros.study.analysis.power import Power, power_lines
from crgame_ros.study.data.asked_questions import AskedQuestions
from crgame_ros.study.data.trials_table import declare_trials
from crgame_ros.study.file import StudyFile
from crgame_ros.study.folder import StudyFolder
from crgame_ros.study.planned_analysis import HYPOTHESES
from crgame_ros.study.session_script import members_of
from crgame_ros.study.trial_order import OrderKind
from crgame_ros.study.trial_plan import orders_of, told_trials
from crgame_ros.yaml_text import read_text

PREREGISTRATION = 'preregistration.md'
_LAST = 'SHA-256 of all lines above: '
_FILES = '## Files'
_DIGEST = re.compile(r'([0-9a-f]{64})  (\S.*)')


@dataclass(frozen=True)
class SimulatedPower:
    """
    The power for the document.

    :param powers: for each number of participants, of each test.
    :param runs: simulated studies for each.
    :param seed: of the simulation.
    """

    powers: Sequence[Sequence[Power]]
    runs: int
    seed: int


@dataclass(frozen=True)
class Preregistration:
    """
    A document that has been read.

    :param digest: SHA-256 of it.
    :param files: SHA-256 of the study's files, by their names.
    """

    digest: str
    files: Mapping[str, str]

    def differences(self, files: Mapping[str, str]) -> list[str]:
        """Return one text for each file that is another one now, is missing, or is new."""
        return [f'{name} ' + ('is missing' if name not in files else 'is new'
                              if name not in self.files else 'has changed')
                for name in sorted({*self.files, *files})
                if self.files.get(name) != files.get(name)]


def digests_of_study(study: StudyFile, file: Path, pictures: Sequence[str]) -> dict[str, str]:
    """
    Return the SHA-256 of each file of a study, by its name in the folder `study` of its data.

    :param pictures: of its pages.
    :raises InputError: if a file cannot be read.
    """
    with tempfile.TemporaryDirectory() as folder:
        StudyFolder(Path(folder)).keep_study(study, file, pictures)
        return digests_of_folder((Path(folder) / STUDY_FILE).parent)


def digests_of_folder(folder: Path) -> dict[str, str]:
    """Return the SHA-256 of each file in a folder and below, by its relative name."""
    return {path.relative_to(folder).as_posix(): hashlib.sha256(path.read_bytes()).hexdigest()
            for path in sorted(folder.rglob('*')) if path.is_file()}


def read_preregistration(path: Path) -> Preregistration:
    """
    Read a document.

    :raises InputError: if it is none, or has been changed since it was written.
    """
    text = read_text(path, 'preregistration')
    above, found, digest = text.rpartition(_LAST)
    digest = digest.strip()
    if not found or _FILES not in above:
        raise InputError('is no preregistration', str(path),
                         'name a file of `crgame study preregister`')
    if hashlib.sha256(above.encode()).hexdigest() != digest:
        raise InputError('has been changed since it was written', str(path),
                         'take the copy that was registered')
    files = {name: value for value, name in _DIGEST.findall(above.rpartition(_FILES)[2])}
    return Preregistration(digest, files)


def preregistration_of(study: StudyFile, files: Mapping[str, str],
                       power: SimulatedPower | None) -> str:
    """
    Return the document as Markdown; its last line is the SHA-256 of all lines above it.

    :param files: of the study, with their SHA-256.
    :raises InputError: if a planned measure is no column of the table of trials.
    """
    factors, declaration = declare_trials(study, AskedQuestions(study))
    check_measures(study, declaration.columns)
    columns = {name: column.name for name, column in factors.items()}
    lines = [f'# Preregistration: {study.title_in(study.language)}', '',
             f'Study `{study.name}`, planned with crgame_ros.', '',
             *_design(study), *_orders(study), *_measures(study, declaration.columns),
             *_exclusion(study), *_analysis(study, columns), *_power(power), *_versions(study),
             _FILES, '', 'The files of the study and what its games name, with their SHA-256:', '',
             '```', *(f'{digest}  {name}' for name, digest in sorted(files.items())), '```', '']
    text = '\n'.join(lines) + '\n'
    return f'{text}{_LAST}{hashlib.sha256(text.encode()).hexdigest()}\n'


def _design(study: StudyFile) -> Iterator[str]:
    yield from ('## Design', '', f'{study.participants} participants are planned. All factors of '
                'a block are crossed, and varied within participants.', '')
    if study.groups is not None:
        yield from (f'The factor {study.groups.name} is varied between participants: '
                    f'{", ".join(study.groups.names)}. Groups by {study.groups.told}, with the '
                    f'seed {study.seed}.', '')
    if study.factors:
        yield from ('| factor | levels |', '|---|---|')
        yield from (f'| {factor.name} | {", ".join(factor.names)} |'
                    for factor in study.factors)
        yield ''
    yield from ('| block | factors | repetitions | order |', '|---|---|---|---|')
    for block in study.blocks:
        names = ' × '.join(factor.name for factor in study.factors_of(block)) or 'one condition'
        order = _order(block.order, block.sequences) if block.staircase is None else \
            'by answers, see below'
        yield f'| {block.name} | {names} | {block.repetitions} | {order} |'
    yield ''
    for block in study.blocks:
        if block.stop is not None:
            yield from (f'Block {block.name}: {block.stop.told}.', '')
        if block.staircase is not None:
            yield from (f'Block {block.name}: {block.staircase.told}. Each trial draws one of its '
                        'staircases, one for each combination of the other factors, by the seed. '
                        'The threshold is the mean of the levels at the last even number of '
                        'reversals, without those of first steps (Levitt 1971).', '')
    if len(study.blocks) > 1:
        yield from (f'Order of the blocks: {_order(study.block_order, study.block_sequences)}.',
                    '')


def _order(kind: OrderKind, sequences: Sequence[object]) -> str:
    if sequences:
        return 'sequences of the file, in turn'
    return {'williams': 'Latin square balanced for carry-over (Williams 1949)',
            'random': 'random for each participant and repetition', 'given': 'as in the file'}[
                kind]


def _orders(study: StudyFile) -> Iterator[str]:
    groups = study.group_names
    yield from ('## Orders', '', f'By the seed {study.seed}. Participants take the next free '
                f'place{" of their group" if study.groups is not None else ""}. The place of '
                'a participant who drops out is free again.', '',
                '| place | trials, in this order |', '|---|---|')
    for group, place, trials in orders_of(
            study, -(-study.participants // (len(groups) * members_of(study)))):
        told = ', '.join(what if len(study.blocks) == 1 else f'{block}: {what}'
                         for _, block, what in told_trials(trials))
        yield f'| {group} {place + 1} | {told} |'.replace('|  ', '| ')
    yield ''


def _measures(study: StudyFile, columns: Sequence[Column]) -> Iterator[str]:
    planned = {each.measure for each in study.analysis.comparisons}
    yield from ('## Measures', '', 'Columns of `trials.csv`, as its data dictionary defines them.',
                '', '| measure | unit | definition | reference point | variant | no value |',
                '|---|---|---|---|---|---|')
    for column in columns:
        if column.name in planned:
            cells = (column.name, column.unit, column.definition, column.reference_point,
                     column.variant, column.empty)
            yield '| ' + ' | '.join(' '.join(cell.split()).replace('|', r'\|')
                                    for cell in cells) + ' |'
    yield ''


def _exclusion(study: StudyFile) -> Iterator[str]:
    quality = study.quality
    beyond = {'mark': 'is marked', 'stop': 'is marked, and the experimenter decides whether it '
              'comes again', 'repeat': f'comes again, at most {quality.repeats} times, and is '
              'then marked'}[quality.beyond]
    used = 'stay in the analysis' if study.analysis.flagged == 'use' \
        else 'are left out of the analysis'
    yield from ('## Exclusion and missing data', '', 'A trial beyond one of these bounds '
                f'{beyond}. Trials that are marked {used}.', '', '| value | bound |', '|---|---|')
    yield from (f'| {words} | {bound} |' for words, bound in quality.told())
    if study.exclude:
        yield from ('', 'A participant is excluded, and replaced, by one of these rules. Trials '
                    'of participants who were excluded are not used.', '',
                    *(f'- {rule.told}' for rule in study.exclude))
    yield from ('', 'Of each trial the last attempt that finished counts; one that was aborted '
                'comes again. A trial that was left out, or whose measure has no value, is '
                'missing.', '')


def _analysis(study: StudyFile, columns: Mapping[str, str]) -> Iterator[str]:
    yield from ('## Analysis', '')
    if not study.analysis.comparisons:
        yield from ('No comparison is planned.', '')
        return
    yield from ('| measure | factor | difference | hypothesis | expected |',
                '|---|---|---|---|---|')
    for each in study.analysis.comparisons:
        for first, second in study.pairs_of(each):
            expected = 'not stated' if each.effect is None else \
                f'{each.effect:g}, standard deviation {each.sd:g} (in a group)' \
                if each.sd is not None and each.factor == study.between else \
                f'{each.effect:g}, standard deviation {each.sd:g} (of a {each.sd_of})' \
                if each.sd is not None else \
                f'{"d_s" if each.factor == study.between else "d_z"} = {each.effect:g}'
            yield f'| {each.measure} | {each.factor} | {second} − {first} ' \
                f'| {HYPOTHESES[each.alternative]} | {expected} |'
    between = '' if study.groups is None else '; between groups d_s and g_s'
    yield from ('', method_of(study), '', 'Effect sizes: d_z, d_av, and g_av with Hedges’ '
                f'correction (Lakens 2013){between}.', '', 'Mixed models of the trials, by '
                'restricted maximum likelihood, with the first level of each factor as its '
                'reference:', '')
    for formula in model_formulas(study):
        yield f'- `{formula.text(columns)}`, trials of {", ".join(formula.blocks)}'
    yield ''


def _power(power: SimulatedPower | None) -> Iterator[str]:
    if power is not None:
        yield from ('## Power', '', 'By simulation of the plan with the expected effects, '
                    f'seed {power.seed}. The tests are those of the analysis.', '', '```',
                    *power_lines(power.powers, power.runs), '```', '')


def _versions(study: StudyFile) -> Iterator[str]:
    yield from ('## Versions', '', '| what | version |', '|---|---|')
    yield from (f'| {name} | {value or "unknown"} |'
                for name, value in software_with_commit().items())
    yield from (f'| seed of the orders | {study.seed} |', '')


def check_measures(study: StudyFile, columns: Sequence[Column]) -> None:
    """
    Check that the planned comparisons are of columns with numbers.

    :param columns: of the table of trials.
    :raises InputError: naming the comparison.
    """
    known = {column.name: column for column in columns}
    for number_, comparison in enumerate(study.analysis.comparisons):
        where = f'analysis: comparisons[{number_}]: measure'
        if comparison.measure not in known:
            parts = set(comparison.measure.split('_'))
            near = sorted((name for name in known if parts & set(name.split('_'))),
                          key=lambda name: -len(parts & set(name.split('_'))))[:3]
            raise InputError(f'names "{comparison.measure}", which is no column of trials.csv',
                             where, f'name one such as {", ".join(near) or "mean_speed_m_per_s"}')
        if known[comparison.measure].type in (TEXT, FLAG):
            raise InputError(f'names "{comparison.measure}", which has no numbers', where,
                             'name a column with numbers')


def method_of(study: StudyFile) -> str:
    """Return the method of the tests as sentences."""
    analysis = study.analysis
    family = 'all tests of this analysis' if analysis.family == 'analysis' \
        else 'the tests of each comparison'
    flagged = 'Trials beyond a bound of quality are used.' if analysis.flagged == 'use' \
        else 'Trials beyond a bound of quality (timing_flag, page_flag) are left out.'
    stepped = ' Trials of staircases are left out: answers choose their levels.' \
        if study.staircases else ''
    between = '' if all(each.factor != study.between for each in analysis.comparisons) else (
        'Between groups, a participant’s value is the mean over all its trials; test and interval '
        'are those of Welch, with Satterthwaite’s degrees of freedom, beside the test of Mann and '
        'Whitney. ')
    return (
        'A participant’s value in a level is the mean over its trials in the level, in all blocks '
        'that cross the factor. A participant without a value in one of both levels is not in '
        'that test; nothing is imputed. The difference is the second level less the first, with '
        f'its two-sided {100.0 * (1.0 - analysis.alpha):g} % interval by Student’s t. p is that '
        'of the paired t-test, p (Holm) is corrected by Holm (1979) over '
        f'{family}, with α = {analysis.alpha:g}. Beside it stands the p-value of Wilcoxon’s '
        f'signed-rank test, uncorrected. {between}{flagged}{stepped}')
