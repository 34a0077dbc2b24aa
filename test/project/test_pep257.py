# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0

import pytest

ament_pep257 = pytest.importorskip('ament_pep257.main')


@pytest.mark.linter
@pytest.mark.pep257
def test_pep257():
    # Properties are nouns (ruff checks the mood of the others), and an argument whose name and
    # type say all needs no sentence.
    rc = ament_pep257.main(argv=['.', 'test', '--add-ignore', 'D401', 'D417'])
    assert rc == 0, 'Found code style errors / warnings'
