# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The public names are there, and importing the package loads none of them."""

import ast
import os
from pathlib import Path
import re
import subprocess
import sys

import pytest
import rrth_planner
from rrth_planner.planning import options

ROOT = Path(__file__).parents[2]
TYPED = """
import rrth_planner as rrth
reveal_type(rrth.load_arm())
reveal_type(rrth.plan_motion)
reveal_type(rrth.load_settings(4).limits)
reveal_type(rrth.__version__)
rrth.lode_arm()
"""


@pytest.mark.parametrize('name', rrth_planner.__all__)
def test_a_public_name_is_of_the_module_that_is_said(name):
    value = getattr(rrth_planner, name)
    assert value.__name__ == name
    assert value.__module__.startswith('rrth_planner.')


def test_the_options_of_every_planner_are_public():
    kinds = {*options.ALGORITHMS.values(), options.PrintedRRTHOptions}
    assert {kind.__name__ for kind in kinds} <= set(rrth_planner.__all__)


def test_a_name_that_is_none_is_refused_as_any_module_does():
    with pytest.raises(AttributeError, match="'rrth_planner' has no attribute 'plans'"):
        _ = rrth_planner.plans


def test_importing_the_package_loads_nothing_else():
    code = 'import sys, rrth_planner; '
    code += "assert not [n for n in sys.modules if n.startswith(('rrth_planner.', 'numba'))]"
    subprocess.run([sys.executable, '-c', code], check=True)


def test_what_type_checkers_read_is_what_is_imported():
    tree = ast.parse(Path(rrth_planner.__file__).read_text(encoding='utf-8'))
    (block,) = (
        node
        for node in tree.body
        if isinstance(node, ast.If) and ast.unparse(node.test) == 'TYPE_CHECKING'
    )
    read = {
        alias.asname: node.module.removeprefix('rrth_planner.')
        for node in block.body
        for alias in node.names
        if alias.name == alias.asname
    }
    assert read == rrth_planner._HOME


def test_a_type_checker_knows_the_public_names(tmp_path):
    pytest.importorskip('mypy')
    (tmp_path / 'use.py').write_text(TYPED, encoding='utf-8')
    told = subprocess.run(
        [sys.executable, '-m', 'mypy', str(tmp_path / 'use.py')],
        cwd=ROOT,
        env={**os.environ, 'MYPYPATH': str(ROOT)},
        capture_output=True,
        text=True,
        timeout=280,
    ).stdout
    arm, plan, limits, version = re.findall('Revealed type is "(.*)"', told)
    assert arm == 'rrth_planner.model.arm.ArmModel'
    assert plan.startswith('def (arm: rrth_planner.model.arm.ArmModel, scene: ')
    assert plan.endswith(') -> rrth_planner.pipeline.motion_plan.MotionPlan')
    assert limits == 'rrth_planner.model.trajectory.MotionLimits'
    assert version.endswith('str')
    assert 'Module has no attribute "lode_arm"' in told


def test_what_the_examples_use_is_public():
    pages = [ROOT / 'README.md', ROOT / 'docs' / 'start_python.md']
    files = [*pages, *(ROOT / 'examples').glob('*.py')]
    used = {
        name
        for file in files
        for name in re.findall(r'\brrth\.([A-Za-z]\w*)', file.read_text(encoding='utf-8'))
    }
    assert {'load_arm', 'plan', 'plan_motion', 'warm_up', 'load_settings'} <= used
    assert used <= set(rrth_planner.__all__)
    assert {*rrth_planner.__all__, '__version__'} == set(dir(rrth_planner))
