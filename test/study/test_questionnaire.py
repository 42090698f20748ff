# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Scores against examples computed by hand, and the scales' published bounds."""

import math
from pathlib import Path
import random

from crgame_ros.errors import InputError
from crgame_ros.schema.reading import read
from crgame_ros.study.data.asked_questions import AskedQuestions
from crgame_ros.study.file import StudyFile
from crgame_ros.study.question import Answer, ChoiceQuestion, Question
from crgame_ros.study.questionnaire import (
    load_questionnaire,
    Questionnaire,
    standard_questionnaires,
)
import pytest
import yaml

RATINGS = {'mental': 70, 'physical': 10, 'temporal': 55, 'performance': 25, 'effort': 60,
           'frustration': 40}
# Comparisons won: mental 5, temporal 3, effort 4, frustration 2, performance 1.
RANKS = ('mental', 'effort', 'temporal', 'frustration', 'performance', 'physical')


def weighted() -> dict[str, object]:
    """Answer the weighted index: choose the item of each pair that ranks higher."""
    answers: dict[str, object] = dict(RATINGS)
    for question in load_questionnaire('nasa_tlx').questions:
        if '_or_' in question.name:
            answers[question.name] = min(question.name.split('_or_'), key=RANKS.index)
    return answers


def test_the_task_load_index() -> None:
    scores = load_questionnaire('nasa_tlx').score(weighted())
    # (70 + 10 + 55 + 25 + 60 + 40) / 6
    assert scores['raw'] == pytest.approx(43.3333333)
    # (5 * 70 + 4 * 60 + 3 * 55 + 2 * 40 + 1 * 25 + 0 * 10) / 15
    assert scores['weighted'] == pytest.approx(860.0 / 15.0)
    assert load_questionnaire('nasa_tlx_raw').score(RATINGS) == {'raw': scores['raw']}
    pairs = [question.name for question in load_questionnaire('nasa_tlx').questions[6:]]
    assert len(pairs) == len(set(pairs)) == 15


def test_a_missing_answer_leaves_no_score() -> None:
    answers = weighted()
    answers['mental_or_effort'] = None
    scores = load_questionnaire('nasa_tlx').score(answers)
    assert math.isnan(scores['weighted']) and not math.isnan(scores['raw'])
    del answers['physical']
    assert math.isnan(load_questionnaire('nasa_tlx').score(answers)['raw'])


def test_simulator_sickness() -> None:
    """Kennedy et al. 1993: greatest scores 200.34, 159.18, 292.32 and 235.62."""
    ssq = load_questionnaire('ssq')
    names = [question.name for question in ssq.questions]
    assert len(names) == 16
    worst = ssq.score(dict.fromkeys(names, 4))
    assert list(worst.values()) == pytest.approx([200.34, 159.18, 292.32, 235.62])
    assert set(ssq.score(dict.fromkeys(names, 1)).values()) == {0.0}
    # Slight nausea alone counts for nausea and for disorientation.
    one = ssq.score(dict.fromkeys(names, 1) | {'nausea': 2})
    assert list(one.values()) == pytest.approx([9.54, 0.0, 13.92, 2 * 3.74])


def test_acceptance() -> None:
    """Van der Laan et al. 1997: five items of usefulness, four of satisfaction; three reversed."""
    scale = load_questionnaire('van_der_laan')
    names = [question.name for question in scale.questions]
    best = {name: 5 if name in ('good', 'likeable', 'desirable') else 1 for name in names}
    assert scale.score(best) == {'usefulness': 2.0, 'satisfaction': 2.0}
    assert scale.score({name: 6 - value for name, value in best.items()}) == {
        'usefulness': -2.0, 'satisfaction': -2.0}
    assert set(scale.score(dict.fromkeys(names, 3)).values()) == {0.0}
    # Useful 2, bad-good 4, effective 1, assisting 3, alerting 5: (1 + 1 + 2 + 0 - 2) / 5.
    answers = dict.fromkeys(names, 3) | {'useful': 2, 'good': 4, 'effective': 1, 'alerting': 5}
    assert scale.score(answers) == {'usefulness': pytest.approx(0.4), 'satisfaction': 0.0}


@pytest.mark.parametrize('name', standard_questionnaires())
def test_the_scales_are_there_in_two_languages(name: str) -> None:
    scale = load_questionnaire(name)
    assert scale.citation and scale.scores
    texts = [scale.title, scale.text]
    for question in scale.questions:
        texts.append(question.ask)
        texts += [getattr(question.kind, side) for side in ('left', 'right')
                  if hasattr(question.kind, side)]
        texts += [*getattr(question.kind, 'labels', ()),
                  *getattr(question.kind, 'texts', {}).values()]
    assert not [text for text in texts for code in ('en', 'de') if text and text.lacks(code)]


