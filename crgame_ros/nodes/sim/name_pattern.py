# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
POSIX extended regular expressions for names, in a time that no expression can prolong.

Expressions come from any peer and are matched in the loop of the simulation. A matcher that
backtracks, as Python's, takes minutes for some of 20 characters. This one follows all ways at once
(Thompson 1968) and remembers each step.
"""

from collections.abc import Callable
import string

from crgame_ros.errors import InputError

MAX_LENGTH = 200
# Nodes of the compiled expression: a{1000}{1000} would have a million.
MAX_NODES = 500
# Largest number of repetitions (RE_DUP_MAX of POSIX).
MAX_REPEAT = 255
CLASSES = {
    'alpha': string.ascii_letters, 'digit': string.digits, 'upper': string.ascii_uppercase,
    'lower': string.ascii_lowercase, 'alnum': string.ascii_letters + string.digits,
    'punct': string.punctuation, 'space': string.whitespace, 'blank': ' \t',
    'xdigit': string.hexdigits, 'graph': string.ascii_letters + string.digits + string.punctuation,
    'print': string.ascii_letters + string.digits + string.punctuation + ' ',
    'cntrl': ''.join(map(chr, (*range(32), 127)))}

# A node is the ways to go on from it. Without consuming: to some nodes, at the begin or end of the
# name alone (`^`, `$`), or anywhere. With a character that a test accepts: to the next node.
_Test = Callable[[str], bool]


class _Program:
    """The nodes of an expression; node 0 is its end."""

    def __init__(self) -> None:
        self.ways: list[tuple[int, ...]] = [()]
        self.tests: list[_Test | None] = [None]
        self.anchors: list[str] = ['']

    def add(self, ways: tuple[int, ...], test: _Test | None = None, anchor: str = '') -> int:
        """Add a node and return its number."""
        if len(self.ways) >= MAX_NODES:
            raise ValueError('is too long when its repetitions are written out')
        self.ways.append(ways)
        self.tests.append(test)
        self.anchors.append(anchor)
        return len(self.ways) - 1


# Puts a part of the expression in front of a node, and returns where it begins.
_Part = Callable[[_Program, int], int]


class _Parser:
    """A parser of the grammar in section 9.5.3 of POSIX's Base Definitions."""

    def __init__(self, text: str) -> None:
        self._text = text
        self._place = 0

    def whole(self) -> _Part:
        """Parse the whole expression."""
        part = self._alternatives()
        if self._place < len(self._text):
            raise ValueError('has a ) without a (')
        return part

    def _peek(self) -> str:
        return self._text[self._place:self._place + 1]

    def _take(self) -> str:
        character = self._peek()
        if not character:
            raise ValueError('ends too early')
        self._place += 1
        return character

    def _alternatives(self) -> _Part:
        branches = [self._branch()]
        while self._peek() == '|':
            self._place += 1
            branches.append(self._branch())
        if len(branches) == 1:
            return branches[0]
        return lambda program, then: program.add(
            tuple(branch(program, then) for branch in branches))

    def _branch(self) -> _Part:
        pieces: list[_Part] = []
        while self._peek() not in ('', '|', ')'):
            pieces.append(self._repeated(self._atom()))
        if not pieces:
            raise ValueError('has an empty alternative')

        def build(program: _Program, then: int) -> int:
            for piece in reversed(pieces):
                then = piece(program, then)
            return then
        return build

    def _atom(self) -> _Part:
        character = self._take()
        if character == '(':
            part = self._alternatives()
            if self._peek() != ')':
                raise ValueError('has a ( without a )')
            self._place += 1
            return part
        if character in '^$':
            return lambda program, then: program.add((then,), anchor=character)
        if character in '*+?{':
            raise ValueError(f'repeats nothing by {character}')
        if character == '.':
            return _one(lambda _: True)
        if character == '[':
            return _one(self._bracket())
        if character == '\\':
            character = self._take()
            if character.isalnum():
                raise ValueError(f'has \\{character}, which POSIX does not know')
        return _one(character.__eq__)

    def _repeated(self, part: _Part) -> _Part:
        while (character := self._peek()) and character in '*+?{':
            self._place += 1
            least, most = self._interval() if character == '{' else {
                '*': (0, None), '+': (1, None), '?': (0, 1)}[character]
            part = _repeat(part, least, most)
        return part

    def _interval(self) -> tuple[int, int | None]:
        text, closed, _ = self._text[self._place:].partition('}')
        self._place += len(text) + 1
        first, comma, last = text.partition(',')
        numbers = [int(item) for item in (first, last) if item.isdecimal() and item.isascii()]
        if not closed or not first or len(numbers) != bool(first) + bool(last) \
                or max(numbers) > MAX_REPEAT or numbers[0] > numbers[-1]:
            raise ValueError(f'has no numbers of repetitions, up to {MAX_REPEAT}, in a {{}}')
        return numbers[0], numbers[-1] if last or not comma else None

    def _bracket(self) -> _Test:
        negated = self._peek() == '^'
        self._place += negated
        ranges: list[tuple[str, str]] = []
        first = True
        while first or self._peek() != ']':
            first = False
            low = self._element(ranges)
            if low is None:
                continue
            high = low
            if self._peek() == '-' and self._text[self._place + 1:self._place + 2] != ']':
                self._place += 1
                found = self._element(ranges)
                if found is None or found < low:
                    raise ValueError('has a range without an end in a []')
                high = found
            ranges.append((low, high))
        self._place += 1
        return lambda character: negated != any(
            low <= character <= high for low, high in ranges)

    def _element(self, ranges: list[tuple[str, str]]) -> str | None:
        """Return a character of a bracket expression; None for a class, added to the ranges."""
        character = self._take()
        kind = self._peek()
        if character != '[' or not kind or kind not in '.=:':
            return character
        name, closed, _ = self._text[self._place + 1:].partition(f'{kind}]')
        self._place += len(name) + 3
        if closed and kind == ':' and name in CLASSES:
            ranges += [(item, item) for item in CLASSES[name]]
            return None
        if not closed or kind == ':' or len(name) != 1:
            raise ValueError(f'has an unknown [{kind}{name[:10]}{kind}]')
        return name


