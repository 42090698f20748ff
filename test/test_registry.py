# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The registry behind every kind of model that a game may name."""

from importlib.metadata import EntryPoint
from pathlib import Path
import re
import subprocess
import sys

from crgame_ros.control.lqr import LqrTracker
from crgame_ros.control.tracker import Tracker
from crgame_ros.errors import InputError
from crgame_ros.registry import ModelRegistry
from crgame_ros.vehicle.parameters import load_vehicle_parameters
import pytest

ROOT = Path(__file__).resolve().parents[1]
GIVEN = {'vehicle': load_vehicle_parameters(), 'dt_s': 0.01}
LQR = 'crgame_ros.control.lqr:LqrTracker'
CODE = """
from crgame_ros.control.tracker import Control, Tracker
from crgame_ros.errors import InputError


class Straight(Tracker):
    def __init__(self, vehicle, dt_s, push: float, mode: int = 0) -> None:
        super().__init__(vehicle, dt_s)
        if push > 5.0:
            raise InputError(f'"push" is {push}', 'options of straight', 'give less')
        self.push = push

    def reset(self): pass

    def control(self, pose, reference):
        return Control(0.0, self.push)


class Narrow(Straight):
    def __init__(self, vehicle): pass


class Hinted(Straight):
    def __init__(self, vehicle: 'Car', dt_s: float) -> None: pass


class Half(Tracker):
    def reset(self): pass
"""


@pytest.fixture
def registry() -> ModelRegistry:
    return ModelRegistry('trackers', 'tracker', {'lqr': LQR}, Tracker, 'docs/control.md')


@pytest.fixture
def file(tmp_path: Path) -> str:
    path = tmp_path / 'straight.py'
    path.write_text(CODE, encoding='utf-8')
    return str(path)


@pytest.mark.parametrize('name', ['lqr', LQR])
def test_classes_by_name_and_by_module(registry: ModelRegistry, name: str) -> None:
    made = registry.create(name, {'slip': 1, 'feed_forward': False}, **GIVEN)
    assert isinstance(made, LqrTracker)
    assert (made.dynamics.slip, made.settings.feed_forward, made.dt_s) == (1.0, False, 0.01)


def test_a_class_of_a_file(registry: ModelRegistry, file: str) -> None:
    assert registry.create(f'{file}:Straight', {'push': 2}, **GIVEN).push == 2.0


@pytest.mark.parametrize('hint', ['', ': Any', ': object'])
def test_an_option_may_be_of_any_kind(registry: ModelRegistry, tmp_path: Path, hint: str) -> None:
    path = tmp_path / 'any.py'
    path.write_text(f'from typing import Any\n{CODE.replace("push: float", f"push{hint}")}'
                    .replace('if push > 5.0', 'if push is None'), encoding='utf-8')
    made = registry.create(f'{path}:Straight', {'push': [1, 'two']}, **GIVEN)
    assert made.push == [1, 'two']


def test_entry_points_come_after_the_built_in_names(
        registry: ModelRegistry, monkeypatch: pytest.MonkeyPatch) -> None:
    asked = []

    def points(group: str) -> list[EntryPoint]:
        asked.append(group)
        return [EntryPoint('mine', LQR, group), EntryPoint('lqr', 'other:Lqr', group)]

    monkeypatch.setattr('crgame_ros.registry.entry_points', points)
    assert registry.names() == ('lqr', 'mine')
    assert registry.find('mine') is LqrTracker
    assert registry.find('lqr') is LqrTracker
    assert set(asked) == {'crgame_ros.trackers'}


@pytest.mark.parametrize(('options', 'message'), [
    ({'dt_s': 1.0}, '"dt_s" is unknown; allowed are: lateral_error, heading_error'),
    ({'gain': 1.0}, '"gain" is unknown; allowed are: lateral_error'),
    ({'slip': 'much'}, '"slip" is \'much\'; give a number or null'),
    ({'feed_forward': 1.0}, '"feed_forward" is 1.0; give true or false or null'),
    ({'slip': 1.5}, '"slip" is 1.5; give a number from 0 to 1')],
    ids=['supplied', 'unknown', 'text', 'number for a switch', 'out of bounds'])
