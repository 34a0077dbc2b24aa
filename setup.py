# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0

from glob import glob

from setuptools import find_packages, setup

package_name = 'rrth_planner'
share = f'share/{package_name}'

setup(
    name=package_name,
    version='0.1.0',
    packages=find_packages(include=['rrth_planner', 'rrth_planner.*']),
    data_files=[
        ('share/ament_index/resource_index/packages', [f'resource/{package_name}']),
        (share, ['package.xml']),
        (f'{share}/launch', sorted(glob('launch/*.py'))),
        (f'{share}/config', sorted(glob('config/*.yaml') + glob('config/*.xml'))),
        (f'{share}/config/examples', sorted(glob('config/examples/*'))),
        (f'{share}/config/maps', sorted(glob('config/maps/*.yaml'))),
        (f'{share}/urdf', sorted(glob('urdf/*.urdf'))),
        (f'{share}/rviz', sorted(glob('rviz/*.rviz'))),
        (f'{share}/msg_examples', sorted(glob('msg_examples/*.yaml'))),
    ],
    python_requires='>=3.10',
    # Names only: the versions come from rosdep or from requirements/.
    install_requires=['setuptools', 'numpy', 'numba', 'PyYAML'],
    extras_require={
        'node': ['python-fcl', 'rosbags', 'matplotlib'],
        'campaign': ['dask[distributed]', 'pyarrow', 'tqdm', 'matplotlib'],
        'tools': ['viser', 'mcap-ros2-support', 'yourdfpy', 'trimesh', 'tqdm', 'matplotlib'],
        'test': ['pytest', 'hypothesis'],
    },
    # The sources of the kernels name the folder of their code, so these must be real files.
    zip_safe=False,
    maintainer='The rrth_planner authors',
    maintainer_email='rrth_planner@example.org',
    description='Motion planner for a body-worn pointing arm.',
    license='Apache-2.0',
    entry_points={
        'console_scripts': [
            'planner_node = rrth_planner.ros.planner_node:main',
            'playback_node = rrth_planner.ros.playback_node:main',
            'demo = rrth_planner.cli.demo:main',
            'plan = rrth_planner.cli.plan:main',
            'plot = rrth_planner.cli.plot:main',
            'point_at = rrth_planner.cli.point_at:main',
            'read_urdf = rrth_planner.cli.read_urdf:main',
            'record = rrth_planner.cli.record:main',
            'replay = rrth_planner.cli.replay:main',
            'reproduce = rrth_planner.cli.reproduce:main',
            'viewer = rrth_planner.cli.viewer:main',
            'write_urdf = rrth_planner.cli.write_urdf:main',
        ],
    },
)
