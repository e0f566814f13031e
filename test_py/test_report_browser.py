"""The report in a browser: no errors, no requests, linked plots, legible in light, dark and print.

VIRTUAL_AXES_REPORT names a page to look at instead of a new one, VIRTUAL_AXES_SCREENSHOTS a folder
that keeps the pictures.
"""

from __future__ import annotations

import os
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from browser import Browser, find_browser
from node_process import node_binary

pytestmark = pytest.mark.extended

LIGHT, DARK = "light", "dark"
WIDE, NARROW = 1280, 390
"""Viewport widths, pixels: a desktop screen, a telephone."""
A4_WIDTH = 703
"""Width of an A4 sheet between margins of 12 mm, pixels of 1/96 inch."""
MOST_BYTES = 8_000_000
MOST_CPU_TIME = 2.0
"""Largest computing time until the page is loaded and its first figure is plotted, s."""

TABLES_CUT_OFF = """
[...document.querySelectorAll('.table')].filter(frame => frame.scrollWidth > frame.clientWidth)
    .map(frame => [frame.innerText.slice(0, 40), frame.scrollWidth, frame.clientWidth])
"""
"""Tables that are wider than their container."""

PLOTS = "[...document.querySelectorAll('.plot')]"


def run(*arguments: object) -> None:
    """Runs the command beside the node."""
    command = [Path(node_binary()).with_name("virtual_axes"), *arguments]
    subprocess.run([str(word) for word in command], check=True, timeout=120, stdout=subprocess.DEVNULL)


def comparison(page: Path) -> None:
    """Writes a page with two runs of the ballbar trial."""
    run("run", "ballbar", "--controller", "cascade", "--controller", "cascade-noff", "--report", page)


def part_program(page: Path) -> None:
    """Writes a page of a part program with rapid traverse."""
    run("run", "circle-diamond-square", "--report", page)


def identification(page: Path) -> None:
    """Writes a page with an identification of X from a short campaign."""
    psec, trace = page.with_name("psec.csv"), page.with_name("off.csv")
    run("psec", "campaign", "--axis", "x", "--part", "off", "--range=-40,40", "--max-feed", 5, "--out", psec)
    off = ["--set", "x.feedforward.velocity=0", "--set", "x.feedforward.torque_kg_m2=0"]
    run("run", psec, *off, "--trace", trace)
    run("identify", trace, "--feedforward", "off", "--axis", "x", "--validate", trace, "--report", page)


