# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""POSIX extended regular expressions for names, compared with the C library's."""

import ctypes
import itertools

from crgame_ros.errors import InputError
from crgame_ros.nodes.sim.name_pattern import NamePattern
import pytest

REG_EXTENDED, REG_NOSUB = 1, 8
# Room for a regex_t of any C library [bytes].
SIZE = 1024
NAMES = ('hv0', 'hv12', 'av0', 'o30', 'o30_2', 't7', 'cone-1', 'A', 'a.b', 'x^y$', 'a]b', '',
         'aaa', 'aab', 'hvhv')
GOOD = ('hv0', 'hv.*', '(hv|av)[0-9]+', '[[:alpha:]]+[[:digit:]]*', '^hv[0-9]$', '.', '[^0-9]+',
        'o[0-9]{2}(_[0-9])?', 'a{3}', 'a{2,}b?', 'a{1,2}.*', '(a|aa)+', '((a*)*)*b', '[]a]+.*',
        '[a-]+.*', 'a\\.b', 'x\\^y\\$', '[[.a.]]*', '[[=a=]]*', '(^a|^t).*', '(hv){2}', 'x*',
        '.*[^[:alnum:]].*', '^$', 'a*$', '[A-Z]', '.*(0|7)$', '^^hv0$$', '(a?){3}',
        '[a-c[:digit:].]+')
BAD = ('(', ')', 'a)', '[', '[a', '*a', '+', 'a{', 'a{2', 'a{3,2}', 'a{256}', 'a|', '|a', '()',
       '[z-a]', '[[:word:]]', 'a\\', '\\d+', '(?:a)', '{1}')


def _c_library(pattern: str, name: str) -> bool:
    """Match a whole name with regexec."""
    library = ctypes.CDLL(None)
    compiled = ctypes.create_string_buffer(SIZE)
    assert library.regcomp(compiled, f'^({pattern})$'.encode(), REG_EXTENDED | REG_NOSUB) == 0
    try:
        return library.regexec(compiled, name.encode(), 0, None, 0) == 0
    finally:
        library.regfree(compiled)


@pytest.mark.parametrize('pattern', GOOD)
def test_matches_are_those_of_the_c_library(pattern: str) -> None:
    """Every name is matched, or not, as POSIX has it."""
    found = NamePattern(pattern)
    assert {name for name in NAMES if found.matches(name)} == {
        name for name in NAMES if _c_library(pattern, name)}


def test_short_words_over_two_letters() -> None:
    """The same of all words of up to six letters, for expressions that can match in many ways."""
    words = [''.join(word) for length in range(7)
             for word in itertools.product('ab', repeat=length)]
    for pattern in ('(a|ab)(b|ba)*', '(a*b*)*a', '(ab?){2,3}', 'a{0,2}(b|aa){2}', '(a|b)*abb'):
        found = NamePattern(pattern)
        assert [found.matches(word) for word in words] == [
            _c_library(pattern, word) for word in words], pattern


@pytest.mark.parametrize('pattern', BAD)
def test_what_is_no_expression_is_refused(pattern: str) -> None:
    """One line names the filter."""
    with pytest.raises(InputError, match='^filter: '):
        NamePattern(pattern)


def test_no_expression_takes_long() -> None:
    """The work grows with the length of names alone, and written out repetitions are limited."""
    name = 'a' * 5000
    for pattern in ('(((((a*)*)*)*)*)*b', '(a|aa)+b', '(a|a|a|a)*(a|a|a|a)*b', '(.*)*(.*)*(.*)*b'):
        found = NamePattern(pattern)
        assert not found.matches(name)
        assert len(found._known) < 20
    for pattern in ('((a{255}){255}){255}', 'a{255}b{255}', '(' * 70 + 'a' + '+)' * 70):
        with pytest.raises(InputError, match='is too long|has more than'):
            NamePattern(pattern)
    # Repetitions of nothing add no nodes, and are not written out.
    found = NamePattern('(a{0}){255}' + '{255}' * 3 + 'b')
    assert found.matches('b') and not found.matches('ab')
