# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""A page has sections of several measurements; each writes its own, and leaves the others."""

from benchmarks.common.sections import section_of, with_section


def test_a_section_is_written_at_the_end_and_replaced_there():
    page = '# Page\n\n## Own\n\nfirst\n'
    one = with_section(page, 'Other', 'a table')
    assert one == '# Page\n\n## Own\n\nfirst\n\n## Other\n\na table\n'
    assert with_section(one, 'Other', 'a table') == one
    assert section_of(one, 'Other') == 'a table'
    both = with_section(with_section(one, 'Third', 'more'), 'Other', 'another table')
    assert both == ('# Page\n\n## Own\n\nfirst\n\n## Third\n\nmore\n\n## Other\n\nanother table\n')
    assert [section_of(both, title) for title in ('Own', 'Third', 'None')] == ['first', 'more', '']
