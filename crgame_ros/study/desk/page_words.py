# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The words of the participant's page itself, in each language."""

from functools import cache
from pathlib import Path

from crgame_ros.errors import InputError
from crgame_ros.study.study_file import StudyFile
from crgame_ros.yaml_text import read_yaml

WORDS = Path(__file__).resolve().parent / 'words'
STANDARD = 'en'


def words_of(study: StudyFile, language: str) -> dict[str, str]:
    """
    Return the words in a language; English ones where it has none.

    :param study: `words.fr.yaml` beside its file is that for French, or goes before ours.
    :return: by their key.
    :raises InputError: if a file of words cannot be read.
    """
    words = dict(_read(WORDS / f'{STANDARD}.yaml'))
    for file in (WORDS / f'{language}.yaml', study.base / f'words.{language}.yaml'):
        if language.isalnum() and file.is_file():
            given = _read(file)
            unknown = sorted(set(given) - set(words))
            if unknown:
                raise InputError(f'has "{unknown[0][:40]}", which is no word of the page',
                                 str(file), f'take the keys of {STANDARD}.yaml')
            words |= given
    return words


@cache
def _read(file: Path) -> dict[str, str]:
    given = read_yaml(file, 'words')
    if not isinstance(given, dict) or not all(
            isinstance(key, str) and isinstance(text, str) for key, text in given.items()):
        raise InputError('is no list of words', str(file), 'give texts by their key')
    return given
