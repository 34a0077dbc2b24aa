# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""What the documents show and quote is there: pictures, the commands that make them, sentences."""

import ast
from pathlib import Path
import re
import subprocess
import sys

import pytest

ROOT = Path(__file__).parents[2]
PAGES = [ROOT / 'README.md', *sorted((ROOT / 'docs').rglob('*.md'))]
PAGES += [ROOT / name for name in ('CONTRIBUTING.md', 'QUALITY_DECLARATION.md')]
PAGES += sorted((ROOT / '.github').glob('*.md'))
IMAGE = re.compile(r'!\[[^\]]*\]\(([^)\s]+)\)')
LINK = re.compile(r'(?<!!)\[[^\]]*\]\(([^)\s]+)\)')
# A command in backticks, as one would type it.
COMMAND = re.compile(r'`((?:\./run|python -m|ros2) [^`]+)`')
# The pages with code to try.
CODE = ('README.md', 'docs/start_python.md')
# A snippet, and the example that the line before it names.
SNIPPET = re.compile(r'^([^\n]*)\n\n```python\n(.*?)^```', re.MULTILINE | re.DOTALL)
FENCE = re.compile(r'^```.*?^```', re.MULTILINE | re.DOTALL)
pytestmark = pytest.mark.skipif(
    not (ROOT / 'docs').is_dir(), reason='the documents are not installed'
)


def prose(page):
    """Return a page without what stands between fences."""
    return FENCE.sub('', page.read_text(encoding='utf-8'))


def sections(text):
    """Return the parts of a page from heading to heading."""
    return re.split(r'^(?=#{1,6} )', text, flags=re.MULTILINE)


def commands_near(text, picture):
    """
    Return the commands beside a picture: in its paragraph, or the ones before and after it.

    A page that a command has written says so at its beginning, for all of its pictures.
    """
    paragraphs = re.split(r'\n\s*\n', text)
    found = COMMAND.findall('\n'.join(p for p in paragraphs if p.startswith('Written by `')))
    for k, paragraph in enumerate(paragraphs):
        if f']({picture})' in paragraph:
            found += COMMAND.findall('\n'.join(paragraphs[max(0, k - 1) : k + 2]))
    return found


def anchor(heading):
    """Return what a heading is linked to by."""
    return re.sub(r'[^\w\- ]', '', heading.strip().lower()).replace(' ', '-')


def pictures():
    """Return (page, picture) of all pictures that pages show."""
    return [(page, picture) for page in PAGES for picture in IMAGE.findall(prose(page))]


def test_a_command_is_found_beside_a_picture_only():
    text = (
        'One.\n\n![a](a.png)\n\nBy `./run demo`.\n\n![b](b.png)\n\nTwo.\n\n![c](c.png)\n\n`x.py`'
    )
    assert commands_near(text, 'a.png') == ['./run demo']
    assert commands_near(text, 'b.png') == ['./run demo']
    assert commands_near(text, 'c.png') == []
    written = f'# P\n\nWritten by `python -m p`; do not edit.\n\n{text}'
    assert commands_near(written, 'c.png') == ['python -m p']


@pytest.mark.parametrize(
    ('page', 'picture'), pictures(), ids=lambda value: getattr(value, 'name', value)
)
def test_a_picture_is_there_and_names_its_command(page, picture):
    path = page.parent / picture
    assert path.is_file(), f'{page.name} shows {picture}, which is not there'
    # A command names the picture that it draws; some write a whole page.
    name, text = str(path.relative_to(ROOT)), prose(page)
    assert any(
        name in command.split() or f'Written by `{command}`' in text
        for command in commands_near(text, picture)
    ), f'{page.name}: no command beside {picture} that makes {name}'


def test_every_picture_is_shown_somewhere():
    shown = {(page.parent / picture).resolve() for page, picture in pictures()}
    kept = {p for p in (ROOT / 'docs' / 'images').rglob('*') if p.suffix in ('.png', '.gif')}
    assert kept, 'no pictures'
    assert not {str(p.relative_to(ROOT)) for p in kept - shown}


