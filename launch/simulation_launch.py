# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue
from launch_ros.substitutions import FindPackageShare


def generate_launch_description():
    """Start the simulation of the arm, which stands in for it."""
    params_file = PathJoinSubstitution(
        [FindPackageShare('rrth_planner'), 'config', 'simulation.yaml']
    )
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
                default_value=params_file,
                description='Full path of the YAML file with the parameters of the node.',
            ),
            DeclareLaunchArgument(
                'use_sim_time',
                default_value='false',
                description='Take the time from /clock instead of from the system.',
            ),
            Node(
                package='rrth_planner',
                executable='simulation_node',
                name='arm_simulation',
                namespace=LaunchConfiguration('namespace'),
                parameters=[LaunchConfiguration('params_file'), {'use_sim_time': use_sim_time}],
                output='screen',
            ),
        ]
    )
