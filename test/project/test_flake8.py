# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0

from pathlib import Path

import pytest

ament_flake8 = pytest.importorskip('ament_flake8.main')


@pytest.mark.flake8
@pytest.mark.linter
def test_flake8():
    config = Path(__file__).parents[2] / 'setup.cfg'
    rc, errors = ament_flake8.main_with_errors(argv=['--config', str(config)])
    assert rc == 0, f'Found {len(errors)} code style errors / warnings:\n' + '\n'.join(errors)
