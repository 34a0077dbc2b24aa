# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Files that are replaced are seen whole or not at all, whatever the writer does."""

import pytest
from rrth_planner.io.replaced_file import replace_file


def test_who_waits_for_a_file_by_its_name_never_sees_half_of_it(tmp_path):
    seen = []

    def write(fresh):
        fresh.write_text('half')
        seen.append([list(tmp_path.glob(p)) for p in ('incident-*', 'incident-1.yaml*', '*.yaml')])
        fresh.write_text('whole')

    path = tmp_path / 'incident-1.yaml'
    replace_file(path, write)
    assert seen == [[[], [], []]]
    assert path.read_text() == 'whole'
    assert list(tmp_path.iterdir()) == [path]


def test_a_writer_that_fails_leaves_the_file_as_it_was_and_nothing_beside_it(tmp_path):
    path = tmp_path / 'table'
    path.write_text('before')

    def write(fresh):
        fresh.write_text('half')
        raise OSError('the disk is full')

    with pytest.raises(OSError, match='the disk is full'):
        replace_file(path, write)
    assert path.read_text() == 'before'
    assert list(tmp_path.iterdir()) == [path]
