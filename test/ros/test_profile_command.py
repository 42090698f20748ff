# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The profile for nodes that are started one by one; test_by_hand.py runs nodes with it."""

from pathlib import Path
import shlex

from crgame_ros.cli import main
from crgame_ros.ros.environment import loopback_profile, PROFILE_VARIABLES
from crgame_ros.ros.run_profile import open_topics, write_run_profile
import pytest


def test_a_shell_gets_the_profile_and_others_the_same(
        tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Its partition is known to its owner alone, and each shell has the same."""
    file = tmp_path / 'a folder' / 'fastdds.xml'
    file.parent.mkdir()
    assert main(['dds-profile', str(file), '--own-orders', '--namespace', '/exp1']) == 0
    first, text = capsys.readouterr().out, file.read_text()
    assert shlex.split(first) == ['export', *(f'{name}={file}' for name in PROFILE_VARIABLES)]
    assert file.stat().st_mode & 0o777 == 0o600
    assert 'profile_name="/exp1/clock"' in text and 'profile_name="/exp1/trigger"' in text
    assert main(['dds-profile', str(file), '--namespace', '/exp1']) == 0
    assert (capsys.readouterr().out, file.read_text()) == (first, text)
    assert main(['dds-profile', str(file), '--namespace', 'exp1']) == 0
    assert (capsys.readouterr().out, file.read_text()) == (first, text)
    assert list(file.parent.iterdir()) == [file]
    assert main(['dds-profile', str(file), '--namespace', 'no name']) == 2
    assert 'is no namespace' in capsys.readouterr().err


def test_what_cannot_be_is_refused_in_a_line(
        tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
        capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / 'fastdds.xml'
    assert main(['dds-profile', str(file)]) == 0
    capsys.readouterr()
    for words, reason in ((['--own-orders'], 'was made without --own-orders'),
                          (['--namespace', '/exp1'], 'in the namespace /exp1')):
        assert main(['dds-profile', str(file), *words]) == 2
        said = capsys.readouterr()
        assert reason in said.err and not said.out
    file.unlink()
    assert main(['dds-profile', str(tmp_path / 'none' / 'fastdds.xml')]) == 2
    assert 'cannot be written' in capsys.readouterr().err
    monkeypatch.setenv('RMW_IMPLEMENTATION', 'rmw_cyclonedds_cpp')
    assert main(['dds-profile', str(file)]) == 2
    said = capsys.readouterr()
    assert said.err.startswith('error: dds-profile: needs Fast DDS') and not said.out
    assert not file.exists()


def test_vehicles_of_a_later_game_that_the_profile_leaves_open(
        tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The first numbers and those of the first game are covered; others are named."""
    file = tmp_path / 'fastdds.xml'
    write_run_profile(file, '/exp1', ['hv200'])
    monkeypatch.setenv(PROFILE_VARIABLES[0], str(file))
    assert open_topics('/exp1', ['hv0', 'hv15', 'hv200'], ['av0', 'av15']) == []
    found = open_topics('/exp1', ['hv0'], ['av15', 'av16'])
    assert '/exp1/av16/plan_request' in found
    assert all('/av16/' in name for name in found)
    for other in (loopback_profile(), tmp_path / 'none.xml', Path(__file__)):
        monkeypatch.setenv(PROFILE_VARIABLES[0], str(other))
        assert open_topics('/exp1', ['hv0'], ['av16']) == []
