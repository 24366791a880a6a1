"""The viewer in a real browser: what a person sees. Pictures are kept in the folder that BRACHIS_ARTEFACTS names."""

import io
import os
from pathlib import Path

import numpy as np
import pytest

import brachis
from brachis.apps.view import Viewer

pytest.importorskip("viser", reason="viser is not installed")
image = pytest.importorskip("PIL.Image")

PATIENCE = 240_000
"""Software rendering on a busy machine, ms."""
DRAWN = """() => {
    const canvases = [...document.querySelectorAll('canvas')];
    return canvases.length > 2 && canvases.every((canvas) => getComputedStyle(canvas).opacity === '1');
}"""
"""The scene fades in once its light is loaded."""


LINES = """() => {
    const middle = (element) => { const box = element.getBoundingClientRect(); return (box.left + box.right) / 2; };
    const lines = [...document.querySelectorAll('[data-part]')], areas = [...document.querySelectorAll('.u-over')];
    return lines.map((line, i) => {
        const area = areas[i].getBoundingClientRect(), box = line.getBoundingClientRect();
        const wanted = area.left + Number(line.dataset.part) * area.width;
        return [middle(line) - wanted, box.top - area.top, box.bottom - area.bottom];
    });
}"""
"""How far the lines are from where they should be over their plots, pixels."""


CUT = """() => [...document.querySelectorAll('table')]
    .filter((table) => table.offsetWidth > table.parentElement.clientWidth)
    .map((table) => table.innerText)"""
"""Tables that are wider than what they stand in."""


@pytest.fixture(scope="module")
def rail_result():
    """The TX90L on its rail."""
    return brachis.plan(brachis.examples.tx90l_rail_line, effort="single")


def picture(page, name, folder):
    """The scene between the panels, (height, width, 3), and a file of the whole page."""
    content = page.screenshot(path=folder / f"{name}.png", timeout=PATIENCE)
    whole = np.asarray(image.open(io.BytesIO(content)).convert("RGB"), dtype=int)
    return whole[160:, 380:-420]


def count_different(first, second):
    """How many pixels are different."""
    return int((np.abs(first - second).max(axis=2) > 30).sum())


def test_the_slider_moves_the_robot(browser, rail_result, tmp_path):
    folder = Path(os.environ.get("BRACHIS_ARTEFACTS") or tmp_path)
    folder.mkdir(parents=True, exist_ok=True)
    candidates = [candidate.to_dict() for candidate in rail_result.candidates]
    requests, faults = [], []
    with Viewer(
        rail_result.trajectory, candidates, verified=rail_result.verified, port=0
    ) as viewer:
        page = browser.new_page(viewport={"width": 1300, "height": 400})
        page.set_default_timeout(PATIENCE)
        page.on("request", lambda request: requests.append(request.url))
        page.on("pageerror", lambda error: faults.append(str(error)))
        page.goto(f"{viewer.url}?fixedDpr=1")
        page.wait_for_function(DRAWN)
        page.wait_for_function(
            "() => document.body.innerText.includes('t = 0.1')"
        )  # it is played by itself
        # A click waits for several frames, which take seconds while a motion is played and drawn by software.
        page.get_by_role("button", name="Pause").dispatch_event("click")
        slider = page.get_by_role("slider").first
        slider.press("Home")
        page.wait_for_function("() => document.body.innerText.includes('t = 0.0000 s')")
        page.wait_for_timeout(1000)
        first = picture(page, "viewer_start", folder)
        again = picture(page, "viewer_start", folder)
        slider.press("End")
        page.wait_for_function("() => document.body.innerText.includes('s = 1.0000')")
        page.wait_for_timeout(1000)
        last = picture(page, "viewer_end", folder)
        page.locator(
            ".mantine-Notification-closeButton"
        ).first.click()  # "software rendering detected"
        slider.blur()
        viewer.playback.go_to(0.4 * viewer.playback.t_end)
        viewer.show()
        page.wait_for_timeout(1000)
        picture(page, "viewer", folder)
        text, apart = page.inner_text("body"), page.evaluate(LINES)
        cut = page.evaluate(CUT)
        page.get_by_role("checkbox", name="repeat").uncheck()
        with page.expect_download(timeout=PATIENCE) as download:
            page.get_by_role("button", name="Download the report").click()
        report = Path(download.value.path()).read_text(encoding="utf-8")
        page.close()
    assert viewer.playback.time == pytest.approx(0.4 * rail_result.t_end)
    colours = np.unique(first.reshape(-1, 3), axis=0)
    assert len(colours) > 500, "there is something to see"
    assert count_different(first, again) < 50
    assert count_different(first, last) > 2000
    for words in ("verified", "torque / limit", "tool speed (m/s)", "joint_6"):
        assert words in text
    assert cut == []
    assert not viewer.playback.repeats
    assert "<h1>VERIFIED</h1>" in report
    assert len(apart) >= 4
    assert np.abs(apart).max() < 2.0
    assert faults == []
    assert all(url.startswith((viewer.url, "data:", "blob:")) for url in requests)