@pytest.mark.parametrize('page', PAGES, ids=lambda page: page.name)
def test_links_lead_somewhere(page):
    for link in LINK.findall(prose(page)):
        if link.startswith(('http://', 'https://', 'mailto:')):
            continue
        path, _, fragment = link.partition('#')
        target = page.parent / path if path else page
        assert target.exists(), f'{page.name} links to {link}, which is not there'
        if fragment:
            headings = re.findall(r'^#+ (.*)$', prose(target), re.MULTILINE)
            assert fragment in map(anchor, headings), f'{page.name}: no heading for {link}'


def snippets():
    """Return (page, line before, code) of all code to try."""
    return [
        (page, *found)
        for page in CODE
        for found in SNIPPET.findall((ROOT / page).read_text(encoding='utf-8'))
    ]


def test_a_snippet_is_in_the_example_that_it_names():
    named = [
        (page, name, snippet)
        for page, before, snippet in snippets()
        for name in re.findall(r'`(examples/\w+\.py)`', before)
    ]
    assert named
    for page, name, snippet in named:
        example = (ROOT / name).read_text(encoding='utf-8')
        assert snippet in example, f'{page} quotes what {name} does not have'
        # Complete: all that it needs, it imports.
        assert example.split('"""')[2].strip().startswith(snippet.split('\n')[0])


# What the snippets print: a length of 158.84 at best; the start comes first.
PLANNED = {
    'A point on a map': r'solved 158\.[89]',
    'A path of the arm': r'solved \[\[ 0\. +-0\.35 ',
}


@pytest.mark.parametrize('start', PLANNED)
def test_five_lines_plan(start, tmp_path):
    # The same on each page that has them.
    (snippet,) = {code for _, before, code in snippets() if before.startswith(start)}
    statements = ast.parse(snippet).body
    assert sum(not isinstance(s, ast.Import | ast.ImportFrom) for s in statements) == 5
    code = f'import sys; sys.path.insert(0, {str(ROOT)!r})\n{snippet}'
    done = subprocess.run(
        [sys.executable, '-c', code], cwd=tmp_path, capture_output=True, text=True, timeout=300
    )
    assert done.returncode == 0, done.stderr
    assert re.match(PLANNED[start], done.stdout), done.stdout


def spoken():
    """Return all texts of the sources, each value in them as NUL, and the script run."""
    texts = [(ROOT / 'run').read_text(encoding='utf-8')]
    for file in sorted((ROOT / 'rrth_planner').rglob('*.py')):
        for node in ast.walk(ast.parse(file.read_text(encoding='utf-8'))):
            if isinstance(node, ast.Constant) and isinstance(node.value, str):
                texts.append(node.value)
            elif isinstance(node, ast.JoinedStr):
                parts = (v.value if isinstance(v, ast.Constant) else '\0' for v in node.values)
                texts.append(''.join(parts))
    return texts


def quoted():
    """Return what the first column of each table of troubleshooting quotes of a program."""
    page = ROOT / 'docs' / 'troubleshooting.md'
    if not page.is_file():
        return []
    rows = [line for line in prose(page).splitlines() if line.startswith('| ')]
    spans = [span for row in rows for span in re.findall(r'`([^`]+)`', row.split(' | ')[0])]
    # Names of commands, topics and codes are no sentences.
    return [span for span in spans if ' ' in span and not span.startswith(('ros2 ', 'point_at '))]


def test_troubleshooting_quotes_what_the_programs_say():
    texts, sentences = spoken(), quoted()
    assert len(sentences) > 30
    unsaid = [
        f'"{part}" of "{sentence}"'
        for sentence in sentences
        # What stands before and after a value may be in one text, or in two.
        for part in (part.strip(' ,:') for part in sentence.split('...'))
        if part and not any(part in text for text in texts)
    ]
    assert not unsaid
