"""Make the picture of the viewer, the first one of the site: ``python docs/make_viewer_picture.py``.

It needs a Chromium (``apt-get install chromium``) and what ``pip install ".[test]"`` installs.
"""

from __future__ import annotations

import shutil
from pathlib import Path

from playwright.sync_api import sync_playwright

import brachis
from brachis.apps.view import Viewer

PICTURE = Path(__file__).parent / "figures/viewer.png"
PART = 0.4
"""The moment that is shown, as a part of the end time."""
SIZE = {"width": 1400, "height": 778}
"""Of the window, pixels: three plots and the whole table are seen."""
PATIENCE = 240_000
"""Software rendering takes long, ms."""
DRAWN = """() => {
    const canvases = [...document.querySelectorAll('canvas')];
    return canvases.length > 2 && canvases.every((canvas) => getComputedStyle(canvas).opacity === '1');
}"""


def main() -> None:
    """Plan, open the viewer in a browser without a window, and take the picture."""
    result = brachis.plan(brachis.examples.tx90l_rail_line)
    chromium = shutil.which("chromium") or shutil.which("google-chrome")
    with (
        sync_playwright() as driver,
        driver.chromium.launch(
            executable_path=chromium,
            args=["--no-sandbox", "--enable-unsafe-swiftshader"],
        ) as browser,
        Viewer(result.trajectory, verified=result.verified, port=0) as viewer,
    ):
        page = browser.new_page(viewport=SIZE)
        page.set_default_timeout(PATIENCE)
        page.goto(f"{viewer.url}?fixedDpr=1")
        page.wait_for_function(DRAWN)
        page.get_by_role("button", name="Pause").dispatch_event("click")
        notices = page.locator(".mantine-Notification-closeButton")
        for _ in range(notices.count()):
            notices.first.click()
        viewer.playback.go_to(PART * viewer.playback.t_end)
        viewer.show()
        page.wait_for_timeout(3000)
        page.screenshot(path=PICTURE, timeout=PATIENCE)


if __name__ == "__main__":
    main()