@pytest.mark.parametrize(('values', 'message'), [
    ({'scores': [{'name': 's', 'items': ['nobody']}]}, 'names the question "nobody"'),
    ({'scores': [{'name': 's', 'items': ['a'], 'how': 'tally'}]}, 'give both or none'),
    ({'scores': [{'name': 's', 'items': ['a'], 'how': 'tally', 'pairs': ['a']}]},
     'does not choose between items'),
    ({'scores': [{'name': 'a', 'items': ['a']}]}, 'has the name of a question'),
    ({'questions': []}, 'give 1 to 200'),
    ({'questions': [{'name': 'a', 'text': {}}, {'name': 'a', 'text': {}}]}, 'there already')])
def test_what_is_no_questionnaire_is_told(values: dict[str, object], message: str) -> None:
    given = {'name': 'q', 'questions': [{'name': 'a', 'slider': {}}]} | values
    with pytest.raises(InputError, match=message):
        read(Questionnaire, given, 'file')


def test_two_of_one_name_have_columns_of_their_own(tmp_path: Path) -> None:
    """The same ones after each trial."""
    for number in (1, 2):
        (tmp_path / f'{number}.yaml').write_text(yaml.safe_dump({
            'name': 'q', 'questions': [{'name': f'asked_{number}', 'text': {}}]}))
    study = read(StudyFile, {'name': 'demo', 'blocks': [{
        'name': 'main', 'repetitions': 3, 'after_trial': [
            {'questions': '1.yaml'}, {'questions': '2.yaml'}]}]}, 'study', tmp_path)
    assert [column.name for scale in AskedQuestions(study).after_trials.values()
            for column in scale.columns('en')] == ['q_asked_1', 'q_2_asked_2']


def test_an_unknown_one_is_told() -> None:
    with pytest.raises(InputError, match='nasa_tlx, nasa_tlx_raw, sart, ssq, trust_jian'):
        load_questionnaire('tlx')


@pytest.mark.parametrize('name', standard_questionnaires())
def test_the_bounds_of_scores_are_reached(name: str) -> None:
    """Of random answers and the extreme ones, no score is beyond, and both ends are met."""
    scale = load_questionnaire(name)
    rng = random.Random(1)

    def answer(question: Question, item_end: float | None) -> Answer:
        if isinstance(question.kind, ChoiceQuestion):
            return rng.choice(list(map(str, question.kind.choices)))
        low, high = question.bounds
        return rng.choice((low, high)) if item_end is None else (low, high)[int(item_end)]

    for score in scale.scores:
        low, high = score.bounds(scale.questions)
        worst = {question.name: answer(question, float(question.name in score.flipped))
                 for question in scale.questions}
        best = {question.name: answer(question, float(question.name not in score.flipped))
                for question in scale.questions}
        assert score.compute(worst) == pytest.approx(low)
        assert score.compute(best) == pytest.approx(high)
        for _ in range(200):
            value = score.compute({question.name: answer(question, None)
                                   for question in scale.questions})
            assert low - 1e-9 <= value <= high + 1e-9


def test_the_scores_of_published_examples() -> None:
    """Ends and middles as the sources state them, and one participant computed by hand."""
    trust = load_questionnaire('trust_jian')
    given = dict(zip((question.name for question in trust.questions),
                     (2, 1, 3, 4, 1, 6, 5, 5, 6, 7, 6, 3), strict=True))
    scores = trust.score(given)
    assert scores['distrust_score'] == pytest.approx(11 / 5)
    assert scores['trust_score'] == pytest.approx(38 / 7)
    assert scores['overall_score'] == pytest.approx((5 * 8 - 11 + 38) / 12)
    sart = load_questionnaire('sart')
    ratings = dict(zip((question.name for question in sart.questions),
                       (5, 4, 6, 6, 5, 4, 3, 5, 6, 4), strict=True))
    # Taylor: SA = U - (D - S)
    assert sart.score(ratings)['awareness_score'] == 15 - (15 - 18)
    assert sart.scores[-1].bounds(sart.questions) == (-14.0, 46.0)
    umux = load_questionnaire('umux_lite').score({'requirements': 6, 'easy': 5})
    # Lewis, Utesch and Maher: ((6 - 1) + (5 - 1)) of 12, and 0.65 of it + 22.9.
    assert umux == {'score': pytest.approx(75.0), 'sus_score': pytest.approx(0.65 * 75 + 22.9)}
    assert load_questionnaire('misc').score({'feels': 7}) == {'score': 6.0}


@pytest.mark.parametrize('name', standard_questionnaires())
def test_every_text_is_there_in_both_languages(name: str) -> None:
    scale = load_questionnaire(name)
    texts = [scale.title, scale.text, *(text for each in scale.questions for text in each.texts)]
    assert not any(text.lacks(language) for text in texts for language in ('en', 'de'))
    assert scale.citation
