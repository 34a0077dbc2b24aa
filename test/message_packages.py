# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""
Messages of packages that are not among the wheels: control_msgs, zed_msgs, mocap4r2_msgs.

The wheels have the generators of rosidl: from the definitions they write what a package of ROS
has, a compiler makes libraries of that, and the package that results is imported, by this process
and by others, like the installed one. Run as a program, this file generates the sources of a
package in a folder.
"""

import hashlib
from importlib.util import find_spec
import os
from pathlib import Path
import shutil
import subprocess
import sys
import sysconfig
import tempfile

import numpy as np
import pytest

# By package and file: control_msgs of https://github.com/ros-controls (BSD-3-Clause), the fields
# of zed_msgs of https://github.com/stereolabs/zed-ros2-interfaces, and those of
# https://github.com/MOCAP4ROS2-Project/mocap4r2_msgs (both Apache-2.0).
DEFINITIONS = {
    'control_msgs': {
        'action/PointHead.action': """\
geometry_msgs/PointStamped target
geometry_msgs/Vector3 pointing_axis
string pointing_frame
builtin_interfaces/Duration min_duration
float64 max_velocity
---
---
float64 pointing_angle_error
"""
    },
    'zed_msgs': {
        'msg/Keypoint2Df.msg': 'float32[2] kp\n',
        'msg/Keypoint2Di.msg': 'uint32[2] kp\n',
        'msg/Keypoint3D.msg': 'float32[3] kp\n',
        'msg/BoundingBox2Df.msg': 'zed_msgs/Keypoint2Df[4] corners\n',
        'msg/BoundingBox2Di.msg': 'zed_msgs/Keypoint2Di[4] corners\n',
        'msg/BoundingBox3D.msg': 'zed_msgs/Keypoint3D[8] corners\n',
        'msg/Skeleton2D.msg': 'zed_msgs/Keypoint2Df[70] keypoints\n',
        'msg/Skeleton3D.msg': 'zed_msgs/Keypoint3D[70] keypoints\n',
        'msg/Object.msg': """\
string label
int16 label_id
string sublabel
float32 confidence
float32[3] position
float32[6] position_covariance
float32[3] velocity
bool tracking_available
int8 tracking_state
int8 action_state
zed_msgs/BoundingBox2Di bounding_box_2d
zed_msgs/BoundingBox3D bounding_box_3d
float32[3] dimensions_3d
bool skeleton_available
int8 body_format
zed_msgs/BoundingBox2Df head_bounding_box_2d
zed_msgs/BoundingBox3D head_bounding_box_3d
float32[3] head_position
zed_msgs/Skeleton2D skeleton_2d
zed_msgs/Skeleton3D skeleton_3d
""",
        'msg/ObjectsStamped.msg': 'std_msgs/Header header\nzed_msgs/Object[] objects\n',
    },
    'mocap4r2_msgs': {
        'msg/Marker.msg': """\
int8 USE_NAME=0
int8 USE_INDEX=1
int8 USE_BOTH=2
int8 id_type
int32 marker_index
string marker_name
geometry_msgs/Point translation
""",
        'msg/RigidBody.msg': """\
string rigid_body_name
mocap4r2_msgs/Marker[] markers
geometry_msgs/Pose pose
""",
        'msg/RigidBodies.msg': """\
