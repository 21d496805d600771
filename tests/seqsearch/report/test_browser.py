"""The page in a real browser: no message, no overflow, drawings that turn."""

import json

import pytest

from feasibility.runtime.atomic import write_text
from seqsearch.report import write_report
from tests.helpers.chromium import Chromium, find_chromium
from tests.helpers.handmade_tours import handmade_run, handmade_tour

pytestmark = pytest.mark.skipif(
    find_chromium() is None, reason="no Chromium (Debian: apt-get install chromium)"
)


@pytest.fixture(scope="module")
def browser(tmp_path_factory):
    with Chromium(find_chromium(), tmp_path_factory.mktemp("profile"), timeout_s=120.0) as found:
        yield found


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    folder = tmp_path_factory.mktemp("report")
    names = ["(4) Vesta"] + [f"{k} a rather long name of a body" for k in range(9)]
    run = handmade_run(folder / "run", handmade_tour(names=tuple(names)), ranks=9)
    write_report(run, folder / "page.html")
    return folder / "page.html"


@pytest.mark.parametrize("width", [390, 1440])
@pytest.mark.parametrize("dark", [False, True])
def test_nothing_overflows_and_nothing_is_logged(browser, page, tmp_path, width, dark):
    browser.messages.clear()
    browser.open(page, width=width, dark=dark)
    assert browser.messages == []
    assert browser.run("document.documentElement.dataset.drawn") == "yes"
    assert browser.run("document.documentElement.scrollWidth") == width
    # Whatever is wider than the page scrolls in a box of its own.
    inside = "[...document.querySelectorAll('main > section, figure, .drawing, svg, canvas')]"
    assert browser.run(f"Math.max(...{inside}.map(e => e.getBoundingClientRect().right))") <= width
    background = browser.run("getComputedStyle(document.body).backgroundColor")
    assert background == ("rgb(20, 22, 26)" if dark else "rgb(255, 255, 255)")
    browser.screenshot(tmp_path / "page.png")
    assert (tmp_path / "page.png").stat().st_size > 30_000


def _ink(browser, canvas):
    """Return what is drawn on a canvas, as the text of a picture."""
    return browser.run(f"document.getElementById('{canvas}').toDataURL()")


def test_everything_is_drawn(browser, page):
    browser.open(page, width=1440)
    # The picture of an empty canvas has some kilobytes.
    assert len(_ink(browser, "ecliptic")) > 20_000
    assert len(_ink(browser, "space")) > 20_000
    for name in ("thrust", "mass", "visits", "ranks", "candidates"):
        marks = f"document.querySelectorAll('#{name} path, #{name} rect').length"
        assert browser.run(marks) > 0, name
    assert browser.run("document.querySelectorAll('#visits > svg .flight').length") == 9
    assert browser.run("document.querySelectorAll('tbody')[0].rows.length") == 9
    assert browser.run(
        "[...document.getElementById('pass').options].map(o => o.value).join()"
    ) == ("all,2,1")


def test_the_view_in_space_turns_by_mouse_and_by_keys(browser, page):
    browser.open(page, width=1440)
    browser.run("document.getElementById('space').scrollIntoView()")
    box = browser.run("document.getElementById('space').getBoundingClientRect().toJSON()")
    seen = {_ink(browser, "space")}
    browser.drag(box["x"] + 200, box["y"] + 200, 80, 30)
    seen.add(_ink(browser, "space"))
    browser.run("document.getElementById('space').focus()")
    for key in ("ArrowLeft", "ArrowUp", "+"):
        browser.call("Input.dispatchKeyEvent", type="keyDown", key=key)
        seen.add(_ink(browser, "space"))
    browser.run("document.getElementById('higher').click()")
    seen.add(_ink(browser, "space"))
    assert len(seen) == 6
    assert browser.messages == []


def test_the_view_in_space_turns_by_touch_and_the_page_stays(browser, page):
    browser.open(page, width=390)
    browser.call("Emulation.setTouchEmulationEnabled", enabled=True)
    try:
        browser.run("document.getElementById('space').scrollIntoView()")
        box = browser.run("document.getElementById('space').getBoundingClientRect().toJSON()")
        before, top = _ink(browser, "space"), browser.run("scrollY")
        x, y = box["x"] + 100, box["y"] + 150
        for kind, points in (
            ("touchStart", [{"x": x, "y": y}]),
            ("touchMove", [{"x": x + 20, "y": y - 15}]),
            ("touchMove", [{"x": x + 60, "y": y - 60}]),
            ("touchEnd", []),
        ):
            browser.call("Input.dispatchTouchEvent", type=kind, touchPoints=points)
        assert _ink(browser, "space") != before
        assert browser.run("scrollY") == top
    finally:
        browser.call("Emulation.setTouchEmulationEnabled", enabled=False)


def test_pointing_at_a_number_says_where_and_when(browser, page):
    browser.open(page, width=1440)
    browser.run("document.getElementById('ecliptic').scrollIntoView()")
    # Somewhere on a grid of points there is a stop.
    said = browser.run(
        "(() => { const c = document.getElementById('ecliptic');"
        "const b = c.getBoundingClientRect();"
        "for (let x = b.left; x < b.right; x += 8) for (let y = b.top; y < b.bottom; y += 8)"
        "c.dispatchEvent(new PointerEvent('pointermove', {clientX: x, clientY: y}));"
        "return document.getElementById('pointed').textContent; })()"
    )
    assert "rather long name" in said or "Vesta" in said


def test_the_colours_follow_the_scheme_while_the_page_is_open(browser, page):
    browser.open(page, width=1440)
    light = _ink(browser, "ecliptic")
    scheme = {"name": "prefers-color-scheme", "value": "dark"}
    browser.call("Emulation.setEmulatedMedia", features=[scheme])
    browser.run("new Promise(f => requestAnimationFrame(() => requestAnimationFrame(f)))")
    assert _ink(browser, "ecliptic") != light


def test_names_of_strangers_stay_names(browser, tmp_path):
    evil = "<script>window.hacked = 1</script><img src=x onerror='window.hacked = 1'>"
    run = handmade_run(tmp_path / "run", handmade_tour(names=(evil, "</script>", evil, "D")))
    record = json.loads((run / "provenance.json").read_text())
    write_text(run / "provenance.json", json.dumps(record | {"command": [evil], "seed": evil}))
    write_report(run, tmp_path / "page.html")
    browser.messages.clear()
    browser.open(tmp_path / "page.html", width=390)
    assert browser.messages == []
    assert browser.run("window.hacked === undefined")
    assert browser.run("document.images.length") == 0
    assert browser.run("document.documentElement.scrollWidth") == 390
    assert browser.run("document.querySelectorAll('#visits .name title')[1].textContent") == evil
