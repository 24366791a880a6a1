"""Reports in a headless Chromium: nothing is fetched, nothing goes wrong, the slider moves the robot."""

import pytest

MOVE = """part => {
    const slider = document.getElementById("time");
    slider.value = part * slider.max;
    slider.dispatchEvent(new Event("input"));
}"""


@pytest.fixture(scope="module")
def open_report(browser, tmp_path_factory):
    """Open a report; gives the page, what it said and what it asked for."""
    file = tmp_path_factory.mktemp("reports") / "report.html"

    def visit(report, scheme="light"):
        report.save(file)
        page = browser.new_page(
            viewport={"width": 1000, "height": 600}, color_scheme=scheme
        )
        said, asked = [], []
        page.on("console", lambda message: said.append(message.text))
        page.on("pageerror", lambda error: said.append(str(error)))
        page.on("request", lambda request: asked.append(request.url))
        page.goto(file.as_uri())
        page.wait_for_selector("body[data-ready]", timeout=60_000)
        page.wait_for_selector(
            "#timeline_figure .cursor", state="attached", timeout=60_000
        )
        return page, said, asked

    return visit


@pytest.fixture(scope="module")
def planar_visit(open_report, planar_page):
    """The report of the planar motion, whose slider every test moves where it needs it."""
    return open_report(planar_page)


def pixels(page):
    return page.evaluate("document.getElementById('robot').toDataURL()")


def test_the_slider_moves_the_robot_and_all_that_follows_it(planar_visit, planar):
    page, said, requests = planar_visit
    page.evaluate(MOVE, 0.0)
    before, first = pixels(page), page.locator("#values tbody td").all_inner_texts()
    page.evaluate(MOVE, 0.5)
    assert pixels(page) != before
    row = page.locator("#values tbody tr").first.locator("td").all_inner_texts()
    expected = planar.trajectory.position(0.5 * planar.t_end)[0]
    assert float(row[1].split()[0]) == pytest.approx(expected, abs=0.02)
    assert page.locator("#values tbody td").all_inner_texts() != first
    figure = page.locator("#motion_figure")
    box = figure.bounding_box()
    cursor = figure.locator(".cursor").bounding_box()["x"] - box["x"]
    assert 0.3 < cursor / box["width"] < 0.7
    assert said == []
    assert requests == [page.url], "the page requests for nothing but itself"


def test_it_plays_to_the_end_and_stops(planar_visit, planar):
    page, said, _ = planar_visit
    page.evaluate(MOVE, 0.97)
    page.click("#play")
    page.get_by_role("button", name="Play", exact=True).wait_for(timeout=60_000)
    assert page.evaluate(
        "Number(document.getElementById('time').value)"
    ) == pytest.approx(planar.t_end, rel=1e-4)
    assert said == []


def test_figures_are_there_in_dark_and_an_arm_in_space_turns(open_report, weaker_page):
    page, said, requests = open_report(weaker_page, "dark")
    for name in ("motion_figure", "timeline_figure"):
        assert page.locator(f"#{name} .main-svg").count() > 0
    assert page.locator("#motion_figure .scatterlayer .trace").count() > 4 * 7
    before = pixels(page)
    page.locator("#robot").scroll_into_view_if_needed()
    box = page.locator("#robot").bounding_box()
    page.mouse.move(box["x"] + 100, box["y"] + 100)
    page.mouse.down()
    page.mouse.move(box["x"] + 200, box["y"] + 120)
    page.mouse.up()
    assert pixels(page) != before
    assert said == []
    assert requests == [page.url]
