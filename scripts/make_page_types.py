# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Write the types of the pages' messages in TypeScript from the classes that read them."""

import json
from pathlib import Path
import re
import sys
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from crgame_ros.cockpit.page_messages import PageMessage  # noqa: E402
from crgame_ros.study.desk.messages import (  # noqa: E402
    ExperimenterMessage,
    ParticipantMessage,
)
from pydantic import TypeAdapter  # noqa: E402
from written import main_of  # noqa: E402

FILES = {
    'page/cockpit/js/page_messages.d.ts': {'PageMessage': PageMessage},
    'page/desk/js/page_messages.d.ts': {
        'ParticipantMessage': ParticipantMessage, 'ExperimenterMessage': ExperimenterMessage}}
HEAD = """\
// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** What the server takes from pages. Written by scripts/make_page_types.py: do not edit. */

/** Messages that get a reply, before they have a number. */
export type Unnumbered<T> = T extends { id: number } ? Omit<T, 'id'> : never;
"""
WIDTH = 99


def typescript(schema: dict[str, Any]) -> str:
    """Return the type that a JSON Schema describes."""
    if '$ref' in schema:
        return str(schema['$ref']).rpartition('/')[2]
    if 'const' in schema:
        return _literal(schema['const'])
    if 'enum' in schema:
        return ' | '.join(map(_literal, schema['enum']))
    if 'anyOf' in schema:
        return ' | '.join(dict.fromkeys(' | '.join(map(typescript, schema['anyOf'])).split(' | ')))
    match schema.get('type'):
        case 'array':
            entries = schema.get('prefixItems') or [schema['items']]
            types = list(dict.fromkeys(' | '.join(map(typescript, entries)).split(' | ')))
            return f'{types[0]}[]' if len(types) == 1 else f'({" | ".join(types)})[]'
        case 'object':
            return f'Record<string, {typescript(schema["additionalProperties"])}>'
        case 'integer':
            return 'number'
        case kind:
            return str(kind)


def _literal(value: object) -> str:
    return f"'{value}'" if isinstance(value, str) else json.dumps(value)


def declaration(name: str, schema: dict[str, Any]) -> str:
    """Return the type of a message or of a part of it; what has a default may be left out."""
    if schema.get('type') == 'array':
        # A NamedTuple: JSON Schema has the names of its entries as titles.
        entries = [_folded(f'  {part["title"].lower().replace(" ", "_")}'
                           f'{"?" if "default" in part else ""}: {typescript(part)},')
                   for part in schema['prefixItems']]
        return '\n'.join((f'\nexport type {name} = [', *entries, '];', ''))
    needed = {'type', *schema.get('required', ())}
    lines = [_folded(f'  {key}{"" if key in needed else "?"}: {typescript(part)};')
             for key, part in schema['properties'].items()]
    first = schema['description'].splitlines()[0]
    return '\n'.join((f'\n/** {first} */', f'export interface {name} {{', *lines, '}', ''))


def _folded(line: str) -> str:
    """Return a line, continued below where it has too many columns, before a bar."""
    rows = ['']
    for part in re.split(r'(?= \| )', line):
        if len(rows[-1]) + len(part) > WIDTH:
            rows.append('   ')
        rows[-1] += part
    return '\n'.join(rows)


def types_of(unions: dict[str, Any]) -> str:
    """Return the file with some unions of messages."""
    known: dict[str, dict[str, Any]] = {}
    ends = ''
    for name, union in unions.items():
        schema = TypeAdapter(union).json_schema()
        known |= schema['$defs']
        members = [typescript(part) for part in schema['anyOf']]
        ends += '\n' + _folded(f'export type {name} = {" | ".join(members)};') + '\n'
    return HEAD + ''.join(declaration(name, known[name]) for name in sorted(known)) + ends


def files() -> dict[Path, str]:
    """Return the files' texts."""
    return {ROOT / name: types_of(unions) for name, unions in FILES.items()}


if __name__ == '__main__':
    sys.exit(main_of(__doc__, files))