def test_wrong_options_are_refused_with_their_place(
        registry: ModelRegistry, options: dict[str, object], message: str) -> None:
    """Arguments of the program are no options, and messages name the key of the game."""
    with pytest.raises(InputError, match=re.escape(message)) as caught:
        registry.create('lqr', options, 'game.yaml avs[0].tracker', **GIVEN)
    assert str(caught.value).startswith('game.yaml avs[0].tracker: options of tracker lqr: ')
    with pytest.raises(InputError) as without:
        registry.create('lqr', options, **GIVEN)
    assert str(without.value).startswith('options of tracker lqr: ')


@pytest.mark.parametrize(('name', 'message'), [
    ('lqx', 'there is no tracker "lqx"; known are lqr, or give module:Class or file.py:Class'),
    ('crgame_ros.control.tracker:Control',
     'is no tracker; derive the class from crgame_ros.control.tracker.Tracker'),
    ('no_such_module:Lqr', 'cannot import no_such_module'),
    ('missing.py:Lqr', 'there is no file missing.py'),
    ('{file}:Half', 'does not define control; see docs/control.md'),
    ('{file}:Narrow', 'its constructor does not take "dt_s"'),
    ('{file}:Hinted', "its hints cannot be read (NameError: name 'Car' is not defined)"),
    ('{file}:Straight', '"push" is missing; allowed are: push, mode')],
    ids=['name', 'other class', 'module', 'file', 'abstract', 'constructor', 'hints',
         'missing option'])
def test_unusable_classes_are_refused(registry: ModelRegistry, file: str, name: str,
                                      message: str) -> None:
    with pytest.raises(InputError, match=re.escape(message)) as caught:
        registry.create(name.format(file=file), {}, 'avs[0].tracker', **GIVEN)
    assert str(caught.value).startswith('avs[0].tracker: ')


def test_errors_of_a_constructor_name_the_place(registry: ModelRegistry, file: str) -> None:
    with pytest.raises(InputError) as caught:
        registry.create(f'{file}:Straight', {'push': 9.0}, 'avs[0].tracker', **GIVEN)
    assert str(caught.value) == 'avs[0].tracker: options of straight: "push" is 9.0; give less'


@pytest.mark.slow
@pytest.mark.matrix
@pytest.mark.parametrize(('planner', 'module', 'package'), [
    ('reactive', 'commonroad_rp', 'commonroad-reactive-planner'),
    ('reactive-package', 'commonroad_rp', 'commonroad-reactive-planner'),
    ('idm-package', 'commonroad_idm_planner', 'commonroad-idm-planner')])
def test_planners_without_their_package_say_how_to_get_it(
        planner: str, module: str, package: str) -> None:
    """One line, with the command that installs them."""
    done = subprocess.run(
        [sys.executable, '-c', f'import sys; sys.modules["{module}"] = None\n'
         'from crgame_ros.cli import main\n'
         f'sys.exit(main(["offline", "--planner", "{planner}"]))'],
        capture_output=True, text=True, cwd=ROOT, timeout=120)
    assert done.returncode == 2
    assert done.stderr.count('\n') == 1 and package in done.stderr
    assert f'--ignore-requires-python -r {ROOT / "requirements-planners.txt"}' in done.stderr


def test_files_with_modules_of_one_name_have_their_own(registry: ModelRegistry,
                                                       tmp_path: Path) -> None:
    """Each finds the one beside itself, and none is left for others to find."""
    found = []
    for number in (1, 2):
        folder = tmp_path / str(number)
        (folder / 'settings_of_it').mkdir(parents=True)
        (folder / 'straight.py').write_text(
            f'{CODE}\n\nimport settings_of_it.deep\nfrom pushes_of_it import PUSH\n'
            'Straight.PUSHES = PUSH, settings_of_it.deep.PUSH\n')
        (folder / 'pushes_of_it.py').write_text(f'PUSH = {number}\n')
        (folder / 'settings_of_it' / '__init__.py').touch()
        (folder / 'settings_of_it' / 'deep.py').write_text(f'PUSH = {10 * number}\n')
        found.append(registry.find(f'{folder}/straight.py:Straight', 'here'))
    assert [each.PUSHES for each in found] == [(1, 10), (2, 20)]
    assert not {'pushes_of_it', 'settings_of_it', 'settings_of_it.deep'} & sys.modules.keys()
    assert not any(str(tmp_path) in entry for entry in sys.path)
