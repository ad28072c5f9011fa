"""The page in a Chromium: the whole way by mouse and by keyboard, and what axe-core finds."""

from __future__ import annotations

import json
import re
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import pandas as pd
import pytest

from tests.bench.browsing import faults_of, opened
from tests.web.test_runs import wait
from tests.web.visiting import clip_of

NONE = "no position; a click adds one of this flight and radius"
WRITTEN = ["frame", "x_px", "y_px", "radius_px", "flight", "drift_x_px", "drift_y_px"]
LOOKS = [(320, "dark"), (1280, "light")]
# whether a part of a certificate is cut off
CUT = """frame => { const whole = frame.contentDocument.documentElement;
return frame.offsetHeight < whole.scrollHeight || whole.scrollWidth > whole.clientWidth; }"""

# whether the cross is in the part of the picture that is shown
IN_VIEW = """[one(".stage path"), one(".view")].map(each => each.getBoundingClientRect())
.reduce((cross, view) => view.left <= cross.left && cross.right <= view.right)"""

# whether the browser asks before the page is left
ASKS = "() => !dispatchEvent(new Event('beforeunload', {cancelable: true}))"
# the number of prints of the certificate alone
COUNT_PRINTS = """() => { prints = 0;
one("iframe").contentWindow.addEventListener("beforeprint", () => prints++); }"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("page") / "lab"


@pytest.fixture(scope="module")
def page(folder: Path) -> Iterator[Any]:
    """Serve the page as a double click does, and open it. No page has an error or asks a question.

    A program without a window of text has no output on Windows. A kill also ends a run.
    """
    words = "import sys; sys.stdout = None; from virtual_lab.__main__ import main_of_page as run;"
    command = [sys.executable, "-c", f"{words} run()", str(folder), "--no-browser"]
    complaints: list[str] = []
    with opened() as browser, subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as run:
        try:
            address = re.search(r"http\S+", run.stderr.readline())[0]
            page = browser.new_page(base_url=address, viewport={"width": 1280, "height": 900})
            page.set_default_timeout(120_000)
            page.on("pageerror", lambda fault: complaints.append(str(fault)))
            page.on("dialog", lambda asked: (complaints.append(asked.type), asked.accept()))
            page.goto(address)
            assert "token" not in page.url
            yield page
            page.goto("/form/operating?laboratories=1000000")
            page.click("button.main")
            page.wait_for_selector("[data-progress]")
            worker = f"worker run {page.url.rpartition('/')[2]}"
            wait(lambda: worker in subprocess.getoutput("ps -eo args"))
        finally:
            run.terminate()
            assert run.wait(20) == 128 + signal.SIGTERM
    wait(lambda: worker not in subprocess.getoutput("ps -eo args"))
    assert complaints == []


def look(page: Any, *paths: str, shown: str = "main") -> list[Any]:
    """Return the findings of axe-core on pages, at two widths, light and dark.

    `shown` selects an element that the script of the page makes after it was loaded.
    """
    found: list[Any] = []
    for width, theme in LOOKS:
        page.set_viewport_size({"width": width, "height": 900})
        page.emulate_media(color_scheme=theme, reduced_motion="reduce")
        for path in paths:
            page.goto(path)
            page.wait_for_selector(shown)
            page.eval_on_selector_all("details", "all => all.forEach(each => each.open = true)")
            found += [(path, width, theme, fault) for fault in faults_of(page)]
            frames = page.query_selector_all("iframe")
            found += [(path, width, "cut off") for frame in frames if frame.evaluate(CUT)]
    return found


def press(page: Any, selector: str, *keys: str) -> None:
    page.focus(selector)
    for key in keys:
        page.keyboard.press(key)


def enter(page: Any, selector: str, *keys: str) -> None:
    """Press keys and Enter on an element, which leads to another page."""
    with page.expect_navigation():
        press(page, selector, *keys, "Enter")


def a_file_that_is_not_stored_holds_a_form_back(page: Any) -> None:
    """While it is sent; and once after it was refused, with the reason, also if it is folded."""
    held: dict[str, Any] = {}
    page.route("**/upload?*", lambda route: held.update(upload=route))
    page.click("summary")
    half = {"name": "half.zip", "mimeType": "application/zip", "buffer": b"half"}
    with page.expect_request("**/upload?*"):
        page.set_input_files("[data-for=f-laboratory] input", half)
    page.click("button.main")
    assert page.evaluate("document.activeElement.validationMessage").startswith("Wait until half")
    held["upload"].continue_()
    said = page.inner_text("[data-for=f-laboratory] .fault")
    assert said.startswith("half.zip: This zip file cannot be unpacked.")
    page.click("summary")
    page.click("button.main")
    assert page.evaluate("document.activeElement.type") == "file"
    page.unroute("**/upload?*")


def a_certificate_is_printed_alone(page: Any) -> None:
    """By the button and by Ctrl-P; by the menu of the browser its text, without the page."""
    for place, key in (("[data-print]", "Shift"), ("h1", "Control+p"), ("iframe", "Control+p")):
        page.reload()  # a browser without a window has one print per page
        page.evaluate(COUNT_PRINTS)
        page.click(place)
        page.keyboard.press(key)
        assert page.evaluate("prints") == 1
    page.emulate_media(media="print")
    printed = page.inner_text("body").strip()
    assert page.locator("iframe").is_hidden()
    assert "Results stay" not in printed
    assert printed.rpartition("\n")[2].startswith("  sealed: ")
    page.emulate_media(media="screen")


def test_a_coach_by_mouse(page: Any) -> None:
    """From the start page to the certificate, its score, and back."""
    page.click("text=Does this bat pass?")
    page.select_option("[name=bat]", label="EA70, aluminum, 34 in, 31 oz (ea70)")
    page.select_option("[name=procedure]", "bbcor")
    a_file_that_is_not_stored_holds_a_form_back(page)
    page.get_by_role("button", name="Run").click()
    page.wait_for_selector("iframe")
    assert page.inner_text("h1").startswith("FAIL: e 0.")
    assert page.locator("[href*='/form/report?']").count() == 0  # there is only one
    a_certificate_is_printed_alone(page)
    result = urlsplit(page.url).path
    page.click("text=How far from the truth")
    assert page.input_value("[name=folder]").endswith("ea70-bbcor")
    page.click("text=All questions")
    assert "FAIL: e 0." in page.inner_text(".runs")
    assert look(page, "/", result, "/form/sweep") == []


def test_a_rule_maker_by_keyboard(page: Any) -> None:
    """A refused number has the focus and its sentence; then the run, its form, and its plot."""
    page.goto("/")
    enter(page, "text=Who passes by chance?")
    enter(page, "[name=laboratories]", "Control+a", *"many")
    page.wait_for_selector("[name=laboratories]:focus")
    words = page.get_attribute(":focus", "aria-describedby").split(" ")
    assert "“many” cannot be used" in page.inner_text(f"#{words[-1]}")
    assert faults_of(page) == []
    assert "?all=yes&" in page.url  # a way back to this page asks for it and sends nothing
    enter(page, ":focus", "Control+a", *"20")
    page.wait_for_selector(".answer:has-text('passes one test')")
    page.go_back()
    assert page.input_value("[name=laboratories]") == "20"
    page.go_forward()
    with page.expect_popup() as plot:
        press(page, "figure a", "Enter")
    assert plot.value.eval_on_selector("img", "each => each.naturalWidth") > 640
    plot.value.close()
    enter(page, "text=Change and run again")
    assert page.input_value("[name=laboratories]") == "20"


def test_the_last_upload_is_the_first_choice(page: Any) -> None:
    page.goto("/form/calibrate")
    for name in ("a.png", "b.png"):
        file = {"name": name, "mimeType": "image/png", "buffer": b"picture"}
        page.set_input_files("[data-for=f-pictures] input:not([webkitdirectory])", file)
        page.wait_for_selector(f".choices label:first-child:has-text('{name}') :checked")


def shows(page: Any, frame: int) -> None:
    """Wait until the page shows a frame of the clip."""
    page.wait_for_selector(f"img[alt='Frame {frame} of the clip']")


def drag(page: Any, *points: tuple[float, float]) -> None:
    """Press the mouse at the first point of the clip, and release it at the last one."""
    stage = page.locator(".stage")
    stage.scroll_into_view_if_needed()
    box = stage.bounding_box()
    scale = box["width"] / 320
    for x, y in points:
        page.mouse.move(box["x"] + scale * (x + 0.5), box["y"] + scale * (y + 0.5), steps=3)
        if (x, y) == points[0]:
            page.mouse.down()
    page.mouse.up()


def values(page: Any, name: str) -> list[float]:
    return [float(each) for each in re.findall(r"[\d.]+", page.input_value(f"[name={name}]"))]


@pytest.fixture(scope="module")
def student(page: Any, tmp_path_factory: pytest.TempPathFactory) -> str:
    """Upload a clip, show the ball, a length, a region and the frames; return the result's path."""
    page.goto("/")
    page.click("text=How fast is the ball in my clip?")
    clip = clip_of(tmp_path_factory.mktemp("clip") / "a.avi")
    page.set_input_files(".upload input:not([webkitdirectory])", clip)
    shows(page, 0)
    for _ in range(3):
        page.click("[aria-label='Next frame']")
    shows(page, 3)
    clear = page.get_by_role("button", name="Clear: The ball in one frame")
    assert clear.count() == 0  # hidden, and so without a role
    drag(page, (100, 70))
    clear.click()
    assert values(page, "ball_at") == []
    page.keyboard.press("Control+z")
    assert values(page, "ball_at") == [100, 70, 3]
    page.fill("[name=ball]", "73")
    page.click("button.main")
    page.wait_for_selector("[name=ball][aria-invalid]:focus")
    shows(page, 3)  # the frame is kept, and the field is in view below it
    box = page.locator("[name=ball]").bounding_box()
    assert 0 < box["y"] < 900 - box["height"]
    assert page.locator("#f-ball-list [value^=baseball]").count() == 1
    page.check("[value=scale]")
    drag(page, (40, 20), (240, 20))
    page.fill("[data-length]", "100 cm")
    assert values(page, "scale") == [40, 20, 240, 20, 100]
    page.check("[value=region]")
    drag(page, (200, 230), (10, 20), (2, 3))
    assert values(page, "region") == [2, 3, 198, 227]
    # two corners by keyboard: the cross is at the last point
    press(page, ".stage", "Enter")
    page.click("text=Undo")  # the first corner alone, which states nothing
    page.keyboard.press("Shift+ArrowLeft")
    page.keyboard.press("Shift+ArrowRight")
    assert values(page, "region") == [2, 3, 198, 227]
    far = *["ArrowRight"] * 38, *["ArrowDown"] * 28, "Shift+ArrowDown"
    press(page, ".stage", "Enter", *far, "Enter")
    assert values(page, "region") == [2, 3, 304, 225]
    page.click("text=First frame to use")
    assert values(page, "frames") == [3, 11]
    page.click("[aria-label='Previous frame']")
    page.click("text=Last frame to use")  # before the first one, which is then the clip's first
    assert values(page, "frames") == [0, 2]
    press(page, ".clip [type=range]", "End")
    page.click("text=Last frame to use")
    assert "11 of 11, used: 0 to 11" in page.inner_text(".clip output")
    assert faults_of(page) == []
    page.fill("[name=ball]", "100mm")
    page.click("button.main")
    page.wait_for_selector(".answer:has-text('Fastest')")
    return urlsplit(page.url).path


