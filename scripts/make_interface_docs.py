# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Write docs/interfaces.md, the tables of the contract, from msg_defs/interfaces.yaml."""

from collections.abc import Mapping
from pathlib import Path
import re
import sys

from crgame_ros.messages.contract import Contract, load_contract, Qos, Service, Topic
from written import escaped, main_of, table

ROOT = Path(__file__).resolve().parent.parent
SOURCE = ROOT / 'msg_defs' / 'interfaces.yaml'
TARGET = ROOT / 'docs' / 'interfaces.md'
NOTICE = """\
Made from the contract, [msg_defs/interfaces.yaml](../msg_defs/interfaces.yaml), by
`scripts/make_interface_docs.py`: edit that file, not this one. The code creates its endpoints from
the contract, and a test compares a running graph with it. All messages are of standard packages:
nothing has to be built to take part. `external` stands for any other node that listens or answers.
The history of every topic is keep last."""


def files() -> dict[Path, str]:
    """Return the page."""
    return {TARGET: document()}


def document(source: Path = SOURCE) -> str:
    """Return the whole page for a contract file."""
    contract = load_contract(source)
    general, trajectories = _comments(source.read_text(encoding='utf-8'))
    parts = ['# Interfaces', NOTICE, *general, '## Vehicles and objects in a JointTrajectory',
             *trajectories, '## Topics', _overview(contract)]
    parts += [_details(topic) for topic in contract.topics.values()]
    parts += ['## Services', 'All are offered by `sim_node`.', _services(contract.services),
              '## Actions', 'All are offered by `sim_node`.', _services(contract.actions),
              '## Parameters', 'These may be set while the node runs.',
              _parameters(contract)]
    return '\n\n'.join(parts) + '\n'


def _comments(text: str) -> tuple[list[str], list[str]]:
    """Return the file's two explanations: at its head, and that of trajectories as a table."""
    head, trajectories = (
        [line[1:].removeprefix(' ') for line in block.splitlines()]
        for block in re.findall(r'^#[^\n]*(?:\n#[^\n]*)+', text, re.MULTILINE)[:2])
    paragraphs = '\n'.join(head).split('\n\n')
    general = [escaped(paragraph).replace('\n', ' ') for paragraph in paragraphs[2:]]
    rows: list[list[str]] = []
    for line in trajectories[1:]:
        label, _, text = line.strip().partition('  ')
        if text:
            rows.append([label, text.strip()])
        else:
            rows[-1][1] += f' {label}'
    return general, [table(('field', 'meaning'), (
        (', '.join(map(_code, label.split(', '))), escaped(text)) for label, text in rows))]


def _overview(contract: Contract) -> str:
    return table(('topic', 'type', 'QoS', 'rate [Hz]', 'from', 'to', 'recorded'), (
        (_code(topic.name), _code(topic.type_name), _qos(topic.qos), escaped(topic.rate),
         ', '.join(topic.producers), ', '.join(topic.consumers), 'yes' if topic.record else 'no')
        for topic in contract.topics.values()))


def _qos(qos: Qos) -> str:
    return f'{qos.reliability}, {qos.durability}, depth {qos.depth}'.replace('_', ' ')


def _details(topic: Topic) -> str:
    rows = ((_code(field), escaped(meaning)) for field, meaning in topic.fields.items())
    return f'### {_code(topic.name)}\n\n' + table(('field', 'meaning'), rows)


def _services(services: Mapping[str, Service]) -> str:
    return table(('name', 'type', 'what it does'), (
        (_code(service.name), _code(service.type_name), escaped(service.what))
        for service in services.values()))


def _parameters(contract: Contract) -> str:
    return table(('node', 'parameter', 'type', 'meaning'), (
        (_code(node), _code(name), row['type'], escaped(row['what']))
        for node, parameters in contract.parameters.items() for name, row in parameters.items()))


def _code(text: str) -> str:
    return f'`{text}`'


if __name__ == '__main__':
    sys.exit(main_of(__doc__, files))
