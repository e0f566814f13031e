"""The documentation site in a browser, from files: no requests to a network, no overflow, a search that finds.

VIRTUAL_AXES_SITE names a folder with a built site instead of .build/docs/html of tools/build_docs.sh.
"""

from __future__ import annotations

import os
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from browser import Browser, find_browser

pytestmark = pytest.mark.extended

SITE = Path(os.environ.get("VIRTUAL_AXES_SITE") or Path(__file__).resolve().parent.parent / ".build/docs/html")
VIEWS = [(scheme, width) for scheme in ("light", "dark") for width in (1280, 390)]
"""Color schemes, and the widths in pixels of a desktop screen and a telephone."""
TIMEOUT = 30.0
"""Timeout of a search, s."""

LOW_CONTRAST = """
(() => {
    const parse = color => color.match(/[\\d.]+/g).map(Number);
    const light = ([r, g, b]) => [r, g, b].map(v => v / 255)
        .map(v => v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4)
        .reduce((sum, v, i) => sum + v * [0.2126, 0.7152, 0.0722][i], 0);
    const ground = element => {
        for (; element; element = element.parentElement) {
            const color = parse(getComputedStyle(element).backgroundColor);
            if (color.length === 3 || color[3] === 1) return color;
        }
        return [255, 255, 255];
    };
    const ratio = element => {
        const [a, b] = [parse(getComputedStyle(element).color), ground(element)].map(light).sort((a, b) => b - a);
        return (a + 0.05) / (b + 0.05);
    };
    return [...document.querySelectorAll('article :is(p, li, td, th, h1, h2, h3, a:not(.headerlink), code)')]
        .filter(element => element.innerText.trim() && ratio(element) < 4.5)
        .map(element => [element.tagName, element.innerText.slice(0, 40), ratio(element)]);
})()
"""
"""Texts of a page with a contrast below 4.5."""

OVERFLOW = """
Math.max(...[document.documentElement, ...document.querySelectorAll('body, .page, .main, .content')]
    .map(element => element.scrollWidth - element.clientWidth))
"""
"""Pixels by which a page, or the column of its text, is too wide; tables and code scroll inside."""

EXCERPTS = """
[...document.querySelectorAll('#search-results li:not(.kind-object)')]
    .map(item => [item.querySelector('a').href, item.querySelector('p')?.innerText ?? ''])
"""
"""Links of the results of a search, with their excerpts."""

COPIED = """
(() => {
    const copied = [];
    document.execCommand = () => copied.push(document.querySelector('textarea').value);
    for (const button of document.querySelectorAll('button.copybtn')) button.click();
    return copied;
})()
"""
"""Texts that the buttons of a page copy."""

PAGES = sorted(SITE.rglob("*.html"))


@pytest.fixture(scope="module")
def browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    """Returns the browser."""
    program = find_browser()
    if program is None:
        assert not os.environ.get("VIRTUAL_AXES_NEEDS_BROWSER"), "no Chromium: apt-get install chromium"
        pytest.skip("no Chromium")
    with Browser(program, tmp_path_factory.mktemp("profile")) as browser:
        yield browser


@pytest.fixture(autouse=True)
def site() -> None:
    """Skips without a site, which ./test.sh has built."""
    if not PAGES:
        assert not os.environ.get("VIRTUAL_AXES_NEEDS_BROWSER"), f"no site in {SITE}"
        pytest.skip(f"no site in {SITE}: tools/build_docs.sh")


def external_requests(browser: Browser) -> list[str]:
    """Returns the addresses that the page has requested and that are not files."""
    urls = [event["request"]["url"] for event in browser.events_of("Network.requestWillBeSent")]
    return [url for url in urls if not url.startswith(("file:", "data:"))]


@pytest.mark.parametrize(("scheme", "width"), VIEWS)
def test_pages_fit_and_are_legible(browser: Browser, scheme: str, width: int):
    browser.show_as(scheme=scheme, width=width)
    faults = {}
    for page in PAGES:
        browser.open(page.as_uri())
        beyond = browser.evaluate(OVERFLOW)
        faint = browser.evaluate(LOW_CONTRAST)
        requests = external_requests(browser)
        if beyond > 0 or faint or requests:
            faults[str(page.relative_to(SITE))] = (beyond, faint[:3], requests)
    assert not faults


def test_the_search_finds_a_page_with_an_excerpt_without_network(browser: Browser):
    browser.show_as()
    browser.open((SITE / "search.html").as_uri() + "?q=troubleshooting")
    deadline = time.monotonic() + TIMEOUT
    found: list[list[str]] = []
    while not (found and all(excerpt for _, excerpt in found)) and time.monotonic() < deadline:
        found = browser.evaluate(EXCERPTS)
        time.sleep(0.1)
    assert any("troubleshooting.html" in link for link, _ in found), found
    assert any("troubleshooting" in excerpt.lower() for _, excerpt in found), found
    assert not external_requests(browser)


def test_commands_are_copied_without_prompts_and_output(browser: Browser):
    browser.show_as()
    browser.open((SITE / "tutorials/first-run.html").as_uri())
    copied = browser.evaluate(COPIED)
    assert "mkdir -p ~/axes && cd ~/axes" in copied
    assert any(text.startswith("virtual_axes run ballbar") and "µm" not in text for text in copied)


def test_equations_are_typeset_without_script(browser: Browser):
    browser.show_as()
    browser.open((SITE / "explanation/model.html").as_uri())
    sizes = browser.evaluate(
        "[...document.querySelectorAll('div.math mfrac')].map(one => one.getBoundingClientRect().height)"
    )
    # A fraction is higher than a line of text: the browser draws MathML.
    assert len(sizes) > 10 and min(sizes) > 16
