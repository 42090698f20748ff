# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Valid answers to questions are accepted and stored unchanged."""

from typing import Any

from crgame_ros.errors import InputError
from crgame_ros.schema.reading import read
from crgame_ros.study.local_text import LocalText
from crgame_ros.study.question import check_answers, NumberQuestion, Question
import pytest

QUESTIONS = tuple(read(Question, values, 'file') for values in (
    {'name': 'likert', 'likert': {'points': 5}},
    {'name': 'slider', 'slider': {'low': -1, 'high': 1, 'step': 0.1}},
    {'name': 'line', 'vas': {'left': 'none', 'right': 'most'}},
    {'name': 'one', 'choice': {'choices': {'a': 'A', 'b': {'en': 'B', 'de': 'Bb'}}}},
    {'name': 'many', 'choice': {'choices': {'a': 'A', 'b': 'B'}, 'several': True},
     'required': False},
    {'name': 'age', 'number': {'low': 18, 'high': 99, 'whole': True}},
    {'name': 'free', 'text': {}, 'required': False}))
GOOD = {'likert': 5, 'slider': 0.3, 'line': 62.5, 'one': 'b', 'many': ['b', 'a'], 'age': 40,
        'free': '<b>"it\'s"</b>,\n;=1+1\t😀' + 'x' * 9_000}


def test_answers_stay_as_they_were() -> None:
    assert check_answers(QUESTIONS, GOOD, 'answers') == GOOD
    assert check_answers(QUESTIONS, GOOD | {'free': '', 'many': []}, 'answers')['free'] == ''
    assert check_answers(QUESTIONS, {name: GOOD[name] for name in (
        'likert', 'slider', 'line', 'one', 'age')}, 'answers')['many'] is None


@pytest.mark.parametrize(('name', 'answer'), [
    ('likert', 0), ('likert', 6), ('likert', 2.5), ('likert', '3'), ('likert', True),
    ('likert', float('nan')), ('slider', 1.1), ('slider', float('inf')), ('slider', None),
    ('line', -0.5), ('line', 100.5), ('line', '50'),
    ('one', 'c'), ('one', ['a']), ('one', None), ('many', ['a', 'a']), ('many', 'a'),
    ('many', [1]), ('age', 17), ('age', 20.5), ('age', 'x'), ('free', 'x' * 10_001),
    ('free', 7), ('nobody', 1)])
def test_what_is_no_answer_is_told(name: str, answer: Any) -> None:
    with pytest.raises(InputError, match=name):
        check_answers(QUESTIONS, GOOD | {name: answer}, 'answers')


@pytest.mark.parametrize(('limits', 'told'), [
    ({'low': 0.0}, 'give a number of at least 0'),
    ({'high': 9.0, 'whole': True}, 'give a whole number of at most 9'), ({}, 'give a number')])
def test_only_limits_that_are_set_are_told(limits: dict[str, Any], told: str) -> None:
    assert NumberQuestion(**limits).refusal('x') == told


def test_texts_are_given_in_the_language_that_there_is() -> None:
    both, plain = LocalText.from_value({'en': 'Age', 'de': 'Alter'}), LocalText.from_value('Age')
    assert [both.in_language(code) for code in ('de', 'en', 'fr')] == ['Alter', 'Age', 'Age']
    assert plain.in_language('de') == 'Age' and not plain.lacks('de')
    assert both.lacks('fr') and not LocalText().lacks('fr')
