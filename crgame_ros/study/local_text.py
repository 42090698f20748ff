# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Names in a study, and displayed texts in its languages."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from crgame_ros.errors import InputError, short
from crgame_ros.schema.marks import Special, Wording

MOST_CHARACTERS = 20_000
# A column name in tables that R, SQL and pandas accept without quotes.
ColumnName = Annotated[str, Wording('[a-z][a-z0-9_]{0,39}',
                                    'begin with a letter a-z, then letters, digits and _')]
Name = Annotated[str, Wording('[A-Za-z0-9][A-Za-z0-9_-]{0,39}',
                              'give 1 to 40 letters, digits, - and _')]
# Pattern of the name of a file beside the study file, or below it.
BESIDE = r'(?!([^\0]*/)?\.\.(/|$))[^/\0][^\0]*'
MarkdownFile = Annotated[str, Wording(rf'{BESIDE}\.md', 'name a Markdown file beside this one')]


@dataclass(frozen=True)
class LocalText:
    """
    A text in one or several languages.

    :param by_language: texts by language code; the code '' stands for every language.
    """

    by_language: tuple[tuple[str, str], ...] = ()

    @classmethod
    def from_value(cls, given: object, where: str = '') -> 'LocalText':
        """
        Read a value of a file: a text, or texts by language.

        :raises InputError: if it is neither.
        """
        if isinstance(given, str) and len(given) <= MOST_CHARACTERS:
            return cls((('', given),))
        if isinstance(given, Mapping) and given and all(
                isinstance(code, str) and isinstance(text, str) and len(text) <= MOST_CHARACTERS
                for code, text in given.items()):
            return cls(tuple(given.items()))
        raise InputError(f'is {short(given)}', where,
                         'give a text, or texts by language: {en: ..., de: ...}')

    def __bool__(self) -> bool:
        """Return whether the text is not empty."""
        return any(text for _, text in self.by_language)

    def in_language(self, language: str) -> str:
        """Return the text in a language, else the one for all languages, else the first one."""
        texts = dict(self.by_language)
        return texts.get(language, texts.get('', next(iter(texts.values()), '')))

    def lacks(self, language: str) -> bool:
        """Return whether the text is missing in a language, so that another one is shown."""
        return bool(self.by_language) and not {language, ''} & {
            code for code, _ in self.by_language}


def check_known(noun: str, name: str, known: Iterable[str], where: str) -> None:
    """
    Refuse a name that is not among those that are there.

    :param noun: what has the name, such as a factor.
    :raises InputError: that lists the others.
    """
    names = sorted(known)
    if name not in names:
        raise InputError(f'names the {noun} "{name}", which is not there', where,
                         f'name {", ".join(names) or "none"}')


class _LocalTextMark(Special):
    """A text, or texts by language."""

    def read(self, given: object, where: str, key: str, _base: Path) -> LocalText:
        """Read it."""
        if isinstance(given, LocalText):
            return given
        place = f'{where}: {key}' if where and key else where or key
        return LocalText.from_value(given, place)

    def json_schema(self) -> dict[str, object]:
        """Return its JSON Schema."""
        return {'anyOf': [{'type': 'string'}, {
            'type': 'object', 'additionalProperties': {'type': 'string'}, 'minProperties': 1}]}

    def __str__(self) -> str:
        """Return the expected form."""
        return 'a text, or texts by language: {en: ..., de: ...}'


Text = Annotated[LocalText, _LocalTextMark()]
