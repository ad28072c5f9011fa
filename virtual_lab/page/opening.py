"""Start of the page: it is served to this computer alone until it is closed."""

from __future__ import annotations

import secrets
import sys
import time
import webbrowser
from pathlib import Path
from threading import Event

from virtual_lab.commands.output import Answer
from virtual_lab.errors import of_extra
from virtual_lab.output.progress import Progress, quiet
from virtual_lab.parameters import OUT, Folder
from virtual_lab.web.serving import LOOPBACK, find_address, listen, server_of, start

IDLE = 1800.0  # time without a request after which the server ends [s]
STEP = 0.2  # time between two looks [s]


def open_page(folder: Folder = OUT, *, browser: bool = True, progress: Progress = quiet) -> Answer:
    """Open a page with a form per command.

    It opens in the browser and needs the extra ``bench``. Only this computer can open the page. It
    ends by its button, by Ctrl-C, or when it was not used for 30 minutes and no run is in progress.

    Parameters
    ----------
    folder
        Folder of results and uploads.
    browser
        Open the page in the browser, and do not only print its address.
    progress
        Function that is called with a sentence, which is empty while the page is served.
    """
    of_extra("uvicorn", "bench", "the page")
    from virtual_lab.page.server import Page, page_application

    progress("")
    path = Path(folder).absolute()
    path.mkdir(parents=True, exist_ok=True)
    listener = listen(*find_address(LOOPBACK, 0, secure=False))
    port, token = listener.getsockname()[1], secrets.token_urlsafe(24)
    closed = Event()
    page = Page(path, closed.set)
    hosts = frozenset({f"{LOOPBACK}:{port}", f"localhost:{port}"})
    door, began = page_application(page, token, hosts), time.monotonic()
    server = server_of(door)
    thread = start(server, listener)
    address = f"http://{LOOPBACK}:{port}/?token={token}"
    said = f"open {address} once, in one browser; results are in {path}; Ctrl-C ends the page"
    print(said, file=sys.stderr, flush=True)
    if browser:
        webbrowser.open(address)
    try:
        while not closed.wait(STEP):
            if not page.runs.workers and time.monotonic() > IDLE + max(began, door.last_request):
                break
    finally:
        page.runs.end()
        server.should_exit = True
        thread.join()
    return Answer(document={"folder": str(path)}, text=str(path))