@pytest.fixture(scope="module", params=[part_program, comparison, identification], ids=lambda make: make.__name__)
def report(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Returns a page of each kind."""
    if given := os.environ.get("VIRTUAL_AXES_REPORT"):
        return Path(given).resolve()
    page = tmp_path_factory.mktemp("report") / f"{request.param.__name__}.html"
    request.param(page)
    return page


@pytest.fixture(scope="module")
def browser(report: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    """Yields a browser that shows the report."""
    program = find_browser()
    if program is None:
        missing = "no Chromium to open the report in (Debian: apt-get install chromium)"
        if os.environ.get("VIRTUAL_AXES_NEEDS_BROWSER"):
            pytest.fail(missing)
        pytest.skip(missing)
    with Browser(program, tmp_path_factory.mktemp("profile")) as browser:
        browser.show_as()
        show(browser, report)
        yield browser


def show(browser: Browser, page: Path) -> None:
    """Opens a page and waits for its plots."""
    browser.open(page.as_uri())
    wait_for(browser, "document.documentElement.dataset.plotted === 'all'")


def wait_for(browser: Browser, condition: str) -> None:
    """Waits until an expression is true."""
    deadline = time.monotonic() + 60.0
    while not browser.evaluate(condition):
        assert time.monotonic() < deadline, condition
        time.sleep(0.05)


def mouse(browser: Browser, kind: str, x: float, y: float, **more: object) -> None:
    """Sends an event of the mouse."""
    browser.send("Input.dispatchMouseEvent", type=kind, x=x, y=y, **more)


def drag(browser: Browser, start: tuple[float, float], end: tuple[float, float]) -> None:
    """Drags with the left button, in steps."""
    mouse(browser, "mouseMoved", *start)
    mouse(browser, "mousePressed", *start, button="left", buttons=1, clickCount=1)
    for part in np.linspace(0, 1, 8):
        x, y = (1 - part) * np.array(start) + part * np.array(end)
        mouse(browser, "mouseMoved", float(x), float(y), button="left", buttons=1)
    mouse(browser, "mouseReleased", *end, button="left", clickCount=1)


def middle(browser: Browser, element: str) -> tuple[float, float]:
    """Scrolls an element into view and returns its middle."""
    browser.evaluate(f"{element}.scrollIntoView({{block: 'center', behavior: 'instant'}})")
    left, top, width, height = browser.evaluate(
        f"(({{left, top, width, height}}) => [left, top, width, height])({element}.getBoundingClientRect())"
    )
    return left + width / 2, top + height / 2


def press(browser: Browser, text: str) -> None:
    """Presses the control with a text."""
    controls = "[...document.querySelectorAll('.controls button')]"
    browser.evaluate(f"{controls}.find(button => button.textContent === '{text}').click()")


def plots_over(label: str) -> str:
    """Returns an expression for the charts with a label of the horizontal axis."""
    return f"{PLOTS}.filter(plot => plot.layout.xaxis?.title?.text === '{label}')"


def test_there_are_no_errors_and_no_requests(browser: Browser, report: Path):
    """Checks console, exceptions and requests."""
    entries = [event["entry"] for event in browser.events_of("Log.entryAdded")]
    # Messages of the software that draws in place of a graphics processor.
    assert [entry for entry in entries if entry["source"] != "rendering"] == []
    assert not browser.events_of("Runtime.consoleAPICalled", "Runtime.exceptionThrown")
    requests = [event["request"]["url"] for event in browser.events_of("Network.requestWillBeSent")]
    # plotly.js tries whether the browser draws WebP, by a picture in a data URL.
    assert [request for request in requests if not request.startswith("data:")] == [report.as_uri()]
    assert browser.evaluate("document.compatMode") == "CSS1Compat"


def test_the_page_is_small_and_opens_fast(browser: Browser, report: Path):
    """The page has at most 8 MB, and computes at most 2 s until it is loaded with its first figure."""
    assert report.stat().st_size <= MOST_BYTES
    browser.send("Performance.enable", timeDomain="threadTicks")
    browser.open(report.as_uri())
    assert browser.evaluate("document.querySelectorAll('.plot .main-svg').length") > 0
    metrics = {metric["name"]: metric["value"] for metric in browser.send("Performance.getMetrics")["metrics"]}
    browser.send("Performance.disable")
    wait_for(browser, "document.documentElement.dataset.plotted === 'all'")
    assert metrics["TaskDuration"] <= MOST_CPU_TIME, metrics


def test_plots_have_data_and_a_text_alternative(browser: Browser):
    """Each figure is plotted and described."""
    figures = browser.evaluate(f"{PLOTS}.map(plot => [plot.data?.length, plot.getAttribute('aria-label')])")
    assert len(figures) >= 4
    for traces, text in figures:
        assert traces and " from " in text, text


@pytest.mark.parametrize("width", [WIDE, NARROW])
@pytest.mark.parametrize("scheme", [LIGHT, DARK])
def test_plots_are_visible(browser: Browser, report: Path, scheme: str, width: int):
    """The picture is not blank, on a light or a dark background, and the page is not wider than its window."""
    browser.show_as(scheme=scheme, width=width)
    show(browser, report)
    image = browser.screenshot(keep(f"{report.stem}-{scheme}-{width}.png"))
    ground = np.median(image.reshape(-1, 3), axis=0)
    assert (ground.mean() > 0.9) if scheme == LIGHT else (ground.mean() < 0.2)
    drawn = np.abs(image - ground).max(axis=2) > 0.3
    assert 0.005 < drawn.mean() < 0.3
    colored = np.ptp(image, axis=2) > 0.3
    assert colored.mean() > 0.0005, "no colored lines"
    assert browser.evaluate("document.documentElement.scrollWidth") <= width


def test_colors_follow_a_change_of_the_scheme(browser: Browser, report: Path):
    """A page that is open changes its plots with the scheme."""
    browser.show_as(scheme=LIGHT)
    show(browser, report)
    ink = f"{PLOTS}.map(plot => plot.layout.legend.font.color)"
    light = browser.evaluate(ink)
    browser.show_as(scheme=DARK)
    wait_for(browser, f"{ink}[0] !== '{light[0]}'")
    dark = browser.evaluate(ink)
    assert len(set(light)) == 1 and len(set(dark)) == 1
    browser.show_as()


def test_texts_contrast_with_their_background(browser: Browser):
    """4.5 : 1 for text and 3 : 1 for lines, as WCAG 2.1 requires, in both schemes."""
    for scheme in (LIGHT, DARK):
        browser.show_as(scheme=scheme)
        colors = {name: luminance(browser, name) for name in TEXTS + LINES + ["--page", "--area"]}
        for ground in ("--page", "--area"):
            for names, least in ((TEXTS, 4.5), (LINES, 3.0)):
                for name in names:
                    low, high = sorted((colors[name], colors[ground]))
                    assert (high + 0.05) / (low + 0.05) >= least, f"{name} on {ground}, {scheme}"
    browser.show_as()


def test_lines_of_runs_differ_in_color_and_dash(browser: Browser):
    """Each two colors differ by 15 of CIELAB also with a color vision deficiency, and each two dash patterns."""
    for scheme in (LIGHT, DARK):
        browser.show_as(scheme=scheme)
        colors = [linear(browser, f"--run-{i}") for i in range(1, 7)]
        for name, matrix in DEFICIENCIES.items():
            seen = [lab(matrix @ color) for color in colors]
            least = min(np.linalg.norm(a - b) for i, a in enumerate(seen) for b in seen[:i])
            assert least > 15, f"{name}, {scheme}: {least:.1f}"
    dashes = [
        browser.evaluate(f"document.body.className = 'run-{i}', getComputedStyle(document.body).strokeDasharray")
        for i in range(1, 7)
    ]
    browser.evaluate("document.body.className = ''")
    assert len(set(dashes)) == 6, dashes
    browser.show_as()


def test_a_table_that_scrolls_has_a_shadow(browser: Browser, report: Path):
    """The edge where columns are hidden is shaded; after scrolling it is the other edge."""
    for scheme in (LIGHT, DARK):
        browser.show_as(scheme=scheme, width=NARROW)
        show(browser, report)
        wide = "[...document.querySelectorAll('.table')].find(table => table.scrollWidth > table.clientWidth + 40)"
        for scrolled in (False, True):
            browser.evaluate(f"{wide}.scrollLeft = {9999 if scrolled else 0}")
            box = f"(({{left, right, top}}) => [left, right, top + scrollY])({wide}.getBoundingClientRect())"
            left, right, top = browser.evaluate(box)
            row = browser.screenshot()[int(top) + 2]
            ground = np.median(row, axis=0)
            shaded = [np.abs(row[x] - ground).max() > 0.2 for x in (int(left) + 1, int(right) - 2)]
            assert shaded == [scrolled, not scrolled], scheme
    browser.show_as()


def test_captions_remain_in_view(browser: Browser, report: Path):
    """A caption wraps in a narrow window, and stays where it is while its table scrolls."""
    browser.show_as(width=NARROW)
    show(browser, report)
    for scrolled in (0, 9999):
        browser.evaluate(f"document.querySelectorAll('.table').forEach(table => table.scrollLeft = {scrolled})")
        texts = "[...document.querySelectorAll('caption span')].map(text => text.getBoundingClientRect())"
        sides = browser.evaluate(f"{texts}.map(({{left, right}}) => [left, right])")
        assert sides and all(0 <= left < right <= NARROW for left, right in sides)
    browser.show_as()


def test_plots_keep_their_height_in_another_window(browser: Browser, report: Path):
    """A change of the window's width, as by turning a telephone, leaves no plot over the text below it."""
    browser.show_as()
    show(browser, report)
    heights = f"{PLOTS}.map(plot => [plot.clientHeight, plot.querySelector('svg').getBoundingClientRect().height])"
    before = browser.evaluate(heights)
    for width in (900, NARROW):
        browser.show_as(width=width)
        browser.screenshot()
        time.sleep(0.5)
        assert browser.evaluate(heights) == before
    browser.show_as()


def test_charts_over_time_zoom_together(browser: Browser, report: Path):
    """A range that is drawn in one chart is shown in the others; a double click shows all again."""
    if report.stem == "identification":
        pytest.skip("its charts are of different recordings")
    browser.show_as()
    show(browser, report)
    timed = plots_over("Time (s)")
    assert browser.evaluate(f"{timed}.length") >= 3
    x, y = middle(browser, f"{timed}[1].querySelector('.nsewdrag')")
    drag(browser, (x - 100, y), (x + 60, y))
    ranges = browser.evaluate(f"{timed}.map(plot => plot.layout.xaxis.range)")
    low, high = ranges[0]
    assert all(one == ranges[0] for one in ranges) and 0 < low < high
    assert high - low < 0.3 * browser.evaluate(f"Math.max(...{timed}[0].data[0].x)")
    # The same path: positions along it.
    press(browser, "over path")
    along = plots_over("Path position (mm)")
    assert browser.evaluate(f"{along}.length") >= 3
    longest = browser.evaluate(f"Math.max(...{along}[0].data[0].x)")
    path = browser.evaluate("Math.max(...JSON.parse(document.querySelector('figure script').textContent).runs[0].path)")
    assert longest == pytest.approx(path)


def test_the_path_rotates_and_its_hover_names_the_line(browser: Browser, report: Path):
    """The camera follows the mouse and the buttons; a point has time, error, feed, line and text."""
    if report.stem == "identification":
        pytest.skip("no path")
    browser.show_as()
    show(browser, report)
    eye = "(({x, y, z}) => [x, y, z])(document.querySelector('.plot')._fullLayout.scene._scene.getCamera().eye)"
    before = browser.evaluate(eye)
    ticks = "(({xaxis, yaxis, zaxis}) => [xaxis, yaxis, zaxis].map(axis => axis.tickvals.length))"
    assert min(browser.evaluate(f"{ticks}(document.querySelector('.plot').layout.scene)")) >= 2
    x, y = middle(browser, "document.querySelector('.plot canvas')")
    drag(browser, (x - 40, y - 10), (x + 60, y + 20))
    wait_for(browser, f"Math.abs({eye}[0] - {before[0]}) > 0.05")
    press(browser, "Top")
    wait_for(browser, f"{eye}[2] > 2 && Math.abs({eye}[0]) < 0.01")
    note = "({points: [point]}) => hovered.push(point.data.text[point.pointNumber])"
    browser.evaluate(f"window.hovered = []; document.querySelector('.plot').on('plotly_hover', {note})")
    deadline = time.monotonic() + 60.0
    while not browser.evaluate("hovered.length"):
        assert time.monotonic() < deadline, "no point under the mouse"
        for radius in range(0, 160, 4):
            mouse(browser, "mouseMoved", x + radius, y + 0.31 * radius)
            time.sleep(0.05)
            if browser.evaluate("hovered.length"):
                break
    text = browser.evaluate("hovered[0]")
    assert " s, contour error " in text and "µm" in text
    fills = "[...document.querySelectorAll('.hovertext tspan')].map(line => getComputedStyle(line).fill)"
    wait_for(browser, f"{fills}.length > 0")
    assert "none" not in browser.evaluate(fills)
    if report.stem == "part_program":
        assert text.startswith("line ") and "feed " in text and ": N" in text


def test_a_click_on_a_worst_line_shows_its_place(browser: Browser, report: Path):
    """The marker is on the path at the time of the line, and all charts over time have a cursor there."""
    if report.stem != "part_program":
        pytest.skip("no lines")
    browser.show_as()
    show(browser, report)
    worst = "document.querySelector('th button')"
    number, when = browser.evaluate(f"[{worst}.textContent, Number({worst}.dataset.time)]")
    x, y = middle(browser, worst)
    mouse(browser, "mousePressed", x, y, button="left", clickCount=1)
    mouse(browser, "mouseReleased", x, y, button="left", clickCount=1)
    scene = browser.evaluate("document.querySelector('.plot').layout.scene.annotations.map(one => one.text)")
    assert scene == [f"line {number}"]
    place = browser.evaluate("(({x, y, z}) => [x[0], y[0], z[0]])(document.querySelector('.plot').data.at(-1))")
    data = browser.evaluate("JSON.parse(document.querySelector('figure script').textContent).runs[0]")
    nearest = int(np.argmin(np.abs(np.array(data["time"]) - when)))
    assert data["lines"][nearest] == int(number) and data["error"][nearest] == max(data["error"])
    # Row, color and chart have the same error.
    errors = "document.querySelector('th button').closest('tr').querySelector('td.number').textContent"
    assert float(browser.evaluate(errors)) == pytest.approx(data["error"][nearest], abs=0.005)
    chart = browser.evaluate(f"(({{x, y}}) => [x, y])({plots_over('Time (s)')}[0].data[0])")
    assert chart[1][chart[0].index(data["time"][nearest])] == data["error"][nearest]
    assert place == pytest.approx([data["reference"][a][nearest] + data["deviation"][a][nearest] for a in range(3)])
    found = browser.evaluate(f"{plots_over('Time (s)')}.map(plot => plot.layout.shapes.at(-1).x0)")
    assert len(found) >= 3 and found == pytest.approx([when] * len(found), abs=1e-3)
    assert browser.evaluate(f"{worst}.getAttribute('aria-pressed')") == "true"
    assert number in browser.evaluate("document.querySelector('.place').textContent")


def test_the_tool_bar_lies_beside_the_plots(browser: Browser, report: Path):
    """No button of Plotly covers a curve, and no title of a color bar leaves its plot."""
    browser.show_as()
    show(browser, report)
    box = "(({left, right, top, bottom}) => [left, right, top, bottom])"
    bars, areas = (
        browser.evaluate(f"{PLOTS}.map(plot => {box}(plot.querySelector('{part}').getBoundingClientRect()))")
        for part in (".modebar", ".nsewdrag, .gl-container")
    )
    is_space = browser.evaluate(f"{PLOTS}.map(plot => plot.layout.scene !== undefined)")
    for bar, area, has_scene in zip(bars, areas, is_space, strict=True):
        assert has_scene or bar[0] >= area[1] - 1
    titles = "[...document.querySelectorAll('.infolayer .colorbar text')]"
    sides = f"{titles}.map(text => [text, text.closest('svg')].map(one => {box}(one.getBoundingClientRect())))"
    for text, plot in browser.evaluate(sides):
        assert plot[0] <= text[0] and text[1] <= plot[1]


def test_a_run_can_be_hidden(browser: Browser, report: Path):
    """A switch hides the signals of a run in all plots."""
    if report.stem != "comparison":
        pytest.skip("a single run")
    browser.show_as()
    show(browser, report)
    shown = f"{PLOTS}.flatMap(plot => plot.data).filter(trace => trace.meta === 1 && trace.visible).length"
    assert browser.evaluate(shown) > 10
    browser.evaluate("document.querySelector('.runs input[value=\"1\"]').click()")
    assert browser.evaluate(shown) == 0
    browser.evaluate("document.querySelector('.runs input[value=\"1\"]').click()")
    assert browser.evaluate(shown) > 10


def test_texts_of_a_program_are_no_html(browser: Browser, tmp_path: Path):
    """A comment with markup is a text on the page and in its plots."""
    program, page = tmp_path / "markup.nc", tmp_path / "markup.html"
    program.write_text("G61 G1 F2000 X20\nX20 Y20 ; <img src=x onerror=alert(1)></script>\nX0 Y0\nM2\n")
    run("run", program, "--report", page)
    show(browser, page)
    assert browser.evaluate("document.querySelectorAll('img').length") == 0
    assert "<img" in browser.evaluate("document.querySelector('.overview table').textContent")
    texts = browser.evaluate("document.querySelector('.plot').data.flatMap(trace => trace.text)")
    assert any("&lt;img" in text for text in texts) and not any("<img" in text for text in texts)
    assert not browser.events_of("Runtime.exceptionThrown")


def test_it_prints_in_light_colors(browser: Browser, report: Path):
    """Paper is white with every color scheme, and plots fit it."""
    browser.show_as(scheme=DARK, width=A4_WIDTH, media="print")
    show(browser, report)
    image = browser.screenshot(keep(f"{report.stem}-print.png"))
    assert np.median(image.reshape(-1, 3), axis=0).mean() > 0.9
    browser.show_as()
    pdf = browser.pdf()
    if path := keep(f"{report.stem}-print.pdf"):
        path.write_bytes(pdf)
    assert pdf.startswith(b"%PDF") and len(pdf) > 10_000


def test_tables_fit_the_page_with_long_names(browser: Browser, report: Path):
    """All tables fit a screen of 1200 px and a sheet of A4."""
    for width, media in ((1200, ""), (A4_WIDTH, "print")):
        browser.show_as(width=width, media=media)
        show(browser, report)
        assert browser.evaluate(TABLES_CUT_OFF) == [], media
    browser.show_as()


TEXTS = ["--ink", "--muted"]
LINES = [*(f"--run-{i}" for i in range(1, 7)), "--low", "--middle", "--high", "--zero"]


DEFICIENCIES = {
    "full vision": np.eye(3),
    "protanopia": np.array(
        [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]]
    ),
    "deuteranopia": np.array(
        [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]]
    ),
    "tritanopia": np.array(
        [[1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602], [0.004733, 0.691367, 0.303900]]
    ),
}
"""Linear RGB as seen with a color vision deficiency (Machado, Oliveira, Fernandes 2009, severity 1)."""


