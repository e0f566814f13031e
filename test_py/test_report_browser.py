"""The report in a browser: no errors, no external requests, legible in light, dark and print.

VIRTUAL_AXES_REPORT names a page to look at instead of a new one, VIRTUAL_AXES_SCREENSHOTS a folder
that keeps the pictures.
"""

from __future__ import annotations

import os
import subprocess
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from browser import Browser, find_browser
from node_process import node_binary

LIGHT, DARK = "light", "dark"
WIDE, NARROW = 1280, 360
"""Viewport widths, pixels: a desktop screen, a telephone."""
A4_WIDTH = 703
"""Width of an A4 sheet between margins of 12 mm, pixels of 1/96 inch."""

OVERLAPPING_TEXTS = """
[...document.querySelectorAll('svg[role=img]')].flatMap(svg => {
    const frame = svg.getBoundingClientRect();
    const texts = [...svg.querySelectorAll('text')].map(text => [text.textContent, text.getBoundingClientRect()]);
    const meet = (a, b) => a.left < b.right && b.left < a.right && a.top < b.bottom && b.top < a.bottom;
    const pairs = texts.flatMap(([t, a], i) => texts.slice(i + 1).filter(([, b]) => meet(a, b)).map(([u]) => [t, u]));
    const outside = texts.filter(([, a]) => a.left < frame.left - 1 || a.right > frame.right + 1
        || a.top < frame.top - 1 || a.bottom > frame.bottom + 1).map(([t]) => [t, 'the edge']);
    return [...pairs, ...outside].map(pair => [svg.querySelector('title').textContent, ...pair]);
})
"""
"""Overlapping texts of a picture, and texts outside it."""

TABLES_CUT_OFF = """
[...document.querySelectorAll('.table')].filter(frame => frame.scrollWidth > frame.clientWidth)
    .map(frame => [frame.innerText.slice(0, 40), frame.scrollWidth, frame.clientWidth])
"""
"""Tables that are wider than their container."""


def run(*arguments: object) -> None:
    """Runs the command beside the node."""
    command = [Path(node_binary()).with_name("virtual_axes"), *arguments]
    subprocess.run([str(word) for word in command], check=True, timeout=120, stdout=subprocess.DEVNULL)


def comparison(page: Path) -> None:
    """Writes a page with two runs of the ballbar trial."""
    run("run", "ballbar", "--controller", "cascade", "--controller", "cascade-noff", "--report", page)


def identification(page: Path) -> None:
    """Writes a page with an identification of X from a short campaign."""
    psec, trace = page.with_name("psec.csv"), page.with_name("off.csv")
    run("psec", "campaign", "--axis", "x", "--part", "off", "--range=-40,40", "--max-feed", 5, "--out", psec)
    off = ["--set", "x.feedforward.velocity=0", "--set", "x.feedforward.torque_kg_m2=0"]
    run("run", psec, *off, "--trace", trace)
    run("identify", trace, "--feedforward", "off", "--axis", "x", "--validate", trace, "--report", page)


@pytest.fixture(scope="module", params=[comparison, identification], ids=lambda make: make.__name__)
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
        browser.open(report.as_uri())
        yield browser


def test_there_are_no_errors_and_no_external_requests(browser: Browser, report: Path):
    """Checks console, exceptions and requests."""
    entries = [event["entry"] for event in browser.events_of("Log.entryAdded")]
    assert not entries
    assert not browser.events_of("Runtime.consoleAPICalled", "Runtime.exceptionThrown")
    requests = [event["request"]["url"] for event in browser.events_of("Network.requestWillBeSent")]
    assert requests == [report.as_uri()]
    assert browser.evaluate("document.scripts.length") == 0
    assert browser.evaluate("document.compatMode") == "CSS1Compat"


