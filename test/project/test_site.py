# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The site of the documentation: it builds, and says what the code says, no more and no less."""

from pathlib import Path
import re
import subprocess
import sys

import pytest
import rrth_planner
from rrth_planner.cli import rrth

ROOT = Path(__file__).parents[2]
# Other programs that pages start in the environment of the project.
PROGRAMS = {'python', 'pip', 'ruff', 'pre-commit', 'sphinx-build'}
# Commands of `run`, and of rclpy and pytest, that are no command of `rrth`.
OPTION = re.compile(r'(?<![\w-])--[a-z][a-z-]*')
NOT_OURS = {'--ros-args', '--params-file', '--enclave', '--help', '--version'}
NODES = ('rrth_planner', 'arm_playback', 'arm_simulation', 'body_boxes_node')
pytestmark = pytest.mark.skipif(
    not (ROOT / 'docs').is_dir(), reason='the documents are not installed'
)


def pages():
    """Return the texts of all pages by their names."""
    files = [ROOT / 'README.md', *sorted((ROOT / 'docs').rglob('*.md'))]
    return {str(f.relative_to(ROOT)): f.read_text(encoding='utf-8') for f in files}


@pytest.fixture(scope='module', name='site')
def _site(tmp_path_factory):
    """Build the site once, and return its folder and how that ended."""
    for needed in ('sphinx', 'myst_parser', 'furo', 'rclpy', 'fcl'):
        pytest.importorskip(needed)
    folder = tmp_path_factory.mktemp('site')
    command = (sys.executable, '-m', 'sphinx', '-W', '--keep-going', '-q', '-c', ROOT / 'docs')
    ended = subprocess.run(
        [*command, '-d', folder / 'doctrees', ROOT, folder / 'html'],
        capture_output=True,
        text=True,
        timeout=280,
    )
    return folder / 'html', ended


@pytest.fixture(scope='module', name='tables')
def _tables(site):
    """Give what returns the first `n` cells of each row below a heading of a page, as text."""
    from bs4 import BeautifulSoup

    folder, _ = site

    def rows(page, heading, n=1, table=0):
        text = (folder / 'docs' / 'reference' / f'{page}.html').read_text(encoding='utf-8')
        found = BeautifulSoup(text, 'html.parser').find(id=heading).find_all('table')[table]
        cells = (row.find_all('td') for row in found.find('tbody').find_all('tr'))
        return [tuple(cell.get_text() for cell in row[:n]) for row in cells]

    return rows


def test_the_site_builds_without_a_warning(site):
    folder, ended = site
    assert ended.returncode == 0, ended.stderr
    assert (folder / 'index.html').read_text().count('docs/index.html') == 2
    built = {str(path.relative_to(folder)) for path in folder.rglob('*.html')}
    expected = {name.replace('.md', '.html') for name in pages()} - {'README.html'}
    assert expected <= built


@pytest.mark.parametrize('node', NODES)
def test_the_site_has_the_parameters_of_each_node(node, tables):
    declared = settings()[node]
    heading = f'node-{node.replace("_", "-")}'
    rows = tables('parameters', heading, 5)
    assert [row[0] for row in rows] == [s.name for s in declared]
    for (_, default, unit, limits, meaning), setting in zip(rows, declared, strict=True):
        assert unit == setting.unit
        assert meaning.startswith(setting.description.replace('`', ''))
        has_limits = setting.low is not None and not isinstance(setting.default, bool)
        assert [float(word) for word in limits.split(' to ') if word] == (
            [setting.low, setting.high] if has_limits else []
        )
        first = setting.default[0] if isinstance(setting.default, list) else setting.default
        if isinstance(first, int | float):
            words = default.strip('[]').split(', ')
            assert float({'true': '1', 'false': '0'}.get(words[0], words[0])) == pytest.approx(
                float(first), rel=1e-5
            )


def test_the_site_has_the_error_codes(tables):
    from rrth_planner.model.status import ErrorCode
    from rrth_planner.ros.messages.error_codes import MEANINGS

    expected = [(code.name, str(code.value)) for code in ErrorCode]
    assert tables('error_codes', 'error-codes', 2) == expected
    assert set(MEANINGS) == set(ErrorCode)


@pytest.mark.parametrize('node', NODES)
def test_the_site_has_the_topics_and_services_of_each_node(node, tables):
    from rrth_planner.ros.interface.topics import INTERFACES

    heading = f'node-{node.replace("_", "-")}'
    expected = [(i.direction.value, i.name, i.type) for i in INTERFACES[node]]
    assert tables('topics', heading, 3) == expected


def test_the_site_has_every_command_with_its_help(site, tables):
    from bs4 import BeautifulSoup

    listed = [row[0] for row in tables('commands', 'commands', 1, 1)]
    assert listed == list(rrth.COMMANDS)
    text = (site[0] / 'docs/reference/commands.html').read_text(encoding='utf-8')
    page = BeautifulSoup(text, 'html.parser')
    headings = [h.get_text().rstrip('#¶') for h in page.find_all(['h2', 'h3'])]
    assert headings == ['rrth', *expected_headings(), 'run']
    for name in rrth.COMMANDS:
        help_text = page.find(id=name.replace('_', '-')).find('pre').get_text()
        assert help_text.startswith(f'usage: rrth {name} ')


