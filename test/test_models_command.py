# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""`crgame models` lists what a game may name; what it lists is what the registries take."""

from pathlib import Path

from crgame_ros.cli import main
from crgame_ros.errors import InputError
from crgame_ros.models_command import REGISTRIES, registry_of
from crgame_ros.schema.model_options import options_of
import pytest

OWN = '''\
from crgame_ros import Planner


class Mine(Planner):
    """
    A planner that waits.

    :param pause: before it begins [s]
    :param keen: whether it hurries.
    """

    name = 'mine'

    def __init__(self, pause: float, keen: bool = True) -> None:
        pass

    def setup(self, context):
        pass

    def plan(self, request):
        return None
'''


@pytest.mark.parametrize('kind', REGISTRIES)
def test_the_listed_options_are_those_that_are_taken(kind: str) -> None:
    """A listed one gets as far as its value; another one is refused by name."""
    registry = registry_of(kind)
    assert registry.names()
    for name in registry.names():
        options = options_of(registry, name)
        assert [option.name for option in options if not option.meaning] == []
        given = dict.fromkeys(registry.given)
        for option in options:
            with pytest.raises(InputError, match=f'"{option.name}" is <object'):
                registry.create(name, {option.name: object()}, **given)
        with pytest.raises(InputError, match='"colour" is unknown'):
            registry.create(name, {'colour': 1}, **given)


def test_models_are_listed_by_kind(capsys: pytest.CaptureFixture[str]) -> None:
    """All of them, or one kind; each with what it is."""
    assert main(['models']) == 0
    text = capsys.readouterr().out
    assert all(f'{kind} (docs/' in text for kind in REGISTRIES)
    assert main(['models', 'tracker']) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == 'tracker (docs/control.md)'
    assert [line.split()[0] for line in lines[1:] if line[2] != ' '] == ['lqr', 'pure-pursuit']


def test_the_options_of_an_own_planner_are_listed(
        tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """From its annotations and its docstring."""
    path = tmp_path / 'mine.py'
    path.write_text(OWN, encoding='utf-8')
    assert main(['models', 'planner', f'{path}:Mine']) == 0
    assert capsys.readouterr().out.splitlines() == [
        f'{path}:Mine: A planner that waits.',
        '  pause  before it begins [s]; a number (required)',
        '  keen   whether it hurries; true or false (default: true)']


def test_what_is_none_of_them_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    """In a line that names those there are."""
    assert main(['models', 'tracker', 'magic']) == 2
    assert 'there is no tracker "magic"; known are lqr, pure-pursuit' in capsys.readouterr().err
