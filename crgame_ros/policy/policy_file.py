# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A trained policy in a file of the user's own: `policy:FILE.py:load`."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from crgame_ros.errors import InputError
from crgame_ros.paths import expanded
from crgame_ros.policy.actions import ACTION_KINDS, ActionKind, PLANNED_KINDS
from crgame_ros.policy.observation import Observed
from crgame_ros.policy.observation_spec import ObservationSpec
from crgame_ros.registry import module_of_file, POLICY
from crgame_ros.schema.reading import read

_SEE = 'see docs/gym.md'


@dataclass(frozen=True)
class Policy:
    """
    A policy, as `load` in its file returns it.

    :param act: returns the action for an observation: arrays by part, as from the environment.
        The action must depend only on the observations since `begin`. With manoeuvres, the part
        `mask` tells which there are.
    :param action: kind of its actions, as in the environment it was trained in.
    :param observation: parts of its observation, as there: keys of `ObservationSpec`.
    :param ticks: scenario steps for which an action holds, as there.
    :param begin: is called before each run, for policies with internal state.
    """

    act: Callable[[Observed], object]
    action: ActionKind = 'acceleration'
    observation: Mapping[str, object] = field(default_factory=dict)
    ticks: int = 1
    begin: Callable[[], object] = lambda: None

    def check_pedals(self, seat: str) -> None:
        """
        Check that the policy can drive a human's seat: plans and manoeuvres cannot.

        :raises InputError: naming the seat, if its actions become plans.
        """
        if self.action in PLANNED_KINDS:
            raise InputError("its actions become plans, but a human's seat needs pedals",
                             f'{seat}: driver {POLICY}…',
                             "name it as an AV's planner, or train it with other actions")

    @property
    def spec(self) -> ObservationSpec:
        """Return the specification of its observation."""
        return read(ObservationSpec, self.observation, 'observation of the policy')


def load_policy(name: str, where: str = '') -> Policy:
    """
    Load a policy.

    :param name: `FILE.py:load`: a file, and a function in it without arguments that returns a
        `Policy`.
    :param where: the file and key that named it, for messages.
    :raises InputError: if there is no such file or function, it fails, or it returns no policy.
    """
    label = f'{where}: {POLICY}{name}' if where else f'{POLICY}{name}'
    file, _, function = name.rpartition(':')
    path = expanded(file)
    if not file.endswith('.py'):
        raise InputError('does not name a policy', label, f'write {POLICY}FILE.py:load')
    if not path.is_file():
        raise InputError(f'there is no file {path}', label, 'check the path')
    policy = _called(path.resolve(), function, label)
    if not isinstance(policy, Policy):
        raise InputError(f'returns a {type(policy).__name__}', label,
                         f'return a crgame_ros.policy.policy_file.Policy; {_SEE}')
    if policy.action not in ACTION_KINDS:
        raise InputError(f'"action" is {policy.action!r}', label,
                         'use one of ' + ', '.join(ACTION_KINDS))
    if not (isinstance(policy.ticks, int) and policy.ticks >= 1):
        raise InputError(f'"ticks" is {policy.ticks!r}', label, 'give a whole number from 1')
    try:
        assert policy.spec
    except InputError as error:
        raise InputError(error.what, f'{label}: {error.where}', error.remedy) from error
    return policy


def _called(path: Path, function: str, label: str) -> object:
    """Run a file as a module of its own, and return the result of its function."""
    try:
        module = module_of_file(path, f'crgame_ros_policy_{path.stem}')
        load = getattr(module, function, None)
        if not callable(load):
            raise InputError(f'{path.name} has no function "{function}"', label,
                             'name the function behind the colon')
        return load()
    except InputError:
        raise
    except Exception as error:
        raise InputError(f'cannot be loaded ({type(error).__name__}: {error})', label,
                         'correct the file') from error
