"""A real browser without a window, to look at pages as their reader does."""

from __future__ import annotations

import shutil
from contextlib import contextmanager

import pytest

FOUND = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), "")
_ALONE = (
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
)


@contextmanager
def chromium():
    """A browser that goes to no network by itself."""
    if not FOUND:
        pytest.skip("no chromium here: the page is not looked at in a browser")
    playwright = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    with playwright.sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=FOUND, args=_ALONE)
        yield browser
        browser.close()


@contextmanager
def opened(browser, path, width=1200, height=900):
    """A page, all its plots drawn, and what it complained of or asked the network for."""
    page = browser.new_page(viewport={"width": width, "height": height})
    told = []
    page.on("console", lambda m: told.append(m.text) if m.type in ("error", "warning") else None)
    page.on("pageerror", lambda error: told.append(str(error)))
    page.on("request", lambda r: told.append(r.url) if r.url.startswith("http") else None)
    page.goto(path.as_uri())
    page.wait_for_selector("body[data-drawn=all]")
    yield page, told
    page.close()
