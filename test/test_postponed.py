# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Imports by packages that are postponed until a function of them is called."""

from pathlib import Path
import subprocess
import sys
import xml

from crgame_ros.postponed import postponed
import pytest

USER = 'from colorsys import rgb_to_hsv\nimport colorsys as drawing\n'


def test_what_is_called_is_loaded_then(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / 'user_of_colorsys.py').write_text(USER)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.delitem(sys.modules, 'colorsys', raising=False)
    with postponed('colorsys'):
        import user_of_colorsys as user
    assert 'colorsys' not in sys.modules
    with pytest.raises(AttributeError, match='__file__'):
        _ = user.drawing.__file__
    assert user.rgb_to_hsv(1.0, 0.0, 0.0) == user.drawing.rgb_to_hsv(1.0, 0.0, 0.0) == (0, 1, 1)
    assert 'colorsys' in sys.modules
    with pytest.raises(AttributeError, match='paint'):
        user.drawing.paint()


def test_a_part_of_a_package_is_loaded_alone(tmp_path: Path) -> None:
    """The package is loaded afterwards as if nothing had been; nothing else of it is before."""
    (tmp_path / 'user_of_tools.py').write_text('from tools import cut, glue, paint\n')
    package = tmp_path / 'tools'
    package.mkdir()
    (package / '__init__.py').write_text('from tools.saws import cut\nfrom tools.pots import *\n')
    (package / 'saws.py').write_text('from . import _steel\ndef cut(): return _steel.NAME\n')
    (package / '_steel.py').write_text('NAME = "steel"\n')
    (package / 'pots.py').write_text('def glue(): return "glue"\ndef paint(): return "paint"\n')
    code = """
import sys
from crgame_ros.postponed import postponed
with postponed('tools', parts={'cut': 'saws'}):
    import user_of_tools as user
print(user.cut(), *sorted(name for name in sys.modules if name.startswith('tools')))
print(user.glue(), user.cut(), sys.modules['tools'].paint(), sys.modules['tools'].cut())
"""
    done = subprocess.run([sys.executable, '-c', code], capture_output=True, text=True,
                          cwd=tmp_path, check=True)
    assert done.stdout.splitlines() == [
        'steel tools._steel tools.saws', 'glue steel paint steel']


def test_what_is_there_already_stays() -> None:
    with postponed('pathlib'):
        assert sys.modules['pathlib'].Path is Path
    assert sys.modules['pathlib'].Path is Path


def test_nothing_is_loaded_that_only_draws() -> None:
    """Neither by the checker nor by the planners of the packages."""
    code = 'import sys, crgame_ros.analysis.scores.checker, crgame_ros.planner.idm_package, ' \
        'crgame_ros.planner.reactive; print(*sys.modules)'
    done = subprocess.run([sys.executable, '-c', code], capture_output=True, text=True, check=True)
    assert not {'matplotlib', 'numpy.f2py'} & {*done.stdout.split()}


def test_parts_of_packages_are_as_before_in_the_end(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ('curses', 'curses.ascii', 'xml.sax'):
        monkeypatch.delitem(sys.modules, name, raising=False)
    monkeypatch.delattr(xml, 'sax', raising=False)
    with postponed('curses', 'curses.ascii', 'xml.sax'):
        from curses import ascii as letters
        import curses.ascii as same
        assert letters is same and 'sax' in vars(xml)
    assert same.isdigit('7')
    assert 'curses.ascii' in sys.modules and 'xml.sax' not in sys.modules
    assert 'sax' not in vars(xml)
