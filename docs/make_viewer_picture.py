"""Make the pictures of the viewer, one of them the first of the site: ``python docs/make_viewer_picture.py``.

It needs a Chromium (``apt-get install chromium``) and what ``pip install ".[test]"`` installs.
"""

from __future__ import annotations

import re
import shutil
import tempfile
from pathlib import Path

from playwright.sync_api import sync_playwright

import brachis
from brachis.apps.view import Viewer

DOCS = Path(__file__).parent
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


def take(result: brachis.Result, name: str) -> None:
    """Open the viewer in a browser without a window, and take the picture."""
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
        page.screenshot(path=DOCS / f"figures/{name}.png", timeout=PATIENCE)


def welding_cell() -> brachis.Result:
    """Plan the task of the tutorial."""
    text = (DOCS / "welding_cell.md").read_text()
    task = re.search(r"%%writefile welding/cell.yaml\n(.*?)```", text, re.DOTALL)
    assert task is not None
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        shutil.copytree(DOCS.parent / "examples/welding_cell", name, dirs_exist_ok=True)
        rail = brachis.compose.Rail(
            range=(-1, 3), velocity=1.5, force=2000, mass=150, mount_xyz=(0, 0, 0.25)
        )
        brachis.compose.on_rail(folder / "arm.urdf", rail, output=folder / "cell.urdf")
        (folder / "cell.yaml").write_text(task[1])
        return brachis.plan(folder / "cell.yaml")


def main() -> None:
    """Plan, and take the pictures."""
    take(brachis.plan(brachis.examples.tx90l_rail_line), "viewer")
    take(welding_cell(), "welding_cell")


if __name__ == "__main__":
    main()
