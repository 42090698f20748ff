# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Stand-ins for the messages of simulation_interfaces, made of their fields and constants.

The definitions are those of version 1.5.1, https://github.com/ros-simulation/simulation_interfaces
(Apache-2.0), without comments; only what crgame_ros uses. A test compares them with the package
where it is installed.
"""

from collections.abc import Iterator
from importlib.machinery import ModuleSpec
import re
import sys
from types import ModuleType

from geometry_msgs.msg import Accel, Pose, Twist, Vector3
import pytest
from std_msgs.msg import Header

MESSAGES = """
Result: uint8 RESULT_FEATURE_UNSUPPORTED=0, uint8 RESULT_OK=1, uint8 RESULT_NOT_FOUND=2,
    uint8 RESULT_INCORRECT_STATE=3, uint8 RESULT_OPERATION_FAILED=4, uint8 result,
    string error_message
SimulationState: uint8 STATE_STOPPED=0, uint8 STATE_PLAYING=1, uint8 STATE_PAUSED=2,
    uint8 STATE_QUITTING=3, uint8 STATE_NO_WORLD=4, uint8 STATE_LOADING_WORLD=5, uint8 state
SimulatorFeatures: uint8 ENTITY_TAGS=4, uint8 ENTITY_BOUNDS=5, uint8 ENTITY_BOUNDS_BOX=6,
    uint8 ENTITY_BOUNDS_CONVEX=7, uint8 ENTITY_CATEGORIES=8, uint8 ENTITY_STATE_GETTING=10,
    uint8 ENTITY_INFO_GETTING=12, uint8 SIMULATION_RESET=20, uint8 SIMULATION_RESET_TIME=21,
    uint8 SIMULATION_RESET_STATE=22, uint8 SIMULATION_STATE_GETTING=24,
    uint8 SIMULATION_STATE_SETTING=25, uint8 SIMULATION_STATE_PAUSE=26,
    uint8 STEP_SIMULATION_SINGLE=31, uint8 STEP_SIMULATION_MULTIPLE=32,
    uint8 STEP_SIMULATION_ACTION=33, uint8 WORLD_LOADING=40, uint8 WORLD_INFO_GETTING=44,
    uint16[] features, string[] spawn_formats, string custom_info
Bounds: uint8 TYPE_EMPTY=0, uint8 TYPE_BOX=1, uint8 TYPE_CONVEX_HULL=2, uint8 TYPE_SPHERE=3,
    uint8 type, geometry_msgs/Vector3[] points
EntityCategory: uint8 CATEGORY_OBJECT=0, uint8 CATEGORY_ROBOT=1, uint8 CATEGORY_HUMAN=2,
    uint8 CATEGORY_DYNAMIC_OBJECT=4, uint8 CATEGORY_STATIC_OBJECT=5, uint8 category
EntityInfo: EntityCategory category, string description, string[] tags
EntityState: std_msgs/Header header, geometry_msgs/Pose pose, geometry_msgs/Twist twist,
    geometry_msgs/Accel acceleration
TagsFilter: string[] tags, uint8 FILTER_MODE_ANY=0, uint8 FILTER_MODE_ALL=1, uint8 filter_mode
EntityFilters: string filter, EntityCategory[] categories, TagsFilter tags, Bounds bounds
Resource: string uri, string resource_string
WorldResource: string name, Resource world_resource, string description, string[] tags
"""
SERVICES = """
GetSimulatorFeatures: --- SimulatorFeatures features
GetSimulationState: --- SimulationState state, Result result
SetSimulationState: SimulationState state --- uint8 ALREADY_IN_TARGET_STATE=101,
    uint8 STATE_TRANSITION_ERROR=102, uint8 INCORRECT_TRANSITION=103, Result result
StepSimulation: uint64 steps 1 --- Result result
ResetSimulation: uint8 SCOPE_DEFAULT=0, uint8 SCOPE_TIME=1, uint8 SCOPE_STATE=2,
    uint8 SCOPE_SPAWNED=4, uint8 SCOPE_ALL=255, uint8 scope --- Result result
