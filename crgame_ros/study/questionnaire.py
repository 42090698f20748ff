# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Questionnaires: their files, groups of questions, and scores of the answers."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
import hashlib
import math
from pathlib import Path
from typing import Annotated, ClassVar, Literal

from crgame_ros.errors import InputError, refusing
from crgame_ros.schema.declaration import Form
from crgame_ros.schema.marks import Listed
from crgame_ros.schema.reading import read
from crgame_ros.study.file import Page, Questions, Step, StudyFile
from crgame_ros.study.local_text import ColumnName, LocalText, Text
from crgame_ros.study.question import Answer, check_conditions, ChoiceQuestion, Question
from crgame_ros.study.session_script import Fields, SessionItem
from crgame_ros.study.trial_order import shuffled
from crgame_ros.yaml_text import read_yaml

SCALES = Path(__file__).resolve().parent / 'scales'


@dataclass(frozen=True)
class Score:
    """
    A score computed from answers.

    :param name: of its column in the tables.
    :param items: names of the questions whose answers count.
    :param how: `mean` or `sum` of the answers; `tally` is their mean weighted by how often each
        item was chosen in the questions of `pairs`.
    :param factor: multiplies the result.
    :param flipped: the items that count with the opposite sign.
    :param offset: added to each answer first.
    :param shift: added to the result, after the factor.
    :param pairs: names of the questions that choose between two items, for `tally`.
    """

    name: ColumnName
    items: Annotated[tuple[str, ...], Listed(1, noun='item')]
    how: Literal['mean', 'sum', 'tally'] = 'mean'
    factor: float = 1.0
    flipped: Annotated[tuple[str, ...], Listed(noun='item')] = ()
    offset: float = 0.0
    shift: float = 0.0
    pairs: Annotated[tuple[str, ...], Listed(noun='question')] = ()

    def bounds(self, questions: Sequence[Question]) -> tuple[float, float]:
        """
        Return the least and the greatest score; infinite where an answer has no limit.

        :param questions: all of the questionnaire.
        """
        asked = {question.name: question.bounds for question in questions}
        ends = [sorted(self._signed(item, end) for end in asked[item]) for item in self.items]
        lows, highs = zip(*ends, strict=True)
        if self.how == 'tally':
            # All weight may be on one item.
            found = min(lows), max(highs)
        else:
            count = 1 if self.how == 'sum' else len(self.items)
            found = sum(lows) / count, sum(highs) / count
        low, high = sorted(self.shift + self.factor * end for end in found)
        return low, high

    def _signed(self, item: str, value: float) -> float:
        return (-1.0 if item in self.flipped else 1.0) * (value + self.offset)

    def compute(self, answers: Mapping[str, Answer]) -> float:
        """Compute the score; NaN if an answer is missing."""
        values = [answers.get(item) for item in self.items]
        if not all(isinstance(value, int | float) for value in values):
            return math.nan
        signed = [self._signed(item, float(value))
                  for item, value in zip(self.items, values, strict=True)
                  if isinstance(value, int | float)]
        if self.how == 'sum':
            return self.shift + self.factor * sum(signed)
        if self.how == 'mean':
            return self.shift + self.factor * sum(signed) / len(signed)
        chosen = [answers.get(name) for name in self.pairs]
        weights = [chosen.count(item) for item in self.items]
        if None in chosen or not sum(weights):
            return math.nan
        return self.shift + self.factor * sum(weight * value for weight, value in zip(
            weights, signed, strict=True)) / sum(weights)