def linear(browser: Browser, name: str) -> np.ndarray:
    """Returns a color of the style as linear RGB."""
    value = browser.evaluate(f"getComputedStyle(document.documentElement).getPropertyValue('{name}').trim()")
    assert isinstance(value, str) and value.startswith("#") and len(value) == 7, value
    channels = np.array([int(value[i : i + 2], 16) / 255 for i in (1, 3, 5)])
    return np.where(channels <= 0.04045, channels / 12.92, ((channels + 0.055) / 1.055) ** 2.4)


def luminance(browser: Browser, name: str) -> float:
    """Returns the relative luminance of a color of the style (WCAG 2.1)."""
    return float(linear(browser, name) @ [0.2126, 0.7152, 0.0722])


def lab(color: np.ndarray) -> np.ndarray:
    """Returns CIELAB (D65) of linear RGB."""
    to_xyz = [[0.4124564, 0.3575761, 0.1804375], [0.2126729, 0.7151522, 0.0721750], [0.0193339, 0.1191920, 0.9503041]]
    ratios = to_xyz @ np.clip(color, 0, 1) / np.array([0.95047, 1.0, 1.08883])
    x, y, z = np.where(ratios > 216 / 24389, np.cbrt(ratios), (24389 / 27 * ratios + 16) / 116)
    return np.array([116 * y - 16, 500 * (x - y), 200 * (y - z)])


def keep(name: str) -> Path | None:
    """Returns the path for a screenshot, or None without VIRTUAL_AXES_SCREENSHOTS."""
    folder = os.environ.get("VIRTUAL_AXES_SCREENSHOTS")
    return Path(folder, name) if folder else None
