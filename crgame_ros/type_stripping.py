# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Types taken out of the pages' TypeScript, so that browsers get it without a build.

Spaces replace them: lines and columns in a browser's console are those of the source. Syntax that
is more than a type (enum, namespace, parameter property) is refused.
"""

from collections.abc import Iterator
from functools import cache
import re

from crgame_ros.errors import CrgameError
from tree_sitter import Language, Node, Parser, Query, QueryCursor
import tree_sitter_typescript

# `whole` is a statement or a member of a class, `part` a part of one, `listed` one of several
# with commas between them; _edits says what of the others goes.
_QUERY = """
[(interface_declaration) (type_alias_declaration) (ambient_declaration) (function_signature)
 (abstract_method_signature)] @whole
(export_statement declaration: [(interface_declaration) (type_alias_declaration)
 (ambient_declaration) (function_signature)]) @whole
(import_statement "type") @whole
(export_statement "type") @whole
(class_body [(method_signature) (index_signature)] @whole)
(public_field_definition ["declare" "abstract"]) @whole

[(type_annotation) (type_predicate_annotation) (asserts_annotation) (type_parameters)
 (type_arguments) (implements_clause) (accessibility_modifier) (override_modifier)] @part
(optional_parameter "?" @part)
(method_definition "?" @part)
(public_field_definition ["?" "!" "readonly"] @part)
(variable_declarator "!" @part)
(abstract_class_declaration "abstract" @part)

[(import_specifier "type") (export_specifier "type")
 (required_parameter pattern: (this))] @listed
[(as_expression) (satisfies_expression)] @cast
(non_null_expression "!" @part)
(arrow_function) @arrow

[(enum_declaration) (internal_module) (module) (type_assertion) (import_alias)
 (import_require_clause) (decorator)] @refused
(export_statement "=" @refused)
[(lookup_type) (array_type)] @indexed
(required_parameter [(accessibility_modifier) (override_modifier) "readonly"] @refused)
(optional_parameter [(accessibility_modifier) (override_modifier) "readonly"] @refused)
"""
# What follows a place in the text: blanks and comments, then the next character.
_NEXT = re.compile(rb'(?:\s|//[^\n]*|/\*.*?\*/)*+', re.DOTALL)
_NO_BLANK = re.compile(r'[^\s]')


# Each server of a process reads the same files.
@cache
def strip_types(source: bytes, name: str) -> bytes:
    """
    Replace all types of a TypeScript module by spaces.

    :param source: UTF-8.
    :param name: of the file, for errors.
    :return: JavaScript with the same lines and columns.
    :raises CrgameError: if it cannot be read, or if something is more than a type.
    """
    parser, query = _grammar()
    root = parser.parse(source).root_node
    if root.has_error:
        fault = next(_faults(root))
        raise _error(fault, name, 'is missing' if fault.is_missing else 'is no TypeScript')
    found = QueryCursor(query).captures(root)
    edits = sorted(_edits(source, found), key=lambda edit: (edit[0], -edit[1]))
    parts: list[bytes] = []
    at = 0
    for start, end, text in edits:
        # Types within what is already taken out.
        if start >= at:
            parts += source[at:start], text or _blank(source[start:end])
            at = end
    for node in found.get('refused', ()):
        if not any(start <= node.start_byte < end for start, end, _ in edits
                   if end - start > node.end_byte - node.start_byte):
            raise _error(node, name, 'is more than a type, and browsers do not know it')
    for node in found.get('indexed', ()):
        of, bracket, *_ = node.children
        # TypeScript begins another statement here, the grammar does not.
        if bracket.start_point.row != of.end_point.row:
            raise _error(bracket, name, 'after the end of a line needs a semicolon before it')
    return b''.join((*parts, source[at:]))


@cache
def _grammar() -> tuple[Parser, Query]:
    language = Language(tree_sitter_typescript.language_typescript())
    return Parser(language), Query(language, _QUERY)


def _edits(source: bytes, found: dict[str, list[Node]]) -> Iterator[tuple[int, int, bytes]]:
    """Yield start, end and what replaces it, empty for blanks."""
    for node in found.get('part', ()):
        yield node.start_byte, node.end_byte, b''
    for node in found.get('whole', ()):
        # Without a semicolon, the statements before and after would become one.
        yield from _taken(source, node.start_byte, node.end_byte, b'([`+-/*')
    for node in found.get('listed', ()):
        after = node.next_sibling
        end = after if after is not None and after.type == ',' else node
        yield node.start_byte, end.end_byte, b''
    for node in found.get('cast', ()):
        value = node.children[0]
        yield from _taken(source, value.end_byte, node.end_byte, b'([`', newline=True)
    for node in found.get('arrow', ()):
        yield from _arrow(source, node)


def _taken(source: bytes, start: int, end: int, joins: bytes, *, newline: bool = False
           ) -> Iterator[tuple[int, int, bytes]]:
    """Yield the edit that takes a text out and leaves a semicolon where `joins` follow."""
    gap = _NEXT.match(source, end)
    after = gap.end() if gap is not None else end
    if source[after:after + 1] and source[after] in joins and (
            not newline or b'\n' in source[end:after]):
        yield start, end, b';' + _blank(source[start + 1:end])
    else:
        yield start, end, b''


def _arrow(source: bytes, node: Node) -> Iterator[tuple[int, int, bytes]]:
    """Yield edits that keep the parentheses of an arrow function's parameters on its lines."""
    generic = node.child_by_field_name('type_parameters')
    inputs = node.child_by_field_name('parameters')
    output = node.child_by_field_name('return_type')
    if inputs is None:
        return
    # No line may end before the parameters, as after `return`, nor between them and the arrow.
    if generic is not None and generic.end_point.row != generic.start_point.row:
        start, end = generic.start_byte, inputs.start_byte + 1
        yield start, end, b'(' + _blank(source[start + 1:end])
    if output is not None and output.end_point.row != inputs.end_point.row:
        start, end = inputs.end_byte - 1, output.end_byte
        yield start, end, _blank(source[start:end - 1]) + b')'


def _blank(text: bytes) -> bytes:
    """Return blanks of the same lines and columns, as browsers count them."""
    if text.isascii():
        return _NO_BLANK.sub(' ', text.decode('ascii')).encode('ascii')
    return _NO_BLANK.sub(
        lambda found: ' ' * (len(found[0].encode('utf-16-le')) // 2), text.decode()).encode()


def _faults(node: Node) -> Iterator[Node]:
    """Yield the nodes that the grammar does not know, from the first."""
    if node.is_error or node.is_missing:
        yield node
    for child in node.children if node.has_error else ():
        yield from _faults(child)


def _error(node: Node, name: str, why: str) -> CrgameError:
    row, column = node.start_point
    text = (node.text or node.type.encode()).decode(errors='replace').partition('\n')[0][:40]
    return CrgameError(f'{name}: line {row + 1}, column {column + 1}: `{text}` {why}')
