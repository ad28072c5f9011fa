"""The page in a Chromium: the whole way by mouse and by keyboard, and what axe-core finds."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pandas as pd
import pytest

import virtual_lab as vl
from tests.bench.browsing import faults_of, opened
from tests.web.test_runs import wait
from tests.web.visiting import clip_of

LOOKS = [(1280, "light"), (320, "dark")]
WHOLE = "document.querySelector('iframe').contentDocument.documentElement"


@contextmanager
def page_of(folder: Path) -> Iterator[str]:
    """Serve the page as a double click does, but without a browser; give its first address.

    A program without a window of text has no output on Windows.
    """
    words = "import sys; sys.stdout = None; "
    words += "from virtual_lab.__main__ import main_of_page; main_of_page()"
    command = [sys.executable, "-c", words, str(folder), "--no-browser"]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as server:
        assert server.stderr
        try:
            address = re.search(r"http\S+", server.stderr.readline())
            assert address
            yield address[0]
        finally:
            server.terminate()
            assert server.wait(20) == 128 + signal.SIGTERM


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("page") / "lab"


@pytest.fixture(scope="module")
def page(folder: Path) -> Iterator[Any]:
    """Open the start page in a browser. No page has an error, and a kill also ends a run."""
    complaints: list[str] = []
    with opened() as browser, page_of(folder) as address:
        page = browser.new_page(viewport={"width": 1280, "height": 900})
        page.set_default_timeout(120_000)
        page.on("pageerror", lambda fault: complaints.append(str(fault)))
        page.goto(address)
        assert "token" not in page.url
        yield page
        page.goto(home(page) + "/form/operating?laboratories=1000000")
        page.click("button.main")
        page.wait_for_selector("[data-progress]")
        run = f"worker run {page.url.rpartition('/')[2]}"
        wait(lambda: os.name != "posix" or run in subprocess.getoutput("ps -eo args"))
    wait(lambda: os.name != "posix" or run not in subprocess.getoutput("ps -eo args"))
    assert complaints == []


def home(page: Any) -> str:
    return re.match(r"http://[^/]*", page.url)[0]


def look(page: Any, *paths: str) -> list[Any]:
    """Return the findings of axe-core on pages, at two widths, light and dark."""
    found = []
    for width, theme in LOOKS:
        size = {"width": width, "height": 900}
        context = page.context.browser.new_context(
            viewport=size, color_scheme=theme, reduced_motion="reduce"
        )
        context.add_cookies(page.context.cookies())
        shown = context.new_page()
        for path in paths:
            shown.goto(home(page) + path)
            shown.wait_for_load_state("networkidle")
            for details in shown.query_selector_all("details"):
                details.evaluate("each => { each.open = true; }")
            found += [(path, width, theme, fault) for fault in faults_of(shown)]
            if shown.query_selector("iframe"):  # no part of the certificate is cut off
                cut = shown.evaluate(
                    f"document.querySelector('iframe').offsetHeight < {WHOLE}.scrollHeight"
                    f" || {WHOLE}.scrollWidth > {WHOLE}.clientWidth"
                )
                found += [(path, width, "cut off")] if cut else []
        context.close()
    return found


def test_a_coach_by_mouse(page: Any) -> None:
    """From the start page to the certificate, its score, and back."""
    page.click("text=Does this bat pass?")
    page.select_option("[name=bat]", label="EA70, aluminum, 34 in, 31 oz (ea70)")
    page.select_option("[name=procedure]", "bbcor")
    page.get_by_role("button", name="Run").click()
    page.wait_for_selector("iframe")
    assert page.inner_text("h1").startswith("FAIL: e 0.")
    assert page.locator("[href*='/form/report?']").count() == 0  # there is only one
    result = page.url.removeprefix(home(page))
    page.click("text=How far from the truth")
    assert page.input_value("[name=folder]").endswith("ea70-bbcor")
    page.click("text=All questions")
    assert "FAIL: e 0." in page.inner_text(".runs")
    assert look(page, "/", result, "/form/sweep") == []


def test_a_rule_maker_by_keyboard(page: Any) -> None:
    """A refused number has the focus and its sentence; then the run, and a change of it."""
    page.goto(home(page))
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
    assert faults_of(page) == []
    page.keyboard.press("Control+a")
    page.keyboard.type("20")
    with page.expect_navigation():
        page.keyboard.press("Enter")
    page.wait_for_selector(".answer:has-text('passes one test')")
    page.focus("text=Change and run again")
    with page.expect_navigation():
        page.keyboard.press("Enter")
    assert page.input_value("[name=laboratories]") == "20"


def shows(page: Any, frame: int) -> None:
    """Wait until the page shows a frame of the clip."""
    page.wait_for_selector(f"img[alt='Frame {frame} of the clip']")


def at(page: Any, x: float, y: float) -> tuple[float, float]:
    """Return the point of the window at which the page shows a point of the clip."""
    box = page.locator(".stage").bounding_box()
    scale = box["width"] / 320
    return box["x"] + scale * (x + 0.5), box["y"] + scale * (y + 0.5)


def drag(page: Any, *points: tuple[float, float]) -> None:
    """Press the mouse at the first point of the clip, and release it at the last one."""
    page.locator(".stage").scroll_into_view_if_needed()
    page.mouse.move(*at(page, *points[0]))
    page.mouse.down()
    for point in points[1:]:
        page.mouse.move(*at(page, *point), steps=3)
    page.mouse.up()


def values(page: Any, name: str) -> list[float]:
    return [float(each) for each in re.findall(r"[\d.]+", page.input_value(f"[name={name}]"))]


@pytest.fixture(scope="module")
def student(page: Any, folder: Path, tmp_path_factory: pytest.TempPathFactory) -> str:
    """Upload a clip, show the ball, a length, a region and the frames; return the result's path."""
    page.goto(home(page))
    page.click("text=How fast is the ball in my clip?")
    clip = clip_of(tmp_path_factory.mktemp("clip") / "a.avi")
    page.set_input_files(".upload input:not([webkitdirectory])", clip)
    shows(page, 0)
    for _ in range(3):
        page.click("[aria-label='Next frame']")
    shows(page, 3)
    drag(page, (100, 70))
    assert values(page, "ball_at") == [100, 70, 3]
    page.fill("[name=ball]", "73")
    page.click("button.main")
    page.wait_for_selector("[name=ball][aria-invalid]:focus")
    shows(page, 3)  # the frame is kept
    assert page.locator("#f-ball-list [value^=baseball]").count() == 1
    page.fill("[name=ball]", "")
    page.check("[value=scale]")
    drag(page, (40, 20), (240, 20))
    page.fill("[data-length]", "100 cm")
    assert values(page, "scale") == [40, 20, 240, 20, 100]
    page.check("[value=region]")
    drag(page, (200, 230), (10, 20), (2, 3))
    assert values(page, "region") == [2, 3, 198, 227]
    page.focus(".stage")  # two corners by keyboard: the cross is at the last point
    for key in ("Enter", *["ArrowRight"] * 38, *["ArrowDown"] * 28, "Shift+ArrowDown", "Enter"):
        page.keyboard.press(key)
    assert values(page, "region") == [2, 3, 304, 225]
    page.click("text=First frame to use")
    assert values(page, "frames") == [3, 11]
    page.click("[aria-label='Previous frame']")
    page.click("text=Last frame to use")  # before the first one, which is then the clip's first
    assert values(page, "frames") == [0, 2]
    page.focus(".clip [type=range]")
    page.keyboard.press("End")
    page.click("text=Last frame to use")
    assert "11 of 11, used: 0 to 11" in page.inner_text(".clip output")
    assert faults_of(page) == []
    page.fill("[name=ball]", "100mm")
    page.click("button.main")
    page.wait_for_selector(".answer:has-text('Fastest')")
    return str(page.url.removeprefix(home(page)))