def test_a_track_is_corrected_on_its_page(page: Any, student: str, folder: Path) -> None:
    """By mouse and keyboard; the run has the corrected positions, and all other values."""
    table = folder / "a-track" / "track.csv"
    rows = pd.read_csv(table).assign(drift_x_px=5.0)  # as of a camera that moved before
    rows.to_csv(table, index=False)
    assert look(page, student, shown="img[alt='Frame 0 of the clip']") == []
    assert page.eval_on_selector(".scroll", "each => each.scrollWidth <= each.clientWidth")
    shows(page, 0)
    again = page.get_by_role("button", name="Run again")
    status = page.locator(".clip [role=status]")
    assert again.is_disabled()
    moves = "PageDown", "Shift+ArrowRight", "Shift+ArrowUp", "Enter"
    press(page, ".stage", "PageDown", "Delete", *moves)
    x, y = rows["x_px"][2] + 6, rows["y_px"][2] - 1
    assert status.inner_text() == f"Frame 2: the ball at {x:.1f}, {y:.1f} px, flight 1"
    page.click("[aria-label='Previous frame']")
    assert status.inner_text() == f"Frame 1: {NONE.replace('no position', 'position removed')}"
    press(page, ".clip [type=range]", "End")
    shows(page, 11)
    drag(page, (262, 190))
    assert status.inner_text() == "Frame 11: the ball at 262.0, 190.0 px, flight 1"
    page.click("text=Remove this position")
    assert status.inner_text().startswith("Frame 11: position removed;")
    width = page.locator(".stage").bounding_box()["width"]
    page.select_option("[data-zoom]", "2")
    assert page.locator(".stage").bounding_box()["width"] == pytest.approx(2 * width, rel=0.02)
    drag(page, (261, 191))
    press(page, ".stage", *["ArrowLeft"] * 30)
    assert page.evaluate(IN_VIEW)
    page.fill("[data-flight]", "")
    assert status.inner_text() == "Frame 11: the ball at 261.0, 191.0 px, outside flights"
    page.fill("[data-flight]", "1")
    again.click()
    page.wait_for_url(lambda url: not url.endswith(student))
    page.wait_for_selector(".answer:has-text('Fastest')")
    said = "Positions by hand: frames 2, 11 are changed, frame 1 is removed; before, fastest: "
    assert page.locator("main > .soft").filter(has_text=said).count() == 1
    assert student.endswith(page.get_attribute("p:has-text('Of the result') a", "href"))
    rows.loc[2, ["x_px", "y_px"]] += [1.0, -1.0]
    rows.loc[11, ["x_px", "y_px"]] = [256.0, 191.0]  # without the drift
    corrected = folder / "uploads" / "a.avi-corrected.csv"
    sent, expected = pd.read_csv(corrected)[WRITTEN], rows.drop(index=1)[WRITTEN]
    assert sent.to_numpy() == pytest.approx(expected.to_numpy(), abs=0.01)
    calls = sorted(folder.glob("runs/*/call.json"))[-2:]
    first, second = (json.loads(path.read_text())["values"] for path in calls)
    assert second == first | {"corrected": str(corrected), "out": str(folder / "a-track-2")}
    assert {"ball", "ball_at", "frames", "region", "scale"} < first.keys()


