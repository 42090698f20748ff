# Copyright 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The graph for `ros2 launch crgame_ros crgame.launch.py`.

`game:=FILE` names a game file; `humans:=hv0` and `avs:=av0,av1` say which drivers and planners to
start (those of the game), `perceiving:=av0` which AVs have perception, `traffic:=true` and
`map:=true` whether the game has reactive traffic and a map of permanent obstacles, `bag:=FOLDER`
where to record.
"""

from launch.actions import DeclareLaunchArgument, EmitEvent, OpaqueFunction, RegisterEventHandler
from launch.event_handlers import OnProcessExit
from launch.events import Shutdown
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

from launch import LaunchContext, LaunchDescription


def nodes(context: LaunchContext) -> list:
    """Make the nodes, once the arguments are known."""
    def value(name: str) -> str:
        return LaunchConfiguration(name).perform(context)

    humans = [item for item in value('humans').split(',') if item]
    avs = [item for item in value('avs').split(',') if item]
    perceiving = [item for item in value('perceiving').split(',') if item]
    companions = [
        *(Node(package='crgame_ros', executable='driver_node', name=f'driver_node_{human}',
               parameters=[{'vehicle': human}]) for human in humans),
        *(Node(package='crgame_ros', executable='planner_node', name=f'planner_node_{av}',
               parameters=[{'vehicle': av}], respawn=True) for av in avs),
        *(Node(package='crgame_ros', executable='perception_node', name=f'perception_node_{av}',
               parameters=[{'vehicle': av}], respawn=True) for av in perceiving),
        *(Node(package='crgame_ros', executable=f'{name}_node', respawn=True)
          for name in ('traffic', 'map') if value(name) == 'true'),
        Node(package='crgame_ros', executable='drivability_node', respawn=True),
        Node(package='crgame_ros', executable='timesync_node', respawn=True),
        Node(package='crgame_ros', executable='recorder_node',
             parameters=[{'directory': value('bag')}])]
    waiting = ['recorder_node', 'drivability_node', 'timesync_node']
    waiting += ['driver_node'] if humans else []
    waiting += ['planner_node'] if avs else []
    waiting += ['perception_node'] if perceiving else []
    waiting += [f'{name}_node' for name in ('traffic', 'map') if value(name) == 'true']
    simulation = Node(
        package='crgame_ros', executable='sim_node', output='screen',
        parameters=[{'game': value('game'), 'wait_for': waiting}])
    end = RegisterEventHandler(OnProcessExit(
        target_action=simulation, on_exit=[EmitEvent(event=Shutdown(reason='the game ended'))]))
    # Nobody waits for these: they draw for people.
    markers = Node(package='crgame_ros', executable='marker_node', respawn=True,
                   prefix='nice -n 10')
    cockpit = Node(package='crgame_ros', executable='cockpit_node', output='screen', respawn=True,
                   prefix='nice -n 5', parameters=[{'port': int(value('port'))}])
    return [*companions, simulation, markers, cockpit, end]


def generate_launch_description() -> LaunchDescription:
    """Describe the graph."""
    return LaunchDescription([
        DeclareLaunchArgument('game', default_value='', description='game file'),
        DeclareLaunchArgument('humans', default_value='hv0', description='humans of the game'),
        DeclareLaunchArgument('avs', default_value='av0', description='AVs of the game'),
        DeclareLaunchArgument('perceiving', default_value='', description='AVs with perception'),
        DeclareLaunchArgument('traffic', default_value='false', description='reactive traffic'),
        DeclareLaunchArgument('map', default_value='false', description='permanent obstacles'),
        DeclareLaunchArgument('port', default_value='8080', description="of the cockpit's page"),
        DeclareLaunchArgument('bag', default_value='bag', description='folder of the recording'),
        OpaqueFunction(function=nodes)])
