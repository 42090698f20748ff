# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The services of the standard simulation_interfaces that tell what is present in a run."""

import math
from typing import TYPE_CHECKING

from crgame_ros.errors import InputError
from crgame_ros.messages.joints import MAP
from crgame_ros.nodes.sim.entities import bounds, category, Entities, Region, tags
from crgame_ros.nodes.sim.name_pattern import NamePattern
from crgame_ros.ros.messages import set_time
from crgame_ros.simulation.engine import Simulation
from geometry_msgs.msg import Vector3

if TYPE_CHECKING:
    from simulation_interfaces import srv
    from simulation_interfaces.msg import Bounds, EntityFilters


class EntityServices:
    """
    Answers about the entities of the present run, within microseconds for each.

    Without a run, before the first and while another game is loaded, no service is served.
    """

    def __init__(self) -> None:
        from simulation_interfaces.msg import (
            Bounds,
            EntityCategory,
            EntityInfo,
            EntityState,
            Result,
            TagsFilter,
        )
        self._bounds, self._category, self._info = Bounds, EntityCategory, EntityInfo
        self._state, self._result, self._tags = EntityState, Result, TagsFilter
        self._ok = Result(result=Result.RESULT_OK)
        self._entities: Entities
        # One message for each entity: to refill it takes a tenth of the time of a new one.
        self._states: dict[int, EntityState] = {}

    def show(self, simulation: Simulation) -> None:
        """Answer about another run from now on."""
        self._entities = Entities(simulation)
        self._states.clear()

    def on_list(self, request: 'srv.GetEntities.Request',
                response: 'srv.GetEntities.Response') -> object:
        """Answer GetEntities."""
        places, response.result = self._select(request.filters)
        response.entities = self._names(places)
        return response

    def on_states(self, request: 'srv.GetEntitiesStates.Request',
                  response: 'srv.GetEntitiesStates.Response') -> object:
        """Answer GetEntitiesStates."""
        places, response.result = self._select(request.filters)
        response.entities = self._names(places)
        response.states = [self._state_of(place) for place in places]
        return response

    def on_state(self, request: 'srv.GetEntityState.Request',
                 response: 'srv.GetEntityState.Response') -> object:
        """Answer GetEntityState."""
        place, response.result = self._find(request.entity)
        if place is not None:
            response.state = self._state_of(place)
        return response

    def on_info(self, request: 'srv.GetEntityInfo.Request',
                response: 'srv.GetEntityInfo.Response') -> object:
        """Answer GetEntityInfo."""
        place, response.result = self._find(request.entity)
        if place is not None:
            item = self._entities.descriptions[place]
            kind = getattr(self._category, f'CATEGORY_{category(item)}')
            response.info = self._info(
                category=self._category(category=kind), tags=list(tags(item)),
                description=f'{item.type} ({item.role.value}), reference point: '
                f'{item.reference_point}')
        return response

    def on_bounds(self, request: 'srv.GetEntityBounds.Request',
                  response: 'srv.GetEntityBounds.Response') -> object:
        """Answer GetEntityBounds."""
        place, response.result = self._find(request.entity)
        if place is not None:
            response.bounds = self._bounds(type=self._bounds.TYPE_BOX, points=[
                Vector3(x=x, y=y, z=z)
                for x, y, z in bounds(self._entities.descriptions[place])])
        return response

    def _find(self, name: str) -> tuple[int | None, object]:
        """Return the place of an entity and the result to tell."""
        place = self._entities.find(name)
        if place is not None:
            return place, self._ok
        return None, self._result(result=self._result.RESULT_NOT_FOUND,
                                  error_message=f'"{name[:40]}" is not present')

    def _names(self, places: list[int]) -> list[str]:
        return [self._entities.descriptions[place].id for place in places]

    def _state_of(self, place: int) -> object:
        """Return the state of an entity, in a message that the next call may refill."""
        message = self._states.get(place)
        if message is None:
            message = self._states[place] = self._state()
            message.header.frame_id = MAP
        motion = self._entities.motion(place)
        set_time(message.header.stamp, motion.stamp_ns)
        position, turn = message.pose.position, message.pose.orientation
        position.x, position.y, yaw = motion.pose
        turn.z, turn.w = math.sin(0.5 * yaw), math.cos(0.5 * yaw)
        for part, (x, y, rate) in ((message.twist, motion.velocity),
                                   (message.acceleration, motion.acceleration)):
            part.linear.x, part.linear.y, part.angular.z = x, y, rate
        return message

    def _select(self, filters: 'EntityFilters') -> tuple[list[int], object]:
        """Return the places of the entities that pass the filters, and the result to tell."""
        result = self._result
        if filters.bounds.type == self._bounds.TYPE_CONVEX_HULL:
            return [], result(result=result.RESULT_FEATURE_UNSUPPORTED,
                              error_message='bounds: only boxes and spheres can be filters')
        try:
            return self._filtered(filters), self._ok
        except InputError as error:
            return [], result(result=result.RESULT_OPERATION_FAILED, error_message=str(error))

    def _filtered(self, filters: 'EntityFilters') -> list[int]:
        """
        Return the places of the entities that pass the filters.

        :raises InputError: if these cannot be used.
        """
        names = {getattr(self._category, f'CATEGORY_{name}'): name
                 for name in ('ROBOT', 'HUMAN', 'STATIC_OBJECT', 'DYNAMIC_OBJECT')}
        modes = {self._tags.FILTER_MODE_ANY: False, self._tags.FILTER_MODE_ALL: True}
        if filters.tags.filter_mode not in modes:
            raise InputError(f'there is no mode {filters.tags.filter_mode}', 'tags')
        return self._entities.select(
            NamePattern(filters.filter) if filters.filter else None,
            # An empty name stands for a category of which there is nothing.
            {names.get(item.category, '') for item in filters.categories},
            filters.tags.tags, modes[filters.tags.filter_mode], self._region(filters.bounds))

    def _region(self, volume: 'Bounds') -> Region | None:
        """
        Return the region that entities shall overlap; None for any.

        :raises InputError: if it is none.
        """
        kind, points = volume.type, [(point.x, point.y, point.z) for point in volume.points]
        if kind == self._bounds.TYPE_EMPTY:
            return None
        if kind not in (self._bounds.TYPE_BOX, self._bounds.TYPE_SPHERE) or len(points) != 2:
            raise InputError(f'type {kind} with {len(points)} points', 'bounds',
                             'give a box or a sphere, of two points')
        if kind == self._bounds.TYPE_BOX:
            return Region.box(*points)
        return Region.sphere(points[0], points[1][0])
