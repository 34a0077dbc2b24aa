# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""
The real action control_msgs/action/PointHead, where no package control_msgs is installed.

The wheels have no control_msgs, but the generators of rosidl: from the action's definition they
write what a package of ROS has, a compiler makes libraries of that, and the package that results
is imported, by this process and by others, like the installed one. Run as a program, this file
generates the sources of the package in a folder.
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

PACKAGE = 'control_msgs'
# control_msgs/action/PointHead.action of https://github.com/ros-controls/control_msgs, branch
# jazzy (licence: BSD-3-Clause).
DEFINITION = """\
geometry_msgs/PointStamped target
geometry_msgs/Vector3 pointing_axis
string pointing_frame
builtin_interfaces/Duration min_duration
float64 max_velocity
---
---
float64 pointing_angle_error
"""
# The packages whose messages it has, or an action needs.
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


def available(keep):
    """
    Have control_msgs importable; return the folder that other processes need in PYTHONPATH.

    It is empty where the package is installed. keep: returns the folder of a name, which stays
    from run to run. Skip the test where the package is neither installed nor can be built.
    """
    text = DEFINITION + Path(__file__).read_text(encoding='utf-8') + sys.version
    folder = keep(f'{PACKAGE}_{hashlib.sha256(text.encode()).hexdigest()[:16]}')
    if str(folder) in sys.path:
        return str(folder)
    if find_spec(PACKAGE) is not None:
        return ''
    if not (folder / PACKAGE).is_dir():
        lacking = _lacking()
        if lacking:
            pytest.skip(f'control_msgs is not installed, and cannot be built without {lacking}')
        # Of several processes that build it one is the first.
        with tempfile.TemporaryDirectory(dir=folder) as scratch:
            _build(Path(scratch))
            try:
                (Path(scratch) / PACKAGE).rename(folder / PACKAGE)
            except OSError:
                assert (folder / PACKAGE).is_dir()
    sys.path.append(str(folder))
    return str(folder)


def _lacking():
    """Return what is not here to build the package with; empty: nothing."""
    needed = {f'the program {name}': shutil.which(name) for name in ('gcc', 'g++')}
    needed |= {f'the Python package {name}': find_spec(name) for name in GENERATORS}
    files = (PYTHON_HEADERS / 'Python.h', PREFIX / 'include' / 'rcutils', PREFIX / 'share' / 'rcl')
    needed |= {str(file): file.exists() for file in files}
    return ', '.join(what for what, found in needed.items() if not found)


def _build(folder):
    """Build the package in a folder, without optimization: it is used for a few messages."""
    environment = {**os.environ, 'AMENT_PREFIX_PATH': str(PREFIX)}
    _run([sys.executable, __file__, str(folder)], environment)
    package = folder / PACKAGE
    detail = package / 'action' / 'detail'
    include = PREFIX / 'include'
    second = folder / INTROSPECTION
    folders = [folder, second, PYTHON_HEADERS, np.get_include(), include, *include.iterdir()]
    flags = ['-O0', '-w', '-fPIC', *(f'-I{path}' for path in folders)]
    messages = [
        *(
            detail / f'point_head__{name}.c'
            for name in ('functions', 'description', 'type_support')
        ),
        detail / 'point_head__type_support_c.cpp',
        package / 'action' / 'point_head__type_support.cpp',
        second / PACKAGE / 'action' / 'detail' / 'point_head__type_support.c',
    ]
    python = [package / 'action' / '_point_head_s.c', *package.glob('_*.ep.*.c')]
    for source in (*messages, *python):
        compiler = 'gcc' if source.suffix == '.c' else 'g++'
        _run([compiler, '-c', *flags, source, '-o', source.with_suffix('.o')])
    objects = [[source.with_suffix('.o') for source in part] for part in (messages, python)]
    used = [f'-l{name}__{kind}' for name in USED for kind in KINDS]
    used += [f'-l{name}' for name in LIBRARIES]
    used = [f'-L{PREFIX}/lib', f'-Wl,-rpath,{PREFIX}/lib', *used]
    own = [f'-L{package}', '-Wl,-rpath,$ORIGIN', '-Wl,--no-as-needed']
    names = [f'{PACKAGE}__{kind}' for kind in (FASTRTPS, INTROSPECTION)]
    # Both type supports are in one library. The second only has to be there by its name.
    _link(package, f'lib{names[0]}.so', [*objects[0], *used])
    _link(package, f'lib{names[1]}.so', [*own, f'-l{names[0]}'])
    own += [f'-l{name}' for name in names]
    _link(package, f'{PACKAGE}_s__{DISPATCH}.so', [*objects[1], *own, *used])
    (package / '__init__.py').write_text('', encoding='utf-8')


def _link(package, name, words):
    _run(['g++', '-shared', '-o', package / name, f'-Wl,-soname,{name}', *words])


def _run(command, environment=None):
    done = subprocess.run(
        [*map(str, command)], env=environment, capture_output=True, text=True, timeout=300
    )
    assert done.returncode == 0, f'{command[0]}: {done.stdout}{done.stderr}'


def generate(folder):
    """Write the sources of the package to a folder, by the generators of rosidl."""
    from rosidl_cli.command.translate.api import translate
    from rosidl_generator_c.cli import GenerateC
    from rosidl_generator_py.cli import GeneratePython
    from rosidl_typesupport_c.cli import GenerateCTypesupport
    from rosidl_typesupport_fastrtps_c.cli import GenerateFastRTPSCTypesupport
    from rosidl_typesupport_introspection_c.cli import GenerateIntrospectionCTypesupport

    definitions = folder / 'definitions'
    (definitions / 'action').mkdir(parents=True)
    (definitions / 'action' / 'PointHead.action').write_text(DEFINITION, encoding='utf-8')
    include = [str(PREFIX / 'share' / name) for name in USED]
    interfaces = translate(
        package_name=PACKAGE,
        interface_files=[f'{definitions}:action/PointHead.action'],
        include_paths=include,
        output_format='idl',
        output_path=definitions,
    )
    supports = [FASTRTPS, INTROSPECTION]
    for generator, place in (
        (GenerateC('c'), PACKAGE),
        (GeneratePython('py', typesupport_implementations=[DISPATCH]), PACKAGE),
        (GenerateCTypesupport(DISPATCH, typesupport_implementations=supports), PACKAGE),
        (GenerateFastRTPSCTypesupport(FASTRTPS), PACKAGE),
        # Of the same name as a file of the first.
        (GenerateIntrospectionCTypesupport(INTROSPECTION), f'{INTROSPECTION}/{PACKAGE}'),
    ):
        generator.generate(PACKAGE, list(interfaces), include, folder / place)


if __name__ == '__main__':
    generate(Path(sys.argv[1]))
