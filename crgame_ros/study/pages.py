# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Finds the pages and questionnaires of a study."""

import hashlib
from pathlib import Path

from crgame_ros.errors import InputError
from crgame_ros.study.file import Page, Questions, Step, StudyFile
from crgame_ros.study.question import Question
from crgame_ros.study.questionnaire import load_questionnaire, Questionnaire
from crgame_ros.study.session_script import Fields, SessionItem


def steps_of(study: StudyFile) -> tuple[Step, ...]:
    """Return all steps between drives, each as often as in the file, then pages of exclusions."""
    entries = [*study.before, *study.after]
    for block in study.blocks:
        entries += [*block.before, *block.after_trial, *block.after]
    ends = tuple(Page(rule.page) for rule in study.exclude if rule.page is not None)
    return (*(entry.step for entry in entries), *ends)


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
    try:
        content = b'' if file is None else file.read_bytes()
    except OSError as error:
        raise InputError(f'cannot be read ({error.strerror})', str(file), 'put it back') from error
    return {'file': page.file if file is None else file.name, 'version': page.version,
            'sha256': hashlib.sha256(content).hexdigest(), 'language': language}


def questionnaire_name(study: StudyFile, step: Questions) -> str:
    """Return a questionnaire's name, or the absolute path of its file."""
    is_file = step.name.endswith(('.yaml', '.yml'))
    return str(study.base / step.name) if is_file else step.name


def questionnaire_of(study: StudyFile, item: SessionItem) -> Questionnaire | None:
    """Return the questionnaire of an item; None without one."""
    return load_questionnaire(questionnaire_name(study, item.what)) \
        if isinstance(item.what, Questions) else None


def questions_of(study: StudyFile, item: SessionItem) -> tuple[Question, ...]:
    """Return the questions of an item, in the order of their file; empty without any."""
    if isinstance(item.what, Fields):
        return study.fields
    scale = questionnaire_of(study, item)
    return () if scale is None else scale.questions
