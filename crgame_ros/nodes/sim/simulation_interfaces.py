# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The standard simulation_interfaces: services by which tools control any simulator.

They are offered where the package is installed. What there is not (spawning, moving and deleting
of entities, named poses) is left out: the standard has it told by `GetSimulatorFeatures`.
"""

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING
from urllib.parse import unquote, urlsplit

from crgame_ros.messages.contract import load_contract
from crgame_ros.nodes.sim.control import OVER, SimControl, StepOrder
from crgame_ros.nodes.sim.entity_services import EntityServices
from crgame_ros.ros.endpoints import Endpoints
from crgame_ros.ros.spinning import attempt
from crgame_ros.simulation.engine import Simulation
from crgame_ros.simulation.setup import Setup
from crgame_ros.version import __version__
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.node import Node

if TYPE_CHECKING:
    from rclpy.action.server import ServerGoalHandle
    from simulation_interfaces import srv

FEATURES = (
    'ENTITY_TAGS', 'ENTITY_BOUNDS', 'ENTITY_BOUNDS_BOX', 'ENTITY_CATEGORIES',
    'ENTITY_STATE_GETTING', 'ENTITY_INFO_GETTING', 'SIMULATION_RESET', 'SIMULATION_RESET_STATE',
    'SIMULATION_STATE_GETTING', 'SIMULATION_STATE_SETTING', 'SIMULATION_STATE_PAUSE',
    'STEP_SIMULATION_SINGLE', 'STEP_SIMULATION_MULTIPLE', 'STEP_SIMULATION_ACTION',
    'WORLD_LOADING', 'WORLD_INFO_GETTING')
# The parameter that loads a file, by the ending of its name.
KINDS = {'.xml': 'scenario', '.yaml': 'game', '.yml': 'game'}


def offer_simulation_interfaces(node: Node, control: SimControl) -> 'SimulationInterfaces | None':
    """Offer the standard's services on a node; None where its package is not installed."""
    contract = load_contract()
    if not contract.actions['/simulate_steps'].available:
        return None
    try:
        from simulation_interfaces.msg import WorldResource  # noqa: F401 - the newest of its types
    except ImportError:
        node.get_logger().warning('the package simulation_interfaces is older than 1.2: its '
                                  'services are left out')
        return None
    interfaces = SimulationInterfaces(node, control)
    endpoints, group = Endpoints(node), interfaces.group
    for name, callback in interfaces.callbacks.items():
        endpoints.service(name, callback, group=group)
    interfaces.actions = [endpoints.action('/simulate_steps', interfaces.on_simulate_steps,
                                           interfaces.on_cancel, group)]
    return interfaces


