# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Names of a study's columns: of factors, of questions and scores, of measures with units."""

from collections.abc import Iterable, Sequence
from dataclasses import replace
import re

from crgame_ros.analysis.tables.column import Column, FLAG, INTEGER, NUMBER, TEXT
from crgame_ros.study.question import LikertQuestion, NumberQuestion, Question, SliderQuestion
from crgame_ros.study.questionnaire import Questionnaire

_SUFFIXES = {'s': 's', 'm': 'm', 'm/s': 'm_per_s', 'm/s^2': 'm_per_s2', 'm/s^3': 'm_per_s3',
             's^2': 's2', '1/min': 'per_min', 'rad': 'rad', 'rad/s': 'rad_per_s', 'Hz': 'hz'}
_ASKED = 'it was not answered'
SHARED = 'of a questionnaire'


def with_unit(column: Column, prefix: str = '') -> Column:
    """Name a measure's column so that its unit is in the name."""
    suffix = _SUFFIXES.get(column.unit, '')
    name = prefix + column.name
    if suffix and not name.endswith(f'_{suffix}'):
        name = f'{name}_{suffix}'
    return replace(column, name=name)


def plain_name(name: str) -> str:
    """Return a name as columns have it: small letters, digits and _."""
    return re.sub(r'[^a-z0-9]+', '_', name.lower()).strip('_')


def unlike(name: str, taken: Iterable[str], ending: str = '') -> str:
    """
    Return a name that no other column has.

    :param taken: names of the others.
    :param ending: that is tried before numbers.
    """
    known = set(taken)
    tries = [name, *([name + ending] if ending else [])]
    number = 2
    while tries[-1] in known:
        tries.append(f'{name}_{number}')
        number += 1
    return next(each for each in tries if each not in known)


def question_column(question: Question, name: str, language: str) -> Column:
    """Declare the column of a question's answers."""
    kind, asked = question.kind, ' '.join(question.ask.in_language(language).split())
    says = f'answer to: {asked}' if asked else 'answer'
    if isinstance(kind, LikertQuestion):
        return Column(name, INTEGER, '1', says, variant=f'1 (left) to {kind.points} (right)',
                      empty=_ASKED)
    if isinstance(kind, SliderQuestion):
        return Column(name, NUMBER, '1', says, variant=f'{kind.low:g} to {kind.high:g}',
                      empty=_ASKED)
    if isinstance(kind, NumberQuestion):
        return Column(name, INTEGER if kind.whole else NUMBER, kind.unit, says, empty=_ASKED)
    several = getattr(kind, 'several', False)
    return Column(name, TEXT, '', says, empty=_ASKED,
                  variant='names of the choices, as a JSON array' if several else '')


def score_columns(scale: Questionnaire, prefix: str) -> Sequence[Column]:
    """Declare the columns of a questionnaire's scores."""
    return [Column(f'{prefix}{score.name}', NUMBER, '1', f'{score.name} of {scale.name}',
                   variant=scale.citation, empty='an answer is missing')
            for score in scale.scores]


def flag_column(name: str, definition: str) -> Column:
    """Declare a column of yes and no."""
    return Column(name, FLAG, '', definition)
