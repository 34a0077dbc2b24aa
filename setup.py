# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""
The package for colcon and for pip.

colcon installs as ROS does: each executable in `lib/rrth_planner`, found by `ros2 run`, and the
files beside the code in `share`. A wheel, which pip builds, holds one package with these files in
it and one command, `rrth`.
"""

from glob import glob
import os
import sys
from xml.etree import ElementTree

from setuptools import find_packages, setup

# colcon --symlink-install starts this file by a link elsewhere.
ROOT = os.path.dirname(os.path.realpath(__file__))
# What is beside the code, by folder.
FILES = {
    'config': [
        *('*.yaml', '*.xml', 'examples/*', 'maps/*.yaml', 'people/*', 'scenarios/*.yaml'),
        'skeletons/*.yaml',
    ],
    'msg_examples': ['*.yaml'],
    'rviz': ['*.rviz'],
    'urdf': ['*.urdf'],
}
# What only nodes and figures import of what requirements/run.txt lists.
NODE = ('matplotlib', 'rosbags')
IS_WHEEL = not {'bdist_wheel', 'dist_info', 'editable_wheel'}.isdisjoint(sys.argv)


def text_of(name):
    """Return the text of a file of the project."""
    with open(os.path.join(ROOT, name), encoding='utf-8') as file:
        return file.read()


def requirements(name):
    """Return what a file of requirements/ lists."""
    lines = text_of(f'requirements/{name}.txt').splitlines()
    return [line for line in lines if line and not line.startswith('#')]


def shared_files():
    """Return what ROS expects in `share`: (folder, files) of each."""
    share, by_folder = f'share/{NAME}', {}
    patterns = {**FILES, 'launch': ['*.py']}
    for folder in patterns:
        for pattern in patterns[folder]:
            for file in sorted(glob(f'{folder}/{pattern}')):
                by_folder.setdefault(f'{share}/{os.path.dirname(file)}', []).append(file)
    return [
        ('share/ament_index/resource_index/packages', [f'resource/{NAME}']),
        (share, ['package.xml']),
        *by_folder.items(),
    ]


manifest = ElementTree.fromstring(text_of('package.xml'))
NAME = manifest.findtext('name')
packages = find_packages(include=[NAME, f'{NAME}.*'])
needed = requirements('run')
figures = [line for line in needed if line.startswith('matplotlib')]
node = [line for line in needed if line.startswith(NODE)]
executables = [
    'planner_node = rrth_planner.ros.planner_node:main',
    'playback_node = rrth_planner.ros.playback_node:main',
    'simulation_node = rrth_planner.ros.simulation_node:main',
    'body_boxes_node = rrth_planner.ros.body_boxes_node:main',
    'campaign = rrth_planner.cli.campaign:main',
    'demo = rrth_planner.cli.demo:main',
    'plan = rrth_planner.cli.plan:main',
    'plot = rrth_planner.cli.plot:main',
    'point_at = rrth_planner.cli.point_at:main',
    'read_urdf = rrth_planner.cli.read_urdf:main',
    'record = rrth_planner.cli.record:main',
    'rehearse = rrth_planner.cli.rehearse:main',
    'replay = rrth_planner.cli.replay:main',
    'reproduce = rrth_planner.cli.reproduce:main',
    'viewer = rrth_planner.cli.viewer:main',
    'simulate = rrth_planner.cli.simulate:main',
    'wearer = rrth_planner.cli.wearer:main',
    'write_urdf = rrth_planner.cli.write_urdf:main',
]

setup(
    name=NAME,
    version=manifest.findtext('version'),
    description=manifest.findtext('description'),
    long_description=text_of('README.md'),
    long_description_content_type='text/markdown',
    license='Apache-2.0',
    maintainer=manifest.findtext('maintainer'),
    maintainer_email=manifest.find('maintainer').get('email'),
    project_urls={url.get('type', 'website'): url.text for url in manifest.findall('url')},
    keywords=['motion planning', 'collision checking', 'wearable robotics', 'RRT', 'ROS 2'],
    classifiers=[
        'Development Status :: 5 - Production/Stable',
        'Intended Audience :: Science/Research',
        'Operating System :: POSIX :: Linux',
        'Programming Language :: Python :: 3',
        'Programming Language :: Python :: 3.10',
        'Programming Language :: Python :: 3.11',
        'Programming Language :: Python :: 3.12',
        'Programming Language :: Python :: 3.13',
        'Topic :: Scientific/Engineering',
        'Typing :: Typed',
    ],
    packages=[*packages, *(f'{NAME}.{folder}' for folder in FILES)] if IS_WHEEL else packages,
    package_dir={f'{NAME}.{folder}': folder for folder in FILES} if IS_WHEEL else {},
    package_data={
        NAME: ['py.typed'],
        **({f'{NAME}.{folder}': FILES[folder] for folder in FILES} if IS_WHEEL else {}),
    },
    data_files=[] if IS_WHEEL else shared_files(),
    python_requires='>=3.10',
    install_requires=[line for line in needed if line not in node],
    extras_require={
        'node': node,
        'ros': [*node, *requirements('ros-wheels')],
        'campaign': [*requirements('campaign'), *figures],
        'simulation': requirements('simulation'),
        'tools': [*requirements('tools'), *figures],
        # By it colcon knows that pytest runs the tests.
        'test': ['pytest', 'hypothesis'],
    },
    # The sources of the kernels name the folder of their code, so these must be real files.
    zip_safe=False,
    entry_points={
        'console_scripts': ['rrth = rrth_planner.cli.rrth:main'] if IS_WHEEL else executables,
    },
)