class SimulationInterfaces:
    """
    The callbacks of the standard's services and of its action.

    :param node: whose parameters name the world.
    :ivar callbacks: by the services' names in the contract.
    :ivar actions: kept here, since rclpy does not.
    """

    def __init__(self, node: Node, control: SimControl) -> None:
        from simulation_interfaces import msg
        from simulation_interfaces.action import SimulateSteps
        self._node, self._control = node, control
        self._msg, self._simulate_steps = msg, SimulateSteps
        self._result, self._states = msg.Result, msg.SimulationState
        self._entities = EntityServices()
        self._setup: Setup
        self._goals: dict[bytes, StepOrder] = {}
        # Other orders are served while one waits. rclpy keeps groups by weak reference.
        self.group = ReentrantCallbackGroup()
        self.actions: list[object] = []
        self.callbacks = {
            '/get_simulator_features': self.on_features,
            '/get_simulation_state': self.on_get_state,
            '/set_simulation_state': self.on_set_state,
            '/step_simulation': self.on_step,
            '/reset_simulation': self.on_reset,
            '/get_entities': self._entities.on_list,
            '/get_entity_info': self._entities.on_info,
            '/get_entity_state': self._entities.on_state,
            '/get_entities_states': self._entities.on_states,
            '/get_entity_bounds': self._entities.on_bounds,
            '/get_current_world': self.on_get_world,
            '/load_world': self.on_load_world}

    def show(self, simulation: Simulation) -> None:
        """Answer about another run from now on."""
        self._setup = simulation.setup
        self._entities.show(simulation)

    def on_features(self, _: object, response: 'srv.GetSimulatorFeatures.Response') -> object:
        """Answer GetSimulatorFeatures."""
        features = self._msg.SimulatorFeatures
        response.features = features(
            features=[getattr(features, name) for name in FEATURES],
            custom_info=f'crgame_ros {__version__}. A step is one of the simulation, 10 ms as a '
            'rule. Frame map; driven vehicles are given by their rear axle, all else by its '
            'centre. See docs/nodes.md.')
        return response

    def on_get_state(self, _: object, response: 'srv.GetSimulationState.Response') -> object:
        """Answer GetSimulationState."""
        response.state = self._states(state=self._present())
        response.result = self._told('RESULT_OK')
        return response

    async def on_set_state(self, request: 'srv.SetSimulationState.Request',
                           response: 'srv.SetSimulationState.Response') -> object:
        """Answer SetSimulationState, as soon as it is there."""
        states, control = self._states, self._control
        target, present = request.state.state, self._present()
        done = None
        if target == present:
            response.result = self._result(result=response.ALREADY_IN_TARGET_STATE)
            return response
        if present == states.STATE_QUITTING or target not in (
                states.STATE_STOPPED, states.STATE_PLAYING, states.STATE_PAUSED,
                states.STATE_QUITTING):
            response.result = self._result(
                result=response.INCORRECT_TRANSITION, error_message='the simulator is about to '
                'end' if present == states.STATE_QUITTING else f'{target} cannot be asked for')
            return response
        if target == states.STATE_QUITTING:
            control.shut_down()
        elif control.over or (target == states.STATE_STOPPED and control.begun):
            done = control.reset()
        if target == states.STATE_STOPPED:
            control.hold()
        elif target == states.STATE_PLAYING:
            control.start()
        elif target == states.STATE_PAUSED:
            control.pause()
        problem = None if done is None else await done
        response.result = self._told('RESULT_OK') if problem is None else self._result(
            result=response.STATE_TRANSITION_ERROR, error_message=problem)
        return response

    async def on_step(self, request: 'srv.StepSimulation.Request',
                      response: 'srv.StepSimulation.Response') -> object:
        """Answer StepSimulation, when the steps are done."""
        refusal = self._refused_step()
        if refusal is None and request.steps:
            order = self._control.order_steps(request.steps)
            refusal = self._after_steps(order, await order.done)
        response.result = refusal or self._told('RESULT_OK')
        return response

    async def on_simulate_steps(self, goal: 'ServerGoalHandle') -> object:
        """Return the result of a goal of SimulateSteps, when the steps are done."""
        refusal, steps, n = self._refused_step(), goal.request.steps, None
        if refusal is None and steps:
            order = self._control.order_steps(steps, partial(self._tell, goal))
            key = bytes(goal.goal_id.uuid)
            self._goals[key] = order
            n = await order.done
            del self._goals[key]
            refusal = self._after_steps(order, n)
        if refusal is None:
            goal.succeed()
        elif goal.is_cancel_requested:
            goal.canceled()
        else:
            goal.abort()
        return self._simulate_steps.Result(result=refusal or self._told('RESULT_OK'))

    def on_cancel(self, goal: 'ServerGoalHandle') -> bool:
        """Withdraw the order of a goal; return whether there was one."""
        order = self._goals.get(bytes(goal.goal_id.uuid))
        if order is not None:
            self._control.withdraw(order)
        return order is not None

    async def on_reset(self, request: 'srv.ResetSimulation.Request',
                       response: 'srv.ResetSimulation.Response') -> object:
        """Answer ResetSimulation, when it is done."""
        if request.scope not in (request.SCOPE_DEFAULT, request.SCOPE_STATE, request.SCOPE_ALL):
            response.result = self._told(
                'RESULT_FEATURE_UNSUPPORTED', 'only the scopes default, all and state: time never '
                'goes back, and nothing is spawned')
            return response
        problem = await self._control.reset()
        response.result = self._told('RESULT_OK') if problem is None else self._told(
            'RESULT_OPERATION_FAILED', problem)
        return response

    def on_get_world(self, _: object, response: 'srv.GetCurrentWorld.Response') -> object:
        """Answer GetCurrentWorld."""
        response.result, response.world = self._told('RESULT_OK'), self._world()
        return response

    async def on_load_world(self, request: 'srv.LoadWorld.Request',
                            response: 'srv.LoadWorld.Response') -> object:
        """Answer LoadWorld, when the world is there and stands at its first step."""
        # In version 2 the two are in a message of their own.
        resource = getattr(request, 'world_resource', request)
        kind = KINDS.get(Path(resource.uri).suffix.lower())
        if not resource.uri and not resource.resource_string:
            response.result = self._result(result=response.NO_RESOURCE)
        elif not resource.uri or request.fail_on_unsupported_element:
            response.result = self._told(
                'RESULT_FEATURE_UNSUPPORTED', 'give the uri of a file, without '
                'fail_on_unsupported_element: notices on the terminal name what has no effect')
        elif kind is None:
            response.result = self._result(
                result=response.UNSUPPORTED_FORMAT,
                error_message='give a CommonRoad scenario (.xml) or a game (.yaml)')
        else:
            response.result = await self._load(kind, unquote(urlsplit(resource.uri).path),
                                               response.RESOURCE_PARSE_ERROR)
            response.world = self._world()
        return response

    async def _load(self, kind: str, name: str, unusable: int) -> object:
        """Load a game or scenario, and return the result; unusable: the code for such a file."""
        control, before = self._control, self._control.choice
        refusal = control.choose(kind, name)
        if refusal:
            return self._told('RESULT_NOT_FOUND', refusal)
        done = control.reset()
        control.hold()
        problem = await done
        if problem is None:
            return self._told('RESULT_OK')
        # The next reset shall not fail, too.
        control.choose(*before)
        return self._result(result=unusable, error_message=problem)

    def _told(self, code: str, text: str = '') -> object:
        """Return a result by the name of its general code."""
        return self._result(result=getattr(self._result, code), error_message=text)

    def _present(self) -> int:
        """Return the state of the simulation in the standard's terms."""
        control, states = self._control, self._states
        if control.quit_wanted:
            name = 'QUITTING'
        elif control.over or (control.paused and not (control.begun or control.pause_ordered)):
            name = 'STOPPED'
        else:
            name = 'PAUSED' if control.paused else 'PLAYING'
        return int(getattr(states, f'STATE_{name}'))

    def _refused_step(self) -> object | None:
        """Return why no steps can be ordered now; None if they can."""
        control = self._control
        if control.over:
            return self._told('RESULT_OPERATION_FAILED', OVER)
        if self._present() != self._states.STATE_PAUSED:
            return self._told('RESULT_OPERATION_FAILED', 'not paused: set STATE_PAUSED first')
        if control.awaited:
            return self._told('RESULT_INCORRECT_STATE',
                              f'waiting for the driver of {" and ".join(control.awaited)}')
        return None

    def _after_steps(self, order: StepOrder, n: int | None) -> object | None:
        """Return why steps have not been done; None if they have."""
        return None if n is not None else self._told(
            'RESULT_OPERATION_FAILED', f'{order.count} of {order.steps} steps done: the order was '
            'cancelled, or the run goes on or is over')

    def _tell(self, goal: 'ServerGoalHandle', count: int) -> None:
        """Tell how many steps of a goal are done; a failure costs only this."""
        attempt(self._node, lambda: goal.publish_feedback(self._simulate_steps.Feedback(
            completed_steps=count, remaining_steps=goal.request.steps - count)))

    def _world(self) -> object:
        loaded = self._setup.loaded
        return self._msg.WorldResource(
            name=loaded.benchmark_id,
            world_resource=self._msg.Resource(uri=self._setup.game.scenario.resolve().as_uri()),
            description=self._setup.game.title,
            tags=sorted(tag.value for tag in loaded.scenario.tags or ()))
