# SPDX-License-Identifier: GPL-3.0-or-later
"""A browser without a window, for tests of pages; they are skipped where Playwright or a Chromium is missing."""

from __future__ import annotations

import base64
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

PROGRAMS = ("chromium", "chromium-browser", "google-chrome", "chrome", "msedge")

DECODE = """async text => {
  const bytes = Uint8Array.from(atob(text), c => c.charCodeAt(0)), image = await createImageBitmap(new Blob([bytes]));
  const canvas = new OffscreenCanvas(image.width, image.height), context = canvas.getContext("2d");
  context.drawImage(image, 0, 0);
  const data = context.getImageData(0, 0, image.width, image.height).data, parts = [];
  for (let at = 0; at < data.length; at += 8192) parts.push(String.fromCharCode(...data.subarray(at, at + 8192)));
  return [image.width, image.height, btoa(parts.join(""))];
}"""


@contextmanager
def opened() -> Iterator[Any]:
    """A browser of Playwright, with the system's Chromium or else its own. Skips the test without one."""
    playwright = pytest.importorskip("playwright.sync_api", reason="Playwright is not installed in this environment")
    with playwright.sync_playwright() as started:
        program = next(filter(None, map(shutil.which, PROGRAMS)), None)
        try:
            # Chromium's sandbox refuses root, as whom containers run tests of the project's own pages.
            browser = started.chromium.launch(executable_path=program, args=["--no-sandbox"])
        except playwright.Error as error:
            pytest.skip(f"no Chromium starts: {str(error).splitlines()[0]}")
        yield browser
        browser.close()


def pixels(tab: Any, png: bytes) -> NDArray[np.int64]:
    """(height, width, 4) of a PNG file, 0 to 255, rows from the top."""
    width, height, flat = tab.evaluate(DECODE, base64.b64encode(png).decode())
    return np.frombuffer(base64.b64decode(flat), np.uint8).astype(np.int64).reshape(height, width, 4)