GetEntities: EntityFilters filters --- Result result, string[] entities
GetEntityInfo: string entity --- Result result, EntityInfo info
GetEntityState: string entity --- Result result, EntityState state
GetEntitiesStates: EntityFilters filters --- Result result, string[] entities,
    EntityState[] states
GetEntityBounds: string entity --- Result result, Bounds bounds
GetCurrentWorld: --- uint8 NO_WORLD_LOADED=101, Result result, WorldResource world
LoadWorld: string uri, string resource_string, bool fail_on_unsupported_element,
    bool ignore_missing_or_unsupported_assets --- uint8 UNSUPPORTED_FORMAT=101,
    uint8 NO_RESOURCE=102, uint8 RESOURCE_PARSE_ERROR=103, uint8 MISSING_ASSETS=104,
    uint8 UNSUPPORTED_ASSETS=105, uint8 UNSUPPORTED_ELEMENTS=106, Result result,
    WorldResource world
"""
ACTIONS = """
SimulateSteps: uint64 steps --- Result result --- uint64 completed_steps, uint64 remaining_steps
"""
PARTS = {'msg': ('',), 'srv': ('Request', 'Response'), 'action': ('Goal', 'Result', 'Feedback')}
_DEFAULTS = {'string': str, 'bool': bool, 'std_msgs/Header': Header, 'geometry_msgs/Pose': Pose,
             'geometry_msgs/Twist': Twist, 'geometry_msgs/Accel': Accel,
             'geometry_msgs/Vector3': Vector3}


class StandIn:
    """A message: takes and holds nothing but its fields."""

    FIELDS: dict[str, str]
    FACTORIES: dict[str, object]

    def __init__(self, **values: object) -> None:
        for name, make in self.FACTORIES.items():
            setattr(self, name, values.pop(name) if name in values else make())
        assert not values, f'{type(self).__name__} has no {", ".join(values)}'

    def __setattr__(self, name: str, value: object) -> None:
        assert name in self.FIELDS, f'{type(self).__name__} has no {name}'
        super().__setattr__(name, value)


def _rows(text: str) -> Iterator[tuple[str, list[str]]]:
    for row in re.split(r'\n(?=\w)', text.strip()):
        name, _, parts = ' '.join(row.split()).partition(':')
        yield name, [part.strip() for part in parts.split('---')]


def _message(name: str, text: str, known: dict[str, type]) -> type:
    """Build a class from fields and constants that commas separate."""
    fields, factories, constants = {}, {}, {}
    for item in filter(None, text.split(', ')):
        kind, field = item.split(' ', 1)
        if '=' in field:
            constant, _, number = field.partition('=')
            constants[constant] = int(number)
            continue
        field, _, default = field.partition(' ')
        fields[field] = kind
        factories[field] = list if kind.endswith('[]') else \
            (lambda number=int(default or 0): number) if kind.startswith('uint') else \
            _DEFAULTS.get(kind) or known[kind]
    return type(name, (StandIn,), {'FIELDS': fields, 'FACTORIES': factories, **constants})


def stand_in_modules() -> dict[str, ModuleType]:
    """Return the package and its modules, by name."""
    package = ModuleType('simulation_interfaces')
    package.__spec__, package.__path__ = ModuleSpec(package.__name__, None, is_package=True), []
    modules, known = {package.__name__: package}, {}
    for kind, text in (('msg', MESSAGES), ('srv', SERVICES), ('action', ACTIONS)):
        module = modules[f'simulation_interfaces.{kind}'] = ModuleType(kind)
        setattr(package, kind, module)
        for name, parts in _rows(text):
            made = [_message(f'{name}{suffix}', part, known)
                    for suffix, part in zip(PARTS[kind], parts, strict=True)]
            if kind == 'msg':
                known[name] = made[0]
            setattr(module, name, made[0] if kind == 'msg' else type(
                name, (), dict(zip(PARTS[kind], made, strict=True))))
    return modules


def use_stand_ins(patch: pytest.MonkeyPatch) -> ModuleType:
    """Let the stand-ins be imported as the package, and return it."""
    modules = stand_in_modules()
    for name, module in modules.items():
        patch.setitem(sys.modules, name, module)
    return modules['simulation_interfaces']
