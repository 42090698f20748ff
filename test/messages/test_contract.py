# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The contract itself: every row agrees with the types it names; its page is up to date."""

from collections.abc import Iterator
from dataclasses import fields, is_dataclass
import importlib
from pathlib import Path
import re
from types import ModuleType
from typing import Annotated, Any, get_args, get_origin, get_type_hints

from crgame_ros.errors import InputError
from crgame_ros.game.documents import EVENTS, GAME, RUN_STATE, SIGNALS
from crgame_ros.game.seat_documents import DRIVERS, ORDER, SeatPerson, SEATS
from crgame_ros.game.task_documents import TASK_LOG, TASK_REPORT, TASK_STATE
from crgame_ros.game.view_documents import VIEW_PICTURE
from crgame_ros.messages.contract import load_contract, Topic
from crgame_ros.messages.instrument_samples import STREAMS, TEXTS
from crgame_ros.paths import share_directory
from crgame_ros.ros.endpoints import message_type, qos_profile
import pytest
from rclpy.qos import DurabilityPolicy, HistoryPolicy, ReliabilityPolicy
import yaml

CONTRACT = load_contract()
TOPICS = list(CONTRACT.topics.values())
NODES = {path.stem for path in (Path(__file__).parents[2] / 'crgame_ros' / 'nodes').glob('*.py')
         if path.stem != '__init__'}
# ROS 2 names: words of letters, digits and underscores, here with placeholders among them.
NAME = re.compile(r'(/(<hv>|<av>|<v>|[a-z][a-z0-9_]*))+')
PARAMETER_TYPES = {'string', 'double', 'bool', 'integer'}


