# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""What a launch file returns that starts one node of the package."""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue
from launch_ros.substitutions import FindPackageShare

PACKAGE = 'rrth_planner'


def node_launch(executable: str, name: str, params_file: str) -> LaunchDescription:
    """
    Return a launch description with one node, and with arguments for what a user may change.

    Parameters
    ----------
    executable, name : str
        Of the node.
    params_file : str
        File of `config/` with the parameters that it has by default.

    """
    default = PathJoinSubstitution([FindPackageShare(PACKAGE), 'config', params_file])
    use_sim_time = ParameterValue(LaunchConfiguration('use_sim_time'), value_type=bool)
    return LaunchDescription(
        [
            DeclareLaunchArgument(
                'namespace',
                default_value='',
                description='Namespace of the node and of its topics and services.',
            ),
            DeclareLaunchArgument(
                'params_file',
                default_value=default,
                description='Full path of the YAML file with the parameters of the node.',
            ),
            DeclareLaunchArgument(
                'use_sim_time',
                default_value='false',
                description='Take the time from /clock instead of from the system.',
            ),
            Node(
                package=PACKAGE,
                executable=executable,
                name=name,
                namespace=LaunchConfiguration('namespace'),
                parameters=[LaunchConfiguration('params_file'), {'use_sim_time': use_sim_time}],
                output='screen',
            ),
        ]
    )