def _one(test: _Test) -> _Part:
    return lambda program, then: program.add((then,), test)


def _repeat(part: _Part, least: int, most: int | None) -> _Part:
    def build(program: _Program, then: int) -> int:
        if most is None:
            # The loop comes back to a node that must exist before it.
            loop = program.add(())
            program.ways[loop] = (part(program, loop), then)
            then = loop
        for _ in range(0 if most is None else most - least):
            then = program.add((part(program, then), then))
        for _ in range(least):
            before, then = then, part(program, then)
            if then == before:
                # It consumes nothing, however often it is repeated.
                break
        return then
    return build


class NamePattern:
    """
    An expression that names match as a whole.

    :param text: POSIX extended regular expression; the character classes are those of ASCII.
    :raises InputError: if it is none, or is too long.
    """

    def __init__(self, text: str) -> None:
        try:
            if len(text) > MAX_LENGTH:
                raise ValueError(f'has more than {MAX_LENGTH} characters')
            self._program = _Program()
            start = _Parser(text).whole()(self._program, 0)
        except (ValueError, RecursionError) as error:
            raise InputError(f'"{text[:40]}" {error}', 'filter',
                             'give a POSIX extended regular expression') from error
        self._start = self._closure((start,), '^')
        # Next nodes by present nodes and character: names have many characters in common.
        self._known: dict[tuple[frozenset[int], str], frozenset[int]] = {}

    def matches(self, name: str) -> bool:
        """Return whether the whole name is matched."""
        nodes = self._start
        for character in name:
            step = nodes, character
            if step not in self._known:
                self._known[step] = self._following(*step)
            nodes = self._known[step]
            if not nodes:
                return False
        return 0 in self._closure(tuple(nodes), '$' if name else '^$')

    def _following(self, nodes: frozenset[int], character: str) -> frozenset[int]:
        tests = self._program.tests
        return self._closure(tuple(
            self._program.ways[node][0] for node in nodes
            if (test := tests[node]) is not None and test(character)), '')

    def _closure(self, nodes: tuple[int, ...], anchors: str) -> frozenset[int]:
        """Return the nodes reached from others without a character, where anchors hold."""
        found, program = set[int](), self._program
        ways = list(nodes)
        while ways:
            node = ways.pop()
            if node in found:
                continue
            found.add(node)
            if program.tests[node] is None and (
                    not program.anchors[node] or program.anchors[node] in anchors):
                ways += program.ways[node]
        return frozenset(found)
