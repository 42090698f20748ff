# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Valid answers to questions are accepted and stored unchanged."""

from typing import Any

from crgame_ros.errors import InputError
from crgame_ros.schema.reading import read
from crgame_ros.study.answer_condition import AnswerCondition
from crgame_ros.study.local_text import LocalText
from crgame_ros.study.question import (
    asked_of,
    check_answers,
    check_conditions,
    NumberQuestion,
    Question,
)
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
    ('line', -0.5), pytest.param('slider', 10 ** 400, id='long'),
    pytest.param('age', 10 ** 400, id='long-whole'), ('line', 100.5), ('line', '50'),
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


@pytest.mark.parametrize(('test', 'answer', 'holds'), [
    ({'equals': 'yes'}, 'yes', True), ({'equals': 'yes'}, None, False),
    # YAML reads yes as a truth value; so does it where the choices are named.
    ({'equals': True}, 'True', True), ({'one_of': ['a', 'c']}, ['b', 'a'], True),
    ({'equals': 'a'}, [], False), ({'one_of': [3, 4]}, 4, True), ({'equals': 3}, 4, False),
    ({'equals': '3'}, 3, False), ({'equals': True}, 1, False), ({'at_least': 3}, 3, True),
    ({'below': 3}, 3, False), ({'at_least': 1, 'below': 3}, 2, True),
    ({'at_least': 1}, 'yes', False), ({'at_least': 1, 'equals': 5}, 5, True)])
def test_conditions_hold_by_the_answer(test: dict[str, Any], answer: Any, holds: bool) -> None:
    condition = read(AnswerCondition, {'question': 'q'} | test, 'file')
    assert condition.holds(answer) is holds


def test_a_question_depends_on_one_that_is_asked() -> None:
    """A condition on a question that is not asked does not hold."""
    questions = tuple(read(Question, values, 'file') for values in (
        {'name': 'a', 'likert': {}}, {'name': 'b', 'likert': {}, 'when': {
            'question': 'a', 'at_least': 5}},
        {'name': 'c', 'text': {}, 'when': {'question': 'b', 'below': 9}}))
    check_conditions(questions, are_fields=True)
    assert [each.name for each in asked_of(questions, {'a': 6, 'b': 2})] == ['a', 'b', 'c']
    assert [each.name for each in asked_of(questions, {'a': 4, 'b': 2})] == ['a']
    assert check_answers(questions, {'a': 4, 'b': 2, 'c': 'x'}, '') == {
        'a': 4, 'b': None, 'c': None}
    with pytest.raises(InputError, match='no earlier question'):
        check_conditions(questions[::-1], are_fields=True)


@pytest.mark.parametrize(('values', 'told'), [
    ({'likert': {'points': 5}, 'expect': 6}, 'expects 6'),
    ({'choice': {'choices': {'a': 'A', 'b': 'B'}}, 'expect': 'c'}, "expects 'c'"),
    ({'text': {}, 'expect': 'blue'}, 'compared with no other'),
    ({'likert': {}, 'when': {'question': 'a', 'equals': 1, 'one_of': [2]}}, 'give one of them')])
def test_checks_and_conditions_that_nobody_meets_are_refused(values: dict[str, Any],
                                                             told: str) -> None:
    with pytest.raises(InputError, match=told):
        read(Question, {'name': 'q'} | values, 'file')


def test_an_attention_check_fails_by_another_answer_or_none() -> None:
    check = read(Question, {'name': 'q', 'likert': {}, 'required': False, 'expect': 4}, 'file')
    assert [check.failed(answer) for answer in (4, 4.0, 5, None)] == [False, False, True, True]
    choice = read(Question, {'name': 'q', 'choice': {'choices': {'a': 'A', 'b': 'B'}},
                             'expect': 'b'}, 'file')
    assert [choice.failed(answer) for answer in 'ab'] == [True, False]
