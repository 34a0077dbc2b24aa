# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0

from ament_index_python.packages import get_packages_with_prefixes
from launch import LaunchDescription
from launch.actions import (
    DeclareLaunchArgument,
    ExecuteProcess,
    IncludeLaunchDescription,
    LogInfo,
)
from launch.conditions import IfCondition
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import (
    FileContent,
    LaunchConfiguration,
    NotEqualsSubstitution,
    PathJoinSubstitution,
)
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue
from launch_ros.substitutions import FindPackageShare

# What RViz names absolutely in rviz/rrth_planner.rviz, so that a namespace reaches it.
RVIZ_TOPICS = (
    'robot_description',
    'body_boxes',
    'target',
    'rrth_planner/markers',
    'rrth_planner/tool_path',
)


def share(*parts):
    """Return the path of a file of the package."""
    return PathJoinSubstitution([FindPackageShare('rrth_planner'), *parts])


def include(name, params_file):
    """Start another launch file of the package with arguments of this one."""
    return IncludeLaunchDescription(
        PythonLaunchDescriptionSource(share('launch', name)),
        launch_arguments={
            'namespace': LaunchConfiguration('namespace'),
            'params_file': LaunchConfiguration(params_file),
            'use_sim_time': LaunchConfiguration('use_sim_time'),
        }.items(),
    )


def rviz(condition, **arguments):
    """Start RViz where it is installed; else say that it is not."""
    if 'rviz2' in get_packages_with_prefixes():
        return Node(package='rviz2', executable='rviz2', condition=condition, **arguments)
    missing = 'RViz is not installed and not started: apt install ros-jazzy-rviz2, or rviz:=false'
    return LogInfo(msg=missing, condition=condition)


def generate_launch_description():
    """Start planner, playback, a standing wearer, the arm's frames and RViz."""
    namespace = LaunchConfiguration('namespace')
    body_file = LaunchConfiguration('body_file')
    urdf = ParameterValue(FileContent(LaunchConfiguration('urdf_file')), value_type=str)
    use_sim_time = ParameterValue(LaunchConfiguration('use_sim_time'), value_type=bool)
    return LaunchDescription(
        [
            DeclareLaunchArgument(
                'namespace',
                default_value='',
                description='Namespace of all nodes and their topics; frames have none.',
            ),
            DeclareLaunchArgument(
                'planner_params_file',
                default_value=share('config', 'planner.yaml'),
                description='Full path of the YAML file with the parameters of the planner.',
            ),
            DeclareLaunchArgument(
                'playback_params_file',
                default_value=share('config', 'playback.yaml'),
                description='Full path of the YAML file with the parameters of the playback.',
            ),
            DeclareLaunchArgument(
                'use_sim_time',
                default_value='false',
                description='Take the time from /clock instead of from the system.',
            ),
            DeclareLaunchArgument(
                'urdf_file',
                default_value=share('urdf', 'arm.urdf'),
                description='Full path of the URDF of the arm, as write_urdf writes it.',
            ),
            DeclareLaunchArgument(
                'body_file',
                default_value=share('msg_examples', 'body.yaml'),
                description='MarkerArray to send on body_boxes, 50 Hz; empty: send none.',
            ),
            DeclareLaunchArgument(
                'rviz',
                default_value='true',
                description='Start RViz, if installed; its tool Publish Point says the target.',
            ),
            DeclareLaunchArgument(
                'rviz_config',
                default_value=share('rviz', 'rrth_planner.rviz'),
                description='Full path of the configuration of RViz.',
            ),
            include('planner_launch.py', 'planner_params_file'),
            include('playback_launch.py', 'playback_params_file'),
            Node(
                package='robot_state_publisher',
                executable='robot_state_publisher',
                namespace=namespace,
                parameters=[{'robot_description': urdf, 'use_sim_time': use_sim_time}],
                output='screen',
            ),
            ExecuteProcess(
                cmd=[
                    'ros2',
                    'topic',
                    'pub',
                    '--rate',
                    '50',
                    PathJoinSubstitution(['/', namespace, 'body_boxes']),
                    'visualization_msgs/msg/MarkerArray',
                    FileContent(body_file),
                ],
                condition=IfCondition(NotEqualsSubstitution(body_file, '')),
                output='log',
            ),
            rviz(
                IfCondition(LaunchConfiguration('rviz')),
                namespace=namespace,
                arguments=['-d', LaunchConfiguration('rviz_config')],
                remappings=[(f'/{topic}', topic) for topic in RVIZ_TOPICS],
                parameters=[{'use_sim_time': use_sim_time}],
                output='log',
            ),
        ]
    )
