"""A server in a thread and a Chromium on it: what the tests of the page in a browser share."""

from __future__ import annotations

import json
import os
import shutil
import socket
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from unittest import mock

import pytest

from virtual_lab.bench.day.exam import Hall
from virtual_lab.bench.day.scenario import Scenario, load_scenario
from virtual_lab.bench.entrance.served_day import ServedDay
from virtual_lab.bench.web.server import application
from virtual_lab.catalog import Entry
from virtual_lab.web import door

__all__ = ["FOCUSED", "SEED", "chromium", "enter", "faults_of", "free_port", "opened", "served"]

SEED = 3
FLAGS = ["--headless", "--no-sandbox", "--disable-gpu", "--disable-background-networking"]
FOCUSED = "body :focus"


def chromium() -> str:
    """Return the path of the machine's own Chromium; the test is skipped where there is none."""
    found = os.environ.get("VIRTUAL_LAB_CHROMIUM") or shutil.which("chromium")
    if not found:
        pytest.skip("no Chromium: $VIRTUAL_LAB_CHROMIUM, or chromium on the path")
    return found


@contextmanager
def opened() -> Iterator[Any]:
    """Open a browser."""
    path = chromium()
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=path, args=FLAGS)
        yield browser
        browser.close()


def free_port() -> int:
    with socket.socket() as each:
        each.bind(("127.0.0.1", 0))
        return int(each.getsockname()[1])


def with_faults(folder: Path, name: str, faults: tuple[str, ...]) -> Entry[Scenario]:
    """Return a scenario, with faults in place of a draw where some are given."""
    if not faults:
        return load_scenario(name)
    path = folder.with_name(f"{name}.toml")
    text = load_scenario(name).text
    path.write_text(text.replace("procedure =", f"faults = {json.dumps(faults)}\nprocedure ="))
    return load_scenario(str(path))


@contextmanager
def served(
    folder: Path, scenario: str = "plain-day", trainer: str = "", faults: tuple[str, ...] = ()
) -> Iterator[tuple[ServedDay, str]]:
    """Serve a day, of an exam where a trainer's token is given; give it and its first address."""
    import uvicorn

    day = ServedDay(folder, with_faults(folder, scenario, faults), SEED, is_fixed=bool(trainer))
    day.open()
    port = free_port()
    exam = (trainer, Hall("Spring class", {"Ada": day})) if trainer else None
    app = application({"token": day}, hosts=frozenset({f"127.0.0.1:{port}"}), exam=exam)
    server = uvicorn.Server(uvicorn.Config(app, port=port, log_level="error"))
    thread = threading.Thread(target=server.run)
    with mock.patch.object(door, "MOST_A_SECOND", 1000):  # no person presses keys so fast
        thread.start()
        while not server.started:
            time.sleep(0.005)
        try:
            yield day, f"http://127.0.0.1:{port}/?token=token"
        finally:  # or the thread keeps the process of a test that failed alive
            server.should_exit = True
            thread.join()


def enter(page: Any, key: str = "Enter") -> str:
    """Press a key on what has the focus, and return what has it on the next page."""
    # given once the page is drawn, which may be after its load
    page.wait_for_selector(FOCUSED, state="attached")
    with page.expect_navigation():
        page.keyboard.press(key)
    page.wait_for_selector(FOCUSED, state="attached")
    return str(page.evaluate("document.activeElement.textContent"))


def faults_of(page: Any) -> list[str]:
    """Return what axe-core finds wrong with a page, and whether it must be scrolled sideways."""
    from axe_playwright_python.sync_playwright import Axe

    found = [
        f"{each['id']}: {node['html'][:120]}"
        for each in Axe().run(page).response["violations"]
        for node in each["nodes"]
    ]
    wide = page.evaluate("document.documentElement.scrollWidth - innerWidth")
    return found + ([f"{wide} px too wide"] if wide > 0 else [])
