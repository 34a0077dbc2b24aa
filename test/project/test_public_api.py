# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The public names are there, and importing the package loads none of them."""

import subprocess
import sys

import pytest
import rrth_planner
from rrth_planner.planning import options


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
