# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The planners that a game may name."""

from collections.abc import Iterator, Mapping
import contextlib
import inspect

from crgame_ros.errors import InputError
from crgame_ros.planner.interface import Planner
from crgame_ros.registry import ModelRegistry, POLICY

# This planner name means that a process of the user answers (docs/external_planners.md).
EXTERNAL = 'external'
BUILT_IN = {
    'idm': 'crgame_ros.planner.idm:IdmPlanner',
    'idm-package': 'crgame_ros.planner.idm_package:IdmPackagePlanner',
    'reactive': 'crgame_ros.planner.reactive:ReactivePlanner',
    'reactive-package': 'crgame_ros.planner.reactive_package:ReactivePackagePlanner',
    'constant-velocity': 'crgame_ros.planner.constant_velocity:ConstantVelocityPlanner',
}


class PlannerRegistry(ModelRegistry[Planner]):
    """The planners of the package, of entry points, and of users."""

    def __init__(self) -> None:
        super().__init__('planners', 'planner', {
            **BUILT_IN, POLICY: 'crgame_ros.policy.planner:PolicyPlanner'},
            Planner, 'docs/planners.md')
        self._given: dict[str, type[Planner] | Planner] = {}

    def names(self) -> tuple[str, ...]:
        """Return the registered names, without `policy`, which needs a file."""
        return tuple(name for name in super().names() if name != POLICY)

    @contextlib.contextmanager
    def giving(self, planners: Mapping[str, type[Planner] | Planner]) -> Iterator[None]:
        """
        Add the caller's own classes and objects for the duration of the context.

        :param planners: by the name that a game uses.
        """
        earlier = self._given
        self._given = {**earlier, **planners}
        try:
            yield
        finally:
            self._given = earlier

    def resolve(self, name: str, where: str) -> object:
        """Find the class for a name; for an object that the caller has given, its class."""
        if name not in self._given:
            return super().resolve(name, where)
        given = self._given[name]
        return given if inspect.isclass(given) else type(given)

    def create(self, name: str, options: Mapping[str, object] | None = None, where: str = '',
               **given: object) -> Planner:
        """
        Create a planner, also of `policy:FILE.py:load`, or return the caller's own object.

        :raises InputError: as for any model, and if there are options for an object.
        """
        if name.startswith(POLICY):
            options = {**(options or {}), 'policy': name.removeprefix(POLICY)}
        own = self._given.get(name)
        if own is None or inspect.isclass(own):
            return super().create(name, options, where, **given)
        self.find(name, where)
        if options:
            raise InputError('is an object, which cannot have options', self.label(name, where),
                             'pass its class instead, or remove the options')
        return own

    def find(self, name: str, where: str = '') -> type[Planner]:
        """
        Find the class of a planner.

        :param where: the file and key that named it, for messages
        :raises InputError: if there is none of that name, or it is no `Planner`.
        """
        if name == EXTERNAL and name not in self.names():
            raise InputError('an external planner works in live runs only', where or 'planner',
                             'start the run with ./run.sh, or name a planner')
        found = super().find(POLICY if name.startswith(POLICY) else name, where)
        if not isinstance(getattr(found, 'name', None), str):
            raise InputError('has no name', self.label(name, where),
                             'give the class an attribute `name`')
        return found

    def wants_lights(self, name: str) -> bool:
        """
        Return whether a planner wants others' lights.

        The answer for an unknown planner is False: its creation raises the error later.
        """
        if name not in self._given and (
                name in BUILT_IN or name == EXTERNAL or name.startswith(POLICY)):
            # None of these does, and the packages of some take seconds to import.
            return False
        try:
            return self.find(name).wants_lights
        except InputError:
            return False


PLANNERS = PlannerRegistry()
planner_names = PLANNERS.names
create_planner = PLANNERS.create
planner_class = PLANNERS.find
