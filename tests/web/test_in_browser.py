"""The page in a Chromium: the whole way by mouse and by keyboard, and what axe-core finds."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from tests.bench.browsing import faults_of, opened
from tests.web.test_runs import wait

LOOKS = [(1280, "light"), (320, "dark"), (1280, "dark"), (320, "light")]


@contextmanager
def page_of(folder: Path, stop: signal.Signals = signal.SIGINT) -> Iterator[str]:
    """Serve the page as a double click does, but without a browser; give its first address."""
    words = "from virtual_lab.__main__ import main_of_page; main_of_page()"
    command = [sys.executable, "-c", words, str(folder), "--no-browser"]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as server:
        assert server.stderr
        try:
            address = re.search(r"http\S+", server.stderr.readline())
            assert address
            yield address[0]
        finally:
            server.send_signal(stop)
            assert server.wait(20) == 128 + stop


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    with opened() as browser:
        yield browser


def look(browser: Any, page: Any, paths: list[str]) -> list[str]:
    """Return what axe-core finds on pages, at two widths, light and dark."""
    found = []
    start = re.match(r"http://[^/]*", page.url)[0]
    for width, theme in LOOKS:
        size = {"width": width, "height": 900}
        context = browser.new_context(viewport=size, color_scheme=theme, reduced_motion="reduce")
        context.add_cookies(page.context.cookies())
        shown = context.new_page()
        for path in paths:
            shown.goto(start + path)
            for details in shown.query_selector_all("details"):
                details.evaluate("each => { each.open = true; }")
            found += [(path, width, theme, fault) for fault in faults_of(shown)]
        context.close()
    return found


def test_a_coach_by_mouse(browser: Any, tmp_path: Path) -> None:
    """From the start page to the certificate, its score, and back; the page holds no error."""
    complaints: list[str] = []
    with page_of(tmp_path / "lab") as address:
        page = browser.new_page()
        page.set_default_timeout(120_000)
        page.on("pageerror", lambda fault: complaints.append(str(fault)))
        page.on("console", lambda line: complaints.append(line.text) * (line.type == "error"))
        page.goto(address)
        assert "token" not in page.url
        page.click("text=Does this bat pass?")
        page.get_by_label("Bat (needed)", exact=True).select_option(
            label="EA70, aluminum, 34 in, 31 oz (ea70)"
        )
        page.select_option("[name=procedure]", "bbcor")
        page.get_by_role("button", name="Run").click()
        page.wait_for_selector("iframe")
        assert page.inner_text("h1").startswith("FAIL: e 0.")
        height = page.evaluate("document.querySelector('iframe').offsetHeight")
        frame = page.frames[1]
        assert height >= frame.evaluate("document.documentElement.scrollHeight")
        page.click("text=Compare it with the truth")
        page.click("button.main")
        page.wait_for_selector(".answer:has-text('from the truth')")
        assert "95 % interval" in page.inner_text("h1")
        page.click("text=All questions")
        assert page.inner_text(".runs").count("\n") >= 1
        paths = ["/", "/run/1", "/run/2", "/form/certify", "/form/track", "/form/sweep"]
        assert look(browser, page, paths) == []
        page.close()
    assert complaints == []


def test_a_rule_maker_by_keyboard(browser: Any, tmp_path: Path) -> None:
    """A refused number has the focus and its sentence; then the run, which survives a kill."""
    with page_of(tmp_path / "lab", signal.SIGTERM) as address:
        page = browser.new_page()
        page.set_default_timeout(120_000)
        page.goto(address)
        page.focus("text=Who passes by chance?")
        with page.expect_navigation():
            page.keyboard.press("Enter")
        page.focus("[name=laboratories]")
        page.keyboard.press("Control+a")
        page.keyboard.type("many")
        with page.expect_navigation():
            page.keyboard.press("Enter")
        focused = "document.activeElement.getAttribute('name')"
        page.wait_for_function(f"{focused} === 'laboratories'")
        words = page.evaluate("document.activeElement.getAttribute('aria-describedby').split(' ')")
        sentences = [page.inner_text(f"#{each}") for each in words]
        assert "“many” cannot be used" in sentences[-1]
        assert look(browser, page, []) == []
        assert faults_of(page) == []
        page.keyboard.press("Control+a")
        page.keyboard.type("20")
        with page.expect_navigation():
            page.keyboard.press("Enter")
        page.wait_for_selector(".answer:has-text('With a true BPF of')")
        page.focus("text=Change and run again")
        with page.expect_navigation():
            page.keyboard.press("Enter")
        assert page.input_value("[name=laboratories]") == "20"
        page.fill("[name=laboratories]", "1000000")
        page.click("button.main")
        page.wait_for_selector("[data-progress]")
        page.close()
    if os.name == "posix":
        wait(lambda: "worker run 2" not in subprocess.getoutput("ps -eo args"))
