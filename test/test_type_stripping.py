# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Types taken out of TypeScript; test/page compares all pages with another implementation."""

from crgame_ros.errors import CrgameError
from crgame_ros.type_stripping import strip_types
import pytest


def stripped(source: str) -> str:
    return strip_types(source.encode(), 'page.ts').decode()


@pytest.mark.parametrize(('source', 'wanted'), [
    ('let x: number | null = null;', 'let x = null;'),
    ('let x!: number;', 'let x;'),
    ('const f = (a: A, b?: B, ...c: C[]): D => a;', 'const f = (a, b, ...c) => a;'),
    ('const f = async <T,>(x: T): Promise<T> => x;', 'const f = async (x) => x;'),
    ('function f(this: Window, a = 1): asserts a is 1 {}', 'function f(a = 1) {}'),
    ('function f<T extends { a: 1 }>({ a }: T): a is 1 {}', 'function f({ a }) {}'),
    ('function f(a: 1): 1;\nfunction f(a: any) { return a; }', 'function f(a) { return a; }'),
    ('new Map<string, Map<string, number>>();', 'new Map();'),
    ('const a = f<A>(b) + c < d;', 'const a = f(b) + c < d;'),
    ('a = b as unknown as C; d = (e satisfies F)!.g![0]!;', 'a = b; d = (e).g[0];'),
    ('for (const a of [1, 2] as const) {}', 'for (const a of [1, 2]) {}'),
    ('try {} catch (error: unknown) {}', 'try {} catch (error) {}'),
    ("import type { A } from './a.js';\nimport { b, type C, d } from './b.js';",
     "import { b, d } from './b.js';"),
    ("export type { A } from './a.js';\nexport { b, type C };", 'export { b, };'),
    ('export interface A<B> extends C { d: string }\nexport type E = A[];\ne();', 'e();'),
    ('declare global { interface Window { a: 1 } }\ndeclare enum A { b }\nc();', 'c();'),
    ('class A<T> extends B<T> implements C { static readonly #d?: 1 = 1; e!: T; f;\n'
     '  declare g: T; [name: string]: T;\n'
     '  private async h?(): Promise<void> {} protected override get i(): 1 { return 1; }\n'
     '  j(): void; j(a?: T) {} }',
     'class A extends B { static #d = 1; e; f; ;\n'
     ' async h() {} get i() { return 1; }\n j(a) {} }'),
    ('abstract class A { abstract b: 1; abstract c(): void; d = 1; }', 'class A { ;; d = 1; }'),
    ('const a = `${b as C} as D: E`; // f: G\nconst h = /: I</;',
     'const a = `${b} as D: E`; // f: G\nconst h = /: I</;'),
    ('const as = type ? of : satisfies; type = as; as(type);',
     'const as = type ? of : satisfies; type = as; as(type);'),
])
def test_types_vanish_and_nothing_else(source: str, wanted: str) -> None:
    def tokens(text: str) -> str:
        return ''.join(text.split()).replace(';', '')
    assert tokens(stripped(source)) == tokens(wanted)


@pytest.mark.parametrize('source', [
    'const a: {\n  b: string;\n} = c();', 'f(/* ä */ b as /* 𝄞 €\n */ C, d);',
    'interface A {\r\n  b: "ü€";\r\n}\r\nc();'])
def test_lines_and_columns_stay(source: str) -> None:
    """Columns are counted in UTF-16, as browsers do."""
    found, wanted = (text.encode('utf-16-le') for text in (stripped(source), source))
    assert len(found) == len(wanted)
    assert all(a == b or a == ord(' ') for a, b in zip(found[::2], wanted[::2], strict=True))
    assert found.count(b'\n\0') == wanted.count(b'\n\0')


@pytest.mark.parametrize(('source', 'wanted'), [
    ('const a = b as C\n(d).e()', 'const a = b;    \n(d).e()'),
    ('a = b satisfies C // d\n(e)()', 'a = b;            // d\n(e)()'),
    ('type A = B\n[c].d()', ';         \n[c].d()'),
    ('a = b as C\n  + d', 'a = b     \n  + d'),
    ('a = b\ntype C = D\n(e)()', 'a = b\n;         \n(e)()'),
    ('class A { b = 1\ndeclare c: D\n["e"] = 2 }', 'class A { b = 1\n;           \n["e"] = 2 }')])
def test_statements_without_a_semicolon_stay_apart(source: str, wanted: str) -> None:
    assert stripped(source) == wanted


@pytest.mark.parametrize(('source', 'wanted'), [
    ('a = (b): {\n  c: D;\n} => b;', 'a = (b    \n       \n) => b;'),
    ('a = async <\n  B,\n>(c: B) => c;', 'a = async (\n    \n  c   ) => c;'),
    ('f(() => { return <B,\n>(c) => c; });', 'f(() => { return (  \n  c) => c; });')])
def test_no_line_ends_where_javascript_forbids_it(source: str, wanted: str) -> None:
    """Parentheses move to the line of the arrow, or of the word before them."""
    assert stripped(source) == wanted


@pytest.mark.parametrize(('source', 'told'), [
    ('enum A { b }', 'line 1, column 1: `enum A { b }` is more'),
    ('const enum A { b }', 'is more'),
    ('a();\nnamespace B { c(); }', 'line 2, column 1'),
    ('class A { constructor(private b: C) {} }', '`private` is more'),
    ('class A { constructor(readonly b: C) {} }', '`readonly` is more'),
    ("import a = require('b');", 'is more'),
    ('export = a;', 'is more'),
    ('const a = <B>c;', '`<B>c` is more'),
    ('@a class B {}', '`@a` is more'),
    ('a = b as C\n[d].e()', 'line 2, column 1'),
    ('a = b as C\n`d`.e()', 'line 1'),
    ('a();\n\nconst b: = 1;', 'line 3, column 8'),
    ('if (a) {', '`}` is missing')])
def test_what_is_more_than_a_type_is_refused(source: str, told: str) -> None:
    with pytest.raises(CrgameError, match='^page.ts: line') as failure:
        stripped(source)
    assert told in str(failure.value)
