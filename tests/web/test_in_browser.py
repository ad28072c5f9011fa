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
from tests.web.visiting import clip_of

LOOKS = [(1280, "light"), (320, "dark"), (1280, "dark"), (320, "light")]
PIXEL = """async ([x, y]) => {
  const [image, canvas] = [document.querySelector('.stage img'), document.createElement('canvas')];
  await image.decode();
  [canvas.width, canvas.height] = [image.naturalWidth, image.naturalHeight];
  canvas.getContext('2d').drawImage(image, 0, 0);
  return [...canvas.getContext('2d').getImageData(x, y, 1, 1).data];
}"""


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
    """Return the findings of axe-core on pages, at two widths, light and dark."""
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


def test_a_student_shows_the_ball_in_a_clip(browser: Any, tmp_path: Path) -> None:
    """The clip is uploaded; then a click, two corners, keys, and the frames to use."""
    with page_of(tmp_path / "lab") as address:
        page = browser.new_page(viewport={"width": 1280, "height": 900})
        page.goto(address)
        page.click("text=How fast is the ball in my clip?")
        page.set_input_files(".upload input:not([webkitdirectory])", clip_of(tmp_path / "a.avi"))
        page.wait_for_selector(".stage img[src]")
        slide, stage = page.locator(".clip [type=range]"), page.locator(".stage")
        slide.focus()
        for _ in range(3):
            page.keyboard.press("ArrowRight")
        page.wait_for_selector("img[alt='Frame 3 of the clip']")
        green = page.evaluate(PIXEL, [100, 120])  # where frame 3 has the ball
        assert green[1] > green[0] + 100
        box = stage.bounding_box()
        scale = box["width"] / 320
        stage.click(position={"x": 100 * scale, "y": 120 * scale})
        x, y, frame = map(int, re.split("[,@]", page.input_value("[name=ball_at]")))
        assert (abs(x - 100) <= 1, abs(y - 120) <= 1, frame) == (True, True, 3)
        page.check("[value=region]")
        stage.click(position={"x": 20 * scale, "y": 40 * scale})
        for key in ("ArrowRight", "Shift+ArrowDown", "Enter"):
            page.keyboard.press(key)
        x, y, wide, high = map(int, page.input_value("[name=region]").split(","))
        assert (abs(x - 20) <= 1, abs(y - 40) <= 1, wide, high) == (True, True, 8, 1)
        page.click("text=Last frame to use")
        assert page.input_value("[name=frames]") == "0:3"
        assert "0:3" in page.inner_text(".clip [role=status]")
        assert faults_of(page) == []
        page.close()