std_msgs/Header header
uint32 frame_number
mocap4r2_msgs/RigidBody[] rigidbodies
""",
    },
}
# The packages whose messages they have, or an action needs.
USED = (
    *('action_msgs', 'builtin_interfaces', 'geometry_msgs'),
    *('service_msgs', 'std_msgs', 'unique_identifier_msgs'),
)
# What the middleware looks for by the names of libraries.
FASTRTPS, INTROSPECTION = 'rosidl_typesupport_fastrtps_c', 'rosidl_typesupport_introspection_c'
DISPATCH = 'rosidl_typesupport_c'
KINDS = ('rosidl_generator_c', 'rosidl_generator_py', DISPATCH, FASTRTPS, INTROSPECTION)
GENERATORS = (*KINDS, 'rosidl_adapter', 'rosidl_generator_type_description')
# Besides those of the messages.
LIBRARIES = (
    *('rosidl_runtime_c', 'rosidl_typesupport_c', FASTRTPS, INTROSPECTION),
    *('rosidl_typesupport_fastrtps_cpp', 'rcutils', 'fastcdr', 'rmw'),
)
PREFIX = Path(sys.prefix)
PYTHON_HEADERS = Path(sysconfig.get_paths()['include'])


def available(package, keep):
    """
    Have a package importable; return the folder that other processes need in PYTHONPATH.

    It is empty where the package is installed. keep: returns the folder of a name, which stays
    from run to run. Skip the test where the package is neither installed nor can be built.
    """
    text = str(DEFINITIONS[package]) + Path(__file__).read_text(encoding='utf-8') + sys.version
    folder = keep(f'{package}_{hashlib.sha256(text.encode()).hexdigest()[:16]}')
    if str(folder) in sys.path:
        return str(folder)
    if find_spec(package) is not None:
        return ''
    if not (folder / package).is_dir():
        lacking = _lacking()
        if lacking:
            pytest.skip(f'{package} is not installed, and cannot be built without {lacking}')
        # Of several processes that build it one is the first.
        with tempfile.TemporaryDirectory(dir=folder) as scratch:
            _build(package, Path(scratch))
            try:
                (Path(scratch) / package).rename(folder / package)
            except OSError:
                assert (folder / package).is_dir()
    sys.path.append(str(folder))
    return str(folder)


def _lacking():
    """Return what is not here to build the package with; empty: nothing."""
    needed = {f'the program {name}': shutil.which(name) for name in ('gcc', 'g++')}
    needed |= {f'the Python package {name}': find_spec(name) for name in GENERATORS}
    files = (PYTHON_HEADERS / 'Python.h', PREFIX / 'include' / 'rcutils', PREFIX / 'share' / 'rcl')
    needed |= {str(file): file.exists() for file in files}
    return ', '.join(what for what, found in needed.items() if not found)


def _build(name, folder):
    """Build the package in a folder, without optimization: it is used for a few messages."""
    environment = {**os.environ, 'AMENT_PREFIX_PATH': str(PREFIX)}
    _run([sys.executable, __file__, name, str(folder)], environment)
    package, second = folder / name, folder / INTROSPECTION
    include = PREFIX / 'include'
    folders = [folder, second, PYTHON_HEADERS, np.get_include(), include, *include.iterdir()]
    flags = ['-O0', '-w', '-fPIC', *(f'-I{path}' for path in folders)]
    # Of actions or of messages.
    messages = [
        *package.glob('*/detail/*.c'),
        *package.glob('*/detail/*__type_support_c.cpp'),
        *package.glob('*/*__type_support.cpp'),
        *second.glob(f'{name}/*/detail/*__type_support.c'),
    ]
    python = [*package.glob('*/_*_s.c'), *package.glob('_*.ep.*.c')]
    for source in (*messages, *python):
        compiler = 'gcc' if source.suffix == '.c' else 'g++'
        _run([compiler, '-c', *flags, source, '-o', source.with_suffix('.o')])
    objects = [[source.with_suffix('.o') for source in part] for part in (messages, python)]
    used = [f'-l{other}__{kind}' for other in USED for kind in KINDS]
    used += [f'-l{library}' for library in LIBRARIES]
    used = [f'-L{PREFIX}/lib', f'-Wl,-rpath,{PREFIX}/lib', *used]
    own = [f'-L{package}', '-Wl,-rpath,$ORIGIN', '-Wl,--no-as-needed']
    names = [f'{name}__{kind}' for kind in (FASTRTPS, INTROSPECTION)]
    # Both type supports are in one library. The second only has to be there by its name.
    _link(package, f'lib{names[0]}.so', [*objects[0], *used])
    _link(package, f'lib{names[1]}.so', [*own, f'-l{names[0]}'])
    own += [f'-l{one}' for one in names]
    _link(package, f'{name}_s__{DISPATCH}.so', [*objects[1], *own, *used])
    (package / '__init__.py').write_text('', encoding='utf-8')
    # As installed packages have them.
    for file, text in DEFINITIONS[name].items():
        definition = package / 'share' / name / file
        definition.parent.mkdir(parents=True, exist_ok=True)
        definition.write_text(text, encoding='utf-8')


def _link(package, name, words):
    _run(['g++', '-shared', '-o', package / name, f'-Wl,-soname,{name}', *words])


def _run(command, environment=None):
    done = subprocess.run(
        [*map(str, command)], env=environment, capture_output=True, text=True, timeout=300
    )
    assert done.returncode == 0, f'{command[0]}: {done.stdout}{done.stderr}'


def generate(name, folder):
    """Write the sources of a package to a folder, by the generators of rosidl."""
    from rosidl_cli.command.translate.api import translate
    from rosidl_generator_c.cli import GenerateC
    from rosidl_generator_py.cli import GeneratePython
    from rosidl_typesupport_c.cli import GenerateCTypesupport
    from rosidl_typesupport_fastrtps_c.cli import GenerateFastRTPSCTypesupport
    from rosidl_typesupport_introspection_c.cli import GenerateIntrospectionCTypesupport

    definitions = folder / 'definitions'
    for file, text in DEFINITIONS[name].items():
        (definitions / file).parent.mkdir(parents=True, exist_ok=True)
        (definitions / file).write_text(text, encoding='utf-8')
    include = [str(PREFIX / 'share' / other) for other in USED]
    interfaces = translate(
        package_name=name,
        interface_files=[f'{definitions}:{file}' for file in DEFINITIONS[name]],
        include_paths=include,
        output_format='idl',
        output_path=definitions,
    )
    supports = [FASTRTPS, INTROSPECTION]
    for generator, place in (
        (GenerateC('c'), name),
        (GeneratePython('py', typesupport_implementations=[DISPATCH]), name),
        (GenerateCTypesupport(DISPATCH, typesupport_implementations=supports), name),
        (GenerateFastRTPSCTypesupport(FASTRTPS), name),
        # Of the same name as a file of the first.
        (GenerateIntrospectionCTypesupport(INTROSPECTION), f'{INTROSPECTION}/{name}'),
    ):
        generator.generate(name, list(interfaces), include, folder / place)


if __name__ == '__main__':
    generate(sys.argv[1], Path(sys.argv[2]))
