# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Sections of a page that several measurements write, each its own, at the end of it."""

# Of `docs/reliability.md`: what `benchmarks.people` writes, and `benchmarks.soak` keeps.
VIRTUAL_TIME = 'Recorded people in virtual time'


def section_of(page: str, title: str) -> str:
    """Return what stands in a section of a page, up to the next one; empty: there is none."""
    _, _, rest = page.partition(f'\n## {title}\n')
    return rest.partition('\n## ')[0].strip()


def with_section(page: str, title: str, text: str) -> str:
    """Return a page that ends with a section, in place of the one with its title."""
    before, _, rest = page.partition(f'\n## {title}\n')
    _, heading, after = rest.partition('\n## ')
    return f'{before.rstrip()}\n{heading}{after}'.rstrip() + f'\n\n## {title}\n\n{text.strip()}\n'