@dataclass(frozen=True)
class Questionnaire:
    """
    The content of a questionnaire file.

    :param name: prefix of its columns in the tables.
    :param title: its heading.
    :param text: shown before its questions.
    :param citation: its source.
    :param matrix: whether successive questions with the same points are rows of one table.
    :param shuffle: whether their order is drawn for each participant and time; a question with a
        condition on another one stays behind it.
    :param questions: in their order.
    :param scores: of the answers.
    """

    FORM: ClassVar[Form] = Form('see docs/studies.md for the keys')

    name: ColumnName
    questions: Annotated[tuple[Question, ...], Listed(1, 200, 'question', 'name')]
    title: Text = LocalText()
    text: Text = LocalText()
    citation: str = ''
    matrix: bool = False
    shuffle: bool = False
    scores: Annotated[tuple[Score, ...], Listed(0, 50, 'score', 'name')] = ()

    def check(self) -> None:
        """Refuse scores that do not fit the questions, and conditions on those that come later."""
        check_conditions(self.questions, are_fields=False)
        known = {question.name: question for question in self.questions}
        for score in self.scores:
            if score.name in known:
                raise InputError('has the name of a question', f'scores: {score.name}',
                                 'give it another name: both are columns')
            for item in (*score.items, *score.flipped, *score.pairs):
                if item not in known:
                    raise InputError(f'names the question "{item}", which is not there',
                                     f'scores: {score.name}', 'name questions of this file')
            if (score.how == 'tally') != bool(score.pairs):
                raise InputError('has "pairs" without "how: tally", or the other way round',
                                 f'scores: {score.name}', 'give both or none')
            for item in score.pairs:
                kind = known[item].kind
                if not isinstance(kind, ChoiceQuestion) or not set(
                        map(str, kind.choices)) <= set(score.items):
                    raise InputError(f'"{item}" does not choose between items',
                                     f'scores: {score.name}', 'let its choices be two items')

    def ordered(self, draw: str) -> tuple[Question, ...]:
        """
        Return the questions in the order in which they are shown.

        :param draw: unique name of this time; equal names give equal orders everywhere.
        """
        if not self.shuffle:
            return self.questions
        heads: dict[str, list[Question]] = {}
        of_head: dict[str, str] = {}
        for question in self.questions:
            before = None if question.when is None else question.when.question
            of_head[question.name] = question.name if before is None else of_head[before]
            heads.setdefault(of_head[question.name], []).append(question)
        groups = list(heads.values())
        return tuple(question for place in shuffled(len(groups), draw)
                     for question in groups[place])

    def score(self, answers: Mapping[str, Answer]) -> dict[str, float]:
        """Compute all scores of some answers; NaN if an answer is missing."""
        return {score.name: score.compute(answers) for score in self.scores}


def standard_questionnaires() -> tuple[str, ...]:
    """Return the names of the questionnaires that come with the program."""
    return tuple(sorted(path.stem for path in SCALES.glob('*.yaml')))


@cache
def load_questionnaire(name: str) -> Questionnaire:
    """
    Read a questionnaire.

    :param name: of one that comes with the program, or a file.
    :raises InputError: naming the file, the key and the remedy.
    """
    if name in standard_questionnaires():
        path = SCALES / f'{name}.yaml'
    elif name.endswith(('.yaml', '.yml')):
        path = Path(name)
    else:
        raise InputError(f'there is no questionnaire "{name[:60]}"', 'questionnaire',
                         f'name {", ".join(standard_questionnaires())} or a YAML file')
    return read(Questionnaire, read_yaml(path, 'questionnaire'), str(path), path.parent)


def steps_of(study: StudyFile) -> tuple[Step, ...]:
    """Return all steps between drives, each as often as in the file, then pages of exclusions."""
    return (*(entry.step for entry in study.step_entries),
            *(Page(rule.page) for rule in study.exclude if rule.page is not None))


def page_file(study: StudyFile, page: Page, language: str) -> Path | None:
    """
    Find a page's file: `NAME.de.md` before `NAME.md`.

    :return: None if there is none.
    """
    whole = study.base / page.file
    for file in (whole.with_suffix(f'.{language}.md'), whole):
        if file.is_file():
            return file
    return None


def consent_of(study: StudyFile, page: Page, language: str) -> dict[str, str]:
    """
    Return what identifies a consent: its version, and the SHA-256 of the file in a language.

    :raises InputError: if the file cannot be read.
    """
    file = page_file(study, page, language)
    with refusing('cannot be read', file, 'put it back'):
        content = b'' if file is None else file.read_bytes()
    return {'file': page.file if file is None else file.name, 'version': page.version,
            'sha256': hashlib.sha256(content).hexdigest(), 'language': language}


def scale_of(study: StudyFile, step: Questions) -> Questionnaire:
    """
    Return the questionnaire of a step: a standard one, or that of a file beside the study's.

    :raises InputError: naming the file, the key and the remedy.
    """
    return load_questionnaire(str(study.base / step.name) if step.is_file else step.name)


def questionnaire_of(study: StudyFile, item: SessionItem) -> Questionnaire | None:
    """Return the questionnaire of an item; None without one."""
    return scale_of(study, item.what) if isinstance(item.what, Questions) else None


def questions_of(study: StudyFile, item: SessionItem) -> tuple[Question, ...]:
    """Return the questions of an item, in the order of their file; empty without any."""
    if isinstance(item.what, Fields):
        return study.fields
    scale = questionnaire_of(study, item)
    return () if scale is None else scale.questions