def test_pictures_are_well_formed(browser: Browser, report: Path):
    """Each picture is XML with title and description, and the browser has as many pictures as the file."""
    text = report.read_text(encoding="utf-8")
    pictures = ["<svg role" + part.split("</svg>")[0] + "</svg>" for part in text.split("<svg role")[1:]]
    assert len(pictures) >= 5
    ids = set()
    for picture in map(ElementTree.fromstring, pictures):
        title, description = picture.find("title"), picture.find("desc")
        assert title is not None and title.text and description is not None and description.text
        assert picture.get("aria-labelledby") == f"{title.get('id')} {description.get('id')}"
        ids |= {title.get("id"), description.get("id")}
    assert len(ids) == 2 * len(pictures)
    assert browser.evaluate("document.querySelectorAll('svg[role=img]').length") == len(pictures)


@pytest.mark.parametrize("width", [WIDE, NARROW])
@pytest.mark.parametrize("scheme", [LIGHT, DARK])
def test_pictures_are_visible(browser: Browser, scheme: str, width: int):
    """The picture is not blank, on a light or a dark background."""
    browser.show_as(scheme=scheme, width=width)
    image = browser.screenshot(keep(f"{scheme}-{width}.png"))
    ground = np.median(image.reshape(-1, 3), axis=0)
    assert (ground.mean() > 0.9) if scheme == LIGHT else (ground.mean() < 0.2)
    drawn = np.abs(image - ground).max(axis=2) > 0.3
    assert 0.005 < drawn.mean() < 0.3
    # No long blank stretch from top to bottom.
    rows = np.flatnonzero(drawn.any(axis=1))
    assert np.diff(rows).max() < 200
    colored = np.ptp(image, axis=2) > 0.3
    assert colored.mean() > 0.0005, "no colored lines"


@pytest.mark.parametrize("width", [WIDE, 700, NARROW])
def test_labels_do_not_overlap(browser: Browser, width: int):
    """No text of a picture overlaps another, and the page is not wider than its window."""
    browser.show_as(width=width)
    assert browser.evaluate(OVERLAPPING_TEXTS) == []
    assert browser.evaluate("document.documentElement.scrollWidth") <= width


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


def test_it_prints_in_light_colors(browser: Browser):
    """Paper is white with every color scheme; no sheet is empty."""
    browser.show_as(scheme=DARK, media="print")
    image = browser.screenshot(keep("print.png"))
    assert np.median(image.reshape(-1, 3), axis=0).mean() > 0.9
    browser.show_as()
    pdf = browser.pdf()
    if path := keep("print.pdf"):
        path.write_bytes(pdf)
    assert pdf.startswith(b"%PDF") and len(pdf) > 10_000


def test_tables_fit_the_page_with_long_names(browser: Browser):
    """All tables fit a screen of 1200 px and a sheet of A4 with any names of the runs."""
    name = ", x.feedforward.torque_kg_m2=0.028"
    browser.evaluate(f"document.querySelectorAll('th.run').forEach(cell => cell.append('{name}'))")
    for width, media in ((1200, ""), (A4_WIDTH, "print")):
        browser.show_as(width=width, media=media)
        assert browser.evaluate(TABLES_CUT_OFF) == [], media
    browser.show_as()


TEXTS = ["--ink", "--muted"]
LINES = [*(f"--run-{i}" for i in range(1, 7)), "--friction", "--gravity", "--load"]


def luminance(browser: Browser, name: str) -> float:
    """Returns the relative luminance of a color of the style (WCAG 2.1)."""
    value = browser.evaluate(f"getComputedStyle(document.documentElement).getPropertyValue('{name}').trim()")
    assert isinstance(value, str) and value.startswith("#") and len(value) == 7, value
    channels = np.array([int(value[i : i + 2], 16) / 255 for i in (1, 3, 5)])
    linear = np.where(channels <= 0.04045, channels / 12.92, ((channels + 0.055) / 1.055) ** 2.4)
    return float(linear @ [0.2126, 0.7152, 0.0722])


def keep(name: str) -> Path | None:
    """Returns the path for a screenshot, or None without VIRTUAL_AXES_SCREENSHOTS."""
    folder = os.environ.get("VIRTUAL_AXES_SCREENSHOTS")
    return Path(folder, name) if folder else None