def expected_headings():
    """Return the commands, each followed by its own commands."""
    for name in rrth.COMMANDS:
        yield name
        yield from {'plot': ['plot plan', 'plot recording']}.get(name, ())


def test_the_site_has_every_public_name(site):
    text = (site[0] / 'docs/reference/api.html').read_text(encoding='utf-8')
    documented = set(re.findall(r'id="rrth_planner\.(\w+)"', text))
    assert documented == set(rrth_planner.__all__)


def started(text):
    """Yield (command, rest of its line) of each command of the project that a page starts."""
    joined = text.replace('\\\n', ' ')
    for match in re.finditer(
        r'(?:\./run exec|ros2 run rrth_planner|\brrth) ([a-z][\w-]*)([^\n`;|&#]*)', joined
    ):
        if match[1] not in PROGRAMS and match[1] != 'NAME':
            yield match[1], match[2]


def reference():
    """Return the module that makes the reference of the code."""
    sys.path.insert(0, str(ROOT / 'docs' / 'extension'))
    module = pytest.importorskip('reference')
    sys.path.pop(0)
    return module


def helps():
    """Return the help of each command, with that of its own commands."""
    found = {}
    for name, parser in reference().parsers():
        first = name.split()[0]
        found[first] = found.get(first, '') + parser.format_help()
    return found


def test_pages_hold_the_tables_that_are_made_from_the_code():
    for needed in ('sphinx', 'rclpy'):
        pytest.importorskip(needed)
    written, n = reference().written, 0
    for page, text in pages().items():
        assert written(text) == text, f'{page}: another table now; ./run docs writes it anew'
        n += text.count('<!-- end -->')
    assert n == 2 * len(NODES) + 2


def test_pages_start_no_command_and_give_no_option_that_there_is_not():
    pytest.importorskip('sphinx')
    options = {name: set(OPTION.findall(text)) | NOT_OURS for name, text in helps().items()}
    seen = 0
    for page, text in pages().items():
        for name, rest in started(text):
            assert name in rrth.COMMANDS, f'{page}: no command {name}'
            unknown = set(OPTION.findall(rest.partition('--ros-args')[0])) - options[name]
            assert not unknown, f'{page}: {name} has no {unknown}'
            seen += 1
    assert seen > 50


def settings():
    """Return the parameters of each node, as it declares them."""
    from rrth_planner.io.arm_file import load_arm
    from rrth_planner.ros.interface import (
        parameters,
        playback_parameters,
        simulation_parameters,
        tracker_parameters,
    )

    return {
        'rrth_planner': (parameters.ARM, *parameters.declared(load_arm().dof)),
        'arm_playback': playback_parameters.SETTINGS,
        'arm_simulation': simulation_parameters.SETTINGS,
        'body_boxes_node': tracker_parameters.SETTINGS,
    }


def test_pages_name_no_topic_that_there_is_not():
    pytest.importorskip('rclpy')
    from rrth_planner.ros.interface.topics import INTERFACES

    known = {i.name for interfaces in INTERFACES.values() for i in interfaces}
    # Of controllers, and what is no topic.
    known |= {'~/joint_trajectory', '__ns', '__node', 'arm_controller/joint_trajectory'}
    known |= {'~/query_state', '~/speed_scaling_input', '~/follow_joint_trajectory'}
    n = 0
    for page, text in pages().items():
        for name in re.findall(r'`(~/[a-z_]+)`|-r ["\']?(\w+):=', text):
            assert ''.join(name) in known, f'{page}: no topic {"".join(name)}'
            n += 1
    assert n > 20


def test_a_default_in_a_table_is_that_of_the_code():
    pytest.importorskip('rclpy')
    defaults = {s.name: s.default for s in settings()['rrth_planner']}
    text = (ROOT / 'docs' / 'separation.md').read_text(encoding='utf-8')
    rows = re.findall(r'^\| `(\w+)` \| ([\d.]+|auto)\b', text, re.MULTILINE)
    assert len(rows) > 5
    for name, default in rows:
        assert (default if default == 'auto' else float(default)) == defaults[name], name


def test_pages_name_no_parameter_and_no_code_that_there_is_not():
    pytest.importorskip('rclpy')
    from rrth_planner.model.status import ErrorCode

    known = {setting.name for declared in settings().values() for setting in declared}
    of_ros = {'use_sim_time', 'robot_description'}
    n_parameters = n_codes = 0
    for page, text in pages().items():
        for name in re.findall(r"-p [\"']?(\w+):=", text):
            assert name in known | of_ros, f'{page}: no parameter {name}'
            n_parameters += 1
        for name, number in re.findall(r'\b([A-Z][A-Z_]{3,}) \((-?\d+)\)', text):
            assert ErrorCode[name] == int(number), f'{page}: {name} is not {number}'
            n_codes += 1
    assert n_parameters > 20
    assert n_codes > 5


def test_the_readme_is_short():
    assert len((ROOT / 'README.md').read_text(encoding='utf-8').splitlines()) < 120
