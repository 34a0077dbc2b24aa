# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""
The site of the documentation, which `./run docs` builds.

The source folder is the whole project: links between pages lead to the same places here as where
the files are browsed.
"""

from pathlib import Path
import sys

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / 'docs' / 'extension')]

import rrth_planner  # noqa: E402

project = 'rrth_planner'
author = 'The rrth_planner authors'
project_copyright = f'2026 {author}'
version = release = rrth_planner.__version__
extensions = ['myst_parser', 'reference', 'sphinx.ext.autodoc', 'sphinx.ext.napoleon']

root_doc = 'docs/index'
source_suffix = {'.md': 'markdown', '.rst': 'restructuredtext'}
include_patterns = [
    'docs/**.md',
    'CHANGELOG.rst',
    'CONTRIBUTING.md',
    'QUALITY_DECLARATION.md',
    'benchmarks/README.md',
    'config/people/README.md',
    'msg_examples/README.md',
]

# Down to the headings that pages link to.
myst_heading_anchors = 4
napoleon_google_docstring = False
# Types stand in the text of a docstring, with shapes and units.
autodoc_typehints = 'signature'
autodoc_member_order = 'bysource'

html_theme = 'furo'
html_title = f'rrth_planner {version}'
html_show_sourcelink = False
# The start page is in docs/.
templates_path = ['templates']
html_additional_pages = {'index': 'to_start_page.html'}

# Pages that only answer browsers, or not every time.
linkcheck_timeout = 20
linkcheck_anchors = False