def test_a_track_is_corrected_on_its_page(page: Any, student: str, folder: Path) -> None:
    """By mouse and keyboard; the run is the same as with a file that was corrected by hand."""
    table = folder / "a-track" / "track.csv"
    rows = pd.read_csv(table).assign(drift_x_px=5.0)  # as of a camera that moved before
    rows.to_csv(table, index=False)
    page.goto(home(page) + student)
    shows(page, 0)
    again = page.get_by_role("button", name="Run again")
    assert again.is_disabled()
    page.focus(".stage")
    for key in ("PageDown", "Delete", "PageDown", "Shift+ArrowRight", "Shift+ArrowUp", "Enter"):
        page.keyboard.press(key)
    status = page.locator(".clip [role=status]")
    place = ", ".join(f"{rows[f'{axis}_px'][2] + move:.1f}" for axis, move in (("x", 6), ("y", -1)))
    assert status.inner_text() == f"Frame 2: the ball at {place} px, flight 1"
    page.click("[aria-label='Previous frame']")
    assert status.inner_text() == "Frame 1: no position"
    page.focus(".clip [type=range]")
    page.keyboard.press("End")
    shows(page, 11)
    drag(page, (262, 190))
    assert status.inner_text() == "Frame 11: the ball at 262.0, 190.0 px, flight 1"
    page.click("text=Remove this position")
    assert status.inner_text() == "Frame 11: no position"
    drag(page, (261, 191))
    page.fill("[data-flight]", "")
    assert status.inner_text() == "Frame 11: the ball at 261.0, 191.0 px, outside flights"
    page.fill("[data-flight]", "1")
    assert look(page, student) == []
    again.click()
    page.wait_for_url(lambda url: url != home(page) + student)
    page.wait_for_selector(".answer:has-text('Fastest')")
    rows.loc[2, ["x_px", "y_px"]] += [1.0, -1.0]
    rows.loc[11, ["x_px", "y_px"]] = [256.0, 191.0]
    rows.drop(index=1).to_csv(folder / "by-hand.csv", index=False)
    clip = folder / "uploads" / "a.avi"
    by_hand = vl.track(
        clip, ball="100mm", scale="40,20:240,20=100cm", corrected=folder / "by-hand.csv",
        region="2,3,304,225", frames="0:11", ball_at="100,70@3",
    )  # fmt: skip
    document = json.loads((folder / "a-track-2" / "result.json").read_text())
    for name in ("speed_in_m_per_s", "speed_out_m_per_s", "acceleration_m_per_s2"):
        (flight,), (expected,) = document["flights"], by_hand.document["flights"]
        assert flight[name] == pytest.approx(expected[name], rel=1e-3)


def test_a_track_without_a_position_gets_its_first_one(
    page: Any, student: str, folder: Path
) -> None:
    """Of the size and flight beside the picture; the drawn circle shows the size."""
    table = folder / "a-track" / "track.csv"
    found = table.read_text()
    table.write_text(found.partition("\n")[0])
    page.goto(home(page) + student)
    shows(page, 0)
    assert page.locator(".clip [role=status]").inner_text() == "Frame 0: no position"
    page.fill("[data-radius]", "12.5")
    assert page.locator(".stage circle").get_attribute("r") == "12.5"
    drag(page, (41, 61))
    page.get_by_role("button", name="Run again").click()
    page.wait_for_url(lambda url: url != home(page) + student)
    table.write_text(found)
    first = pd.read_csv(folder / "uploads" / "a.avi-corrected-2.csv")
    written = ["frame", "x_px", "y_px", "radius_px", "flight", "drift_x_px", "drift_y_px"]
    assert first[written].values.tolist() == [[0, 41, 61, 12.5, 1, 0, 0]]