def test_the_last_change_of_a_track_is_undone(page: Any, student: str) -> None:
    page.goto(student)
    shows(page, 0)
    status, buttons = page.locator(".clip [role=status]"), page.get_by_role("button")
    press(page, ".stage", "PageDown", "Delete", "PageDown", "Delete")
    assert buttons.filter(has_text="Remove").is_disabled()
    assert page.evaluate(ASKS)
    page.fill("[data-flight]", "7")  # flight of a position that is not set yet
    press(page, ".stage", "Control+z", "PageUp")
    assert status.inner_text().startswith("Frame 1: position removed;")
    page.evaluate("scrollTo(0, one('.stage').getBoundingClientRect().top + scrollY + 60)")
    scrolled = page.evaluate("scrollY")
    for name in ("Next frame", "Previous frame"):
        page.click(f"[aria-label='{name}']")
    page.click("text=Undo")
    assert scrolled == page.evaluate("scrollY") > 0  # the buttons do not move
    assert status.inner_text().endswith("flight 1")
    for name in ("Undo", "Run again"):  # nothing is changed
        assert buttons.filter(has_text=name).is_disabled()
    assert not page.evaluate(ASKS)


def test_a_track_without_a_position_gets_its_first_one(
    page: Any, student: str, folder: Path
) -> None:
    """Of the size and flight beside the picture. The circle of the size is drawn only there."""
    table = folder / "a-track" / "track.csv"
    table.write_text(table.read_text().partition("\n")[0])
    page.goto(student)
    shows(page, 0)
    assert page.locator(".clip [role=status]").inner_text() == f"Frame 0: {NONE}"
    page.fill("[data-radius]", "12.5")
    assert page.locator(".stage circle").count() == 0
    again, fault = page.get_by_role("button", name="Run again"), page.locator(".clip .fault")
    for number in range(5):
        assert again.is_disabled()
        drag(page, (41 + number, 61))
        if number == 3:  # the reason is beside the field
            assert fault.first.inner_text() == "flight 1 has 4 of the 5 positions that it needs"
        press(page, ".stage", "PageDown")
    press(page, ".stage", "PageUp")
    assert page.locator(".stage circle").last.get_attribute("r") == "12.5"
    for name, text in (("flight", "two"), ("flight", "0"), ("radius", "-5"), ("radius", "0.0")):
        entered = page.input_value(f"[data-{name}]")
        page.fill(f"[data-{name}]", text)
        assert again.is_disabled()
        assert fault.filter(visible=True).inner_text().startswith("a ")
        page.fill(f"[data-{name}]", entered)
    again.click()
    page.wait_for_url(lambda url: not url.endswith(student))
    first = pd.read_csv(folder / "uploads" / "a.avi-corrected-2.csv")
    assert first[WRITTEN].values.tolist() == [[n, 41 + n, 61, 12.5, 1, 0, 0] for n in range(5)]


