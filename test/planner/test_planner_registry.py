# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Planners are found and their options checked; the example of the documentation runs."""

from importlib.metadata import EntryPoint
from pathlib import Path
import re

from crgame_ros.errors import InputError
from crgame_ros.planner import registry as planner_registry
from crgame_ros.planner.adapter import PlannerAdapter
from crgame_ros.planner.constant_velocity import ConstantVelocityPlanner
from crgame_ros.planner.idm import IdmPlanner
from crgame_ros.planner.plan_check import check_plan
from crgame_ros.vehicle.parameters import VehicleParameters
from crgame_ros.vehicle.state import VehicleState
import planner_support as support
import pytest

DOCUMENT = Path(__file__).resolve().parents[2] / 'docs' / 'planners.md'


def test_names_begin_with_the_built_in_ones() -> None:
    assert planner_registry.planner_names()[:5] == (
        'idm', 'idm-package', 'reactive', 'reactive-package', 'constant-velocity')


@pytest.mark.parametrize('name', ['idm', 'crgame_ros.planner.idm:IdmPlanner'])
def test_planners_by_name_and_by_module(name: str) -> None:
    made = planner_registry.create_planner(name, {'time_headway': 2})
    assert isinstance(made, IdmPlanner)
    assert made._model.time_headway == 2.0


@pytest.mark.parametrize('name', planner_registry.BUILT_IN)
def test_every_built_in_planner_can_be_made(name: str) -> None:
    assert planner_registry.create_planner(name).name == name


def test_entry_points_are_found(monkeypatch: pytest.MonkeyPatch) -> None:
    point = EntryPoint('steady', 'crgame_ros.planner.constant_velocity:ConstantVelocityPlanner',
                       planner_registry.PLANNERS.entry_point_group)
    monkeypatch.setattr('crgame_ros.registry.entry_points', lambda group: [point])
    assert 'steady' in planner_registry.planner_names()
    assert isinstance(planner_registry.create_planner('steady'), ConstantVelocityPlanner)


@pytest.mark.parametrize(('name', 'message'), [
    ('idem', 'there is no planner "idem".*idm, idm-package, reactive, reactive-package, '
     'constant-velocity'),
    ('no_such_module:Planner', 'cannot import no_such_module'),
    ('crgame_ros.planner.idm:Nothing', 'has no class "Nothing"'),
    ('crgame_ros.planner.idm:Leader', 'is no planner'),
    ('crgame_ros.planner.path_planner:PathPlanner', 'does not define plan, prepare'),
    ('missing.py:Planner', 'there is no file missing.py'),
])
def test_unusable_names_are_refused(name: str, message: str) -> None:
    with pytest.raises(InputError, match=message):
        planner_registry.create_planner(name)


@pytest.mark.parametrize(('options', 'message'), [
    ({'speed': 3.0}, '"speed" is unknown; allowed are: v0, time_headway'),
    ({'v0': 'fast'}, "\"v0\" is 'fast'; give a number or null"),
    ({'s0': True}, '"s0" is True; give a number'),
    ({'a': float('nan')}, '"a" is nan'),
    ({'a': -1.0}, '"a" is -1.0; give a positive number'),
])
def test_wrong_options_are_refused(options: dict[str, object], message: str) -> None:
    with pytest.raises(InputError, match=re.escape(message)) as caught:
        planner_registry.create_planner('idm', options)
    assert 'planner idm' in str(caught.value)


def test_a_choice_is_checked() -> None:
    with pytest.raises(InputError, match="give 'lane' or 'straight'"):
        planner_registry.create_planner('constant-velocity', {'path': 'left'})


def test_a_broken_file_is_one_line(tmp_path: Path) -> None:
    file = tmp_path / 'broken.py'
    file.write_text('import nothing_of_that_name\n', encoding='utf-8')
    with pytest.raises(InputError, match='ModuleNotFoundError') as caught:
        planner_registry.create_planner(f'{file}:Broken')
    assert '\n' not in str(caught.value)


def test_the_documented_example_plans(tmp_path: Path, vehicle: VehicleParameters) -> None:
    code = re.search(r'```python\n(.*?)```', DOCUMENT.read_text(encoding='utf-8'), re.DOTALL)
    assert code is not None
    file = tmp_path / 'stop_and_go.py'
    file.write_text(code[1], encoding='utf-8')
    adapter = PlannerAdapter(planner_registry.create_planner(f'{file}:StopAndGo', {'speed': 6.0}))
    adapter.setup(support.context(support.plain(), support.problem(5.0)))
    ego = VehicleState(0.0, 0.0, 0.3, 5.0, 0.05)
    for obstacles, expected in (((), 6.0), (((15.0, 4.6, 0.0, 0.0),), 0.0)):
        asked = support.request(ego, 0, obstacles)
        plan = adapter.plan(asked)
        assert adapter.last_reason is None
        assert check_plan(plan, ego, asked.stamp_ns, vehicle, support.DT) is None
        assert plan.states[-1, 3] == pytest.approx(expected)


def test_the_document_lists_every_planner() -> None:
    """Their options are in a table that is made of them (`test_key_tables`)."""
    text = DOCUMENT.read_text(encoding='utf-8')
    for name in planner_registry.BUILT_IN:
        assert any(line.startswith(f'| `{name}`') for line in text.splitlines())