@pytest.fixture
def page_maker(project_root: Path, monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    """Return the script that makes the page."""
    monkeypatch.syspath_prepend(project_root / 'scripts')
    return importlib.import_module('make_interface_docs')


def _by_name(topic: Topic) -> str:
    return topic.name


def _walk(message: Any, path: str) -> Iterator[str]:
    """Yield the parts of a path like `status.values` that a message type does not have."""
    for part in path.split('.'):
        fields = message.get_fields_and_field_types()
        if part not in fields:
            yield f'{message.__name__} has no {part}, only {", ".join(fields)}'
            return
        inner = re.sub(r'sequence<(.*?)(, \d+)?>|(.*)\[\d+\]', r'\1\3', fields[part])
        if '/' in inner:
            package, name = inner.split('/')
            message = message_type(f'{package}/msg/{name}')


def _keys(kind: Any) -> Iterator[str]:
    """Yield the names of a document's fields, and of those in its parts."""
    if is_dataclass(kind) and kind is not SeatPerson:
        hints = get_type_hints(kind)
        for field in fields(kind):
            if field.init:
                yield field.name
                yield from _keys(hints[field.name])
    for part in get_args(kind)[:1 if get_origin(kind) is Annotated else None]:
        yield from _keys(part)


# The objects' descriptions are told in words; /seats alone has the keys of a person.
@pytest.mark.parametrize('document', [
    GAME, SIGNALS, EVENTS, RUN_STATE, TASK_LOG, TASK_STATE, TASK_REPORT, SEATS, ORDER, DRIVERS,
    VIEW_PICTURE, STREAMS, TEXTS], ids=lambda document: document.topic)
def test_every_key_of_a_document_is_in_the_contract(document: Any) -> None:
    """A game's keys below the first level are in docs/keys.md."""
    kind = document._kind
    keys = [field.name for field in fields(kind)] if document is GAME else list(_keys(kind))
    if document is SEATS:
        keys += [field.name for field in fields(SeatPerson)]
    text = CONTRACT.topics[document.topic].fields['data']
    assert [key for key in keys if not re.search(rf'\b{key}\b', text)] == []


def test_the_contract_is_whole() -> None:
    """Each essential topic has a row, under its usual name."""
    assert {'/clock', '/scenario/xml', '/vehicles/state', '/<av>/plan_request', '/<av>/plan',
            '/<v>/driver_command', '/timing/cycle', '/diagnostics'} <= set(CONTRACT.topics)
    assert {service.name for service in CONTRACT.services.values() if not service.optional} == {
        *(f'/sim/{name}' for name in ('start', 'pause', 'step', 'reset', 'stop')),
        '/<av>/planner_run'}


@pytest.mark.parametrize('topic', TOPICS, ids=_by_name)
def test_row_names_what_exists(topic: Topic) -> None:
    """Name, nodes and type are real ones, and each described field is in the message."""
    assert NAME.fullmatch(topic.name)
    assert set(topic.producers) <= NODES | {'external'} and topic.producers
    assert set(topic.consumers) <= NODES | {'external'} and topic.consumers
    assert len(set(topic.producers)) == len(topic.producers)
    assert len(set(topic.consumers)) == len(topic.consumers)
    assert topic.fields
    if not topic.available:
        # Standard messages are everywhere; tf2_msgs is in every ROS installation, not a wheel.
        assert topic.type_name == 'tf2_msgs/msg/TFMessage' and not topic.record
        return
    kind = message_type(topic.type_name)
    assert not [fault for path in topic.fields for fault in _walk(kind, path)]


@pytest.mark.parametrize('topic', TOPICS, ids=_by_name)
def test_qos_is_what_rclpy_gets(topic: Topic) -> None:
    """The profile keeps the row's last messages; nothing is lost on purpose."""
    profile = qos_profile(topic.qos)
    assert profile.history == HistoryPolicy.KEEP_LAST
    assert profile.depth == topic.qos.depth >= 1
    assert profile.reliability == ReliabilityPolicy.RELIABLE
    assert profile.durability == {'volatile': DurabilityPolicy.VOLATILE,
                                  'transient_local': DurabilityPolicy.TRANSIENT_LOCAL}[
                                      topic.qos.durability]


def test_slots_are_one_deep_and_documents_latched() -> None:
    """CRG algorithm 2 exchanges single slots; a late subscriber still gets the documents."""
    for name in ('/<av>/plan_request', '/<av>/plan', '/<v>/driver_command'):
        assert CONTRACT.topics[name].qos.depth == 1
    happenings = ('/trigger', '/seats/order', '/tasks/log', '/tasks/report',
                  '/instruments/texts', '/views/pictures')
    for topic in TOPICS:
        if topic.type_name == 'std_msgs/msg/String' and topic.name not in happenings:
            assert topic.qos.durability == 'transient_local', topic.name


def test_what_is_recorded_goes_to_the_recorder() -> None:
    """`record` and the recorder's place among the consumers agree."""
    assert ([topic.name for topic in TOPICS if topic.record]
            == [topic.name for topic in TOPICS if 'recorder_node' in topic.consumers])


def test_simulation_time_has_one_publisher() -> None:
    """Only `sim_node` owns the clock."""
    assert CONTRACT.topics['/clock'].producers == ('sim_node',)


def test_placeholders_stand_for_the_vehicles_of_a_kind() -> None:
    """<hv> is each human, <av> each AV, <v> both; a plain name is itself."""
    humans, avs = ('hv0', 'hv1'), ('av0',)
    names = {topic.name: topic.names(humans, avs) for topic in TOPICS}
    assert names['/<hv>/joy'] == ('/hv0/joy', '/hv1/joy')
    assert names['/<av>/plan'] == ('/av0/plan',)
    assert names['/<v>/odom'] == ('/hv0/odom', '/hv1/odom', '/av0/odom')
    assert names['/clock'] == ('/clock',)
    everything = [name for group in names.values() for name in group]
    assert len(set(everything)) == len(everything)
    assert not any('<' in name for name in everything)
    assert CONTRACT.topics['/<v>/odom'].name_for('av7') == '/av7/odom'
    assert CONTRACT.topics['/clock'].name_for('av7') == '/clock'


def test_services_and_parameters_name_what_exists() -> None:
    """Service types can be called; parameters belong to nodes and have a type and a meaning."""
    for service in (*CONTRACT.services.values(), *CONTRACT.actions.values()):
        assert NAME.fullmatch(service.name) and service.what
        package, kind, name = service.type_name.split('/')
        if service.optional:
            # The standard's names are those of the types.
            assert package == 'simulation_interfaces'
            assert re.sub('([A-Z])', r'_\1', name).lower() == service.name.replace('/', '_')
        if service.available:
            parts = ('Goal', 'Result', 'Feedback') if kind == 'action' else ('Request', 'Response')
            assert all(hasattr(message_type(service.type_name), part) for part in parts)
    assert set(CONTRACT.parameters) <= NODES
    for rows in CONTRACT.parameters.values():
        for row in rows.values():
            assert row['type'] in PARAMETER_TYPES and row['what']


@pytest.mark.parametrize('change', [
    {'type': None}, {'producer': None}, {'consumers': None}, {'record': None}, {'fields': None},
    {'rate_hz': None}, {'qos': 'best'}, {'qos': {'depth': 1}},
    {'qos': {'depth': 1, 'reliability': 'reliable', 'durability': 'volatile', 'deadline': 1}}])
def test_incomplete_row_is_refused(change: dict[str, Any], tmp_path: Path) -> None:
    """A missing entry or an unknown QoS is an error that names the file and the topic."""
    content = yaml.safe_load((share_directory() / 'msg_defs' / 'interfaces.yaml').read_text())
    for key, value in change.items():
        if value is None:
            del content['topics']['/<av>/plan'][key]
        else:
            content['topics']['/<av>/plan'][key] = value
    path = tmp_path / 'interfaces.yaml'
    path.write_text(yaml.safe_dump(content))
    with pytest.raises(InputError, match=r'interfaces\.yaml: /<av>/plan: '):
        load_contract(path)


def test_page_has_every_row(page_maker: ModuleType) -> None:
    """Each topic, field, service and parameter has a line in a table."""
    lines = page_maker.document().splitlines()
    for topic in TOPICS:
        row, = (line for line in lines if line.startswith(f'| `{topic.name}` |'))
        for text in (topic.type_name, topic.qos.reliability, f'depth {topic.qos.depth}',
                     topic.rate, *topic.producers, *topic.consumers):
            assert text in row
        section = lines[lines.index(f'### `{topic.name}`'):]
        for field in topic.fields:
            assert any(line.startswith(f'| `{field}` |') for line in section)
    for name in (*CONTRACT.services, *CONTRACT.actions, *CONTRACT.parameters['sim_node']):
        assert sum(f'| `{name}` |' in line for line in lines) == 1


def test_page_follows_the_file(project_root: Path, tmp_path: Path,
                               page_maker: ModuleType) -> None:
    """A changed depth appears in the page made from the changed file, and only there."""
    source = project_root / 'msg_defs' / 'interfaces.yaml'
    path = tmp_path / 'interfaces.yaml'
    text = source.read_text(encoding='utf-8')
    path.write_text(text.replace('clock: {depth: 10,', 'clock: {depth: 11,'), encoding='utf-8')
    before, after = (page_maker.document(item).splitlines() for item in (source, path))
    changed = [pair for pair in zip(before, after, strict=True) if pair[0] != pair[1]]
    assert len(changed) == 1
    assert changed[0][1] == changed[0][0].replace('depth 10', 'depth 11')