def test_a_frame_between_two_flights_has_a_reason(page: Any, student: str, folder: Path) -> None:
    rows = pd.DataFrame(100.0, index=range(12), columns=WRITTEN).assign(frame=range(12))
    rows = rows.assign(flight=1 + (rows["frame"] > 5)).query("frame not in (5, 8)")
    rows.to_csv(folder / "a-track" / "track.csv", index=False)
    page.goto(student)
    shows(page, 0)
    status, said = page.locator(".clip [role=status]"), []
    for number in range(1, 9):
        press(page, ".stage", "PageDown")
        shows(page, number)
        said += [status.inner_text()]
    assert said[4].startswith("Frame 5: no position: between two flights the ball touches")
    assert said[7] == f"Frame 8: {NONE}"


def test_the_frames_of_a_warning_are_shown(page: Any, student: str, folder: Path) -> None:
    outcome = folder / "runs" / f"{int(student.rpartition('/')[2]):04}" / "outcome.json"
    warnings = [
        "positions: frames 3, 4 are up to 2 pixels off the fitted flights",
        "positions: frame 7 is 2 pixels off the fitted flights",
    ]
    changed = {"warnings": warnings, "text": f"{'word ' * 60}\n\ntable  cell"}
    outcome.write_text(json.dumps({**json.loads(outcome.read_text()), **changed}))
    page.goto(student)
    shows(page, 0)
    # a long line is wrapped, also above a table
    assert page.eval_on_selector(".scroll", "each => each.scrollWidth <= each.clientWidth")
    for frame in (4, 7):
        page.click(f"main > .soft button:text-is('{frame}')")
        shows(page, frame)
