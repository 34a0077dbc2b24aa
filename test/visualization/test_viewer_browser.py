# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The page of the viewer in a browser without a window: it shows, plans anew, plays, and ends."""

import re
import signal
import subprocess
import sys

import numpy as np
import pytest

pytest.importorskip('viser')
pytest.importorskip('playwright')
image = pytest.importorskip('matplotlib.image')

from rrth_planner.visualization.viewer.screenshot import find_browser, opened  # noqa: E402

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(find_browser() is None, reason='neither Chromium nor Chrome is installed'),
]
# Cold, the planner is compiled first [s].
LONGEST_RUN = 280.0
SENTENCE = 'waypoints, duration'


@pytest.fixture(name='page', scope='module')
def _page():
    process = subprocess.Popen(
        [sys.executable, '-u', '-m', 'rrth_planner.cli.viewer', '--no-open', '--port', '0'],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )
    try:
        said = ''
        while (found := re.search(r'http://[0-9.:]+', said)) is None:
            line = process.stdout.readline()
            assert line, f'the viewer ended: {said}'
            said += line
        with opened(found.group()) as page:
            page.get_by_text('planning time').first.wait_for()
            yield page
        process.send_signal(signal.SIGINT)
        assert process.wait(60.0) == 0
    finally:
        process.kill()


def response(page):
    """Return the figures that the page shows."""
    return page.get_by_text(SENTENCE).first.inner_text()


def canvas(page, path):
    """Return what is drawn, (height, width, 3)."""
    path.write_bytes(page.locator('canvas').first.screenshot())
    return image.imread(path)[..., :3]


def wait_for_another(page, before):
    """Return the figures once they are others."""
    page.wait_for_function(
        '([words, before]) => [...document.querySelectorAll("*")].some(e => e.children.length < 3'
        ' && e.innerText && e.innerText.includes(words) && !e.innerText.includes(before))',
        arg=[SENTENCE, before.strip()],
    )
    return response(page)


def test_wearer_and_arm_are_drawn(page, tmp_path):
    pixels = canvas(page, tmp_path / 'one.png')
    assert pixels.std() > 0.02
    assert len(np.unique((255 * pixels[::8, ::8]).astype(int).reshape(-1, 3), axis=0)) > 20


def test_another_target_is_planned_for_at_once(page):
    before = response(page)
    values = page.eval_on_selector_all('input', 'all => all.map(e => e.value)')
    field = page.locator('input').nth(values.index('1.5'))
    field.fill('0.9')
    field.press('Enter')
    after = wait_for_another(page, before)
    assert after != before
    assert 'planning time' in page.get_by_text('planning time').first.inner_text()


def test_a_target_that_is_dragged_is_planned_for(page, tmp_path):
    before, pixels = response(page), canvas(page, tmp_path / 'drag.png')
    red, green, blue = np.moveaxis(pixels, -1, 0)
    # The arrow that points up, the only thing that is drawn in this blue.
    rows, columns = np.nonzero((blue > 0.8) & (red < 0.35) & (abs(green - 0.55) < 0.12))
    assert len(rows) > 5
    box = page.locator('canvas').first.bounding_box()
    scale = box['width'] / pixels.shape[1]
    tip = rows.argmin()
    x = box['x'] + scale * columns[tip]
    y = box['y'] + scale * (rows[tip] + 4)
    page.mouse.move(x, y)
    page.wait_for_timeout(500)
    page.mouse.down()
    for k in range(1, 9):
        page.mouse.move(x, y - 8 * k)
        page.wait_for_timeout(100)
    page.mouse.up()
    assert wait_for_another(page, before) != before
    assert 'planning time' in page.get_by_text('planning time').first.inner_text()


def test_the_motion_plays(page, tmp_path):
    time = page.evaluate('() => [...document.querySelectorAll("input")].map(e => e.value)')
    page.get_by_role('button', name='Play').click()
    page.wait_for_function(
        'before => [...document.querySelectorAll("input")].map(e => e.value).join() != before',
        arg=','.join(time),
    )
    assert canvas(page, tmp_path / 'two.png').std() > 0.02
