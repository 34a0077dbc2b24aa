# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""A picture of the page, by a browser without a window."""

from collections.abc import Iterator
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path
import shutil
import time
from typing import Any

from rrth_planner.model.errors import OptionsError, RrthError

BROWSERS = ('chromium', 'chromium-browser', 'google-chrome', 'google-chrome-stable')
WIDTH, HEIGHT = 1500, 940
# Without a graphics card the browser draws by software.
ARGUMENTS = (
    '--no-sandbox',
    '--use-gl=angle',
    '--use-angle=swiftshader',
    '--ignore-gpu-blocklist',
    '--enable-unsafe-swiftshader',
    '--hide-scrollbars',
)
# The page's notification that there is no graphics card, closed before the picture.
REMARK = 'Software WebGL rendering detected'
# Longest wait for a page to stop changing [s].
PATIENCE, PAUSE = 120.0, 1.5


def find_browser() -> str | None:
    """Return where Chromium or Chrome is, or None."""
    return next(filter(None, map(shutil.which, BROWSERS)), None)


@contextmanager
def opened(url: str) -> Iterator[Any]:
    """
    Open a page in a browser without a window, and give playwright's Page once it has a canvas.

    Raises
    ------
    OptionsError
        Playwright or a browser is missing.
    RrthError
        The page does not load.

    """
    if find_spec('playwright') is None:
        raise OptionsError(
            'playwright: not installed, expected for a picture of the page '
            '(pip install playwright, or ./run exec pip install playwright)'
        )
    browser_path = find_browser()
    if browser_path is None:
        raise OptionsError(f'no browser found, expected one of {", ".join(BROWSERS)} in PATH')
    from playwright.sync_api import Error, sync_playwright

    with sync_playwright() as playwright:
        try:
            browser = playwright.chromium.launch(
                executable_path=browser_path, args=list(ARGUMENTS), timeout=1e3 * PATIENCE
            )
            page = browser.new_page(viewport={'width': WIDTH, 'height': HEIGHT})
            page.set_default_timeout(1e3 * PATIENCE)
            page.goto(url)
            page.wait_for_selector('canvas')
            yield page
            browser.close()
        except Error as problem:
            raise RrthError(f'the browser {browser_path}: {problem}') from problem


def save_picture(url: str, file: Path) -> None:
    """Save a picture of a page as PNG, or raise RrthError."""
    if not file.absolute().parent.is_dir():
        raise OptionsError(f'--screenshot {file}: its folder does not exist')
    with opened(url) as page:
        page.get_by_text('planning time').first.wait_for()
        page.wait_for_timeout(1e3 * PAUSE)
        if page.get_by_text(REMARK).count():
            page.locator('.mantine-Notification-closeButton').first.click()
        # Drawn, once two pictures in a row are the same.
        end = time.monotonic() + PATIENCE
        before, now = b'', bytes(page.screenshot())
        while now != before and time.monotonic() < end:
            page.wait_for_timeout(1e3 * PAUSE)
            before, now = now, bytes(page.screenshot())
        file.write_bytes(now)
    print(f'Picture: {file}')
