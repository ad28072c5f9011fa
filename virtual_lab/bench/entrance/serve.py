"""Start of the web server on this computer: days in folders, each for one browser."""

from __future__ import annotations

import secrets
import sys
import webbrowser
from collections.abc import Callable, Mapping
from pathlib import Path

from virtual_lab import catalog
from virtual_lab.bench.day.exam import Hall
from virtual_lab.bench.day.log import LOG
from virtual_lab.bench.day.scenario import Scenario
from virtual_lab.bench.entrance.served_day import ServedDay
from virtual_lab.catalog import Entry
from virtual_lab.errors import InputError
from virtual_lab.web.serving import LOOPBACK, find_address, listen, server_of, start

MOST_TRAINEES = 50


def serve(
    folders: Mapping[str, Path],
    scenario: Entry[Scenario] | None,
    *,
    seed: int | None = None,
    port: int,
    browser: bool,
    say: Callable[[str], None],
    host: str = LOOPBACK,
    tls: tuple[Path, Path] | None = None,
    exam: str = "",
) -> None:
    """Begin or continue the day in each folder, and serve the pages until Ctrl-C is pressed.

    Parameters
    ----------
    folders
        Folder of each trainee, keyed by the trainee's name. There can be at most 50 folders.
    scenario
        Scenario of new days. If None, the days in the folders are replayed. In this case, all these
        days must have been handed in.
    seed
        Seed of the random numbers. If it is given, all new days are the same. If None, each new day
        has a different random seed.
    port, host
        Port and host name of the pages. A host other than this computer needs `tls`.
    browser
        Whether to open the page of the first day in the browser.
    say
        Function that prints a line of instructions.
    tls
        Files of certificate and key, in PEM format. If None, the pages are served without TLS.
    exam
        Title of the exam. If it is empty, there is no exam. In an exam, the days stay closed until
        the trainer begins it.

    Raises
    ------
    InputError
        The scenario, a folder, the number of folders or `tls` cannot be used. The port is in use.
        The host is unknown, or needs `tls`.
    """
    from virtual_lab.bench.web.server import application

    _require(tls, len(folders))
    family, numbers = find_address(host, port, secure=tls is not None)
    url_host = f"[{host}]" if ":" in host else host  # notation of IPv6 in an address, RFC 3986
    is_fixed = scenario is None or len(folders) > 1 or bool(exam or catalog.texts_in_place())
    days = {
        name: ServedDay(folder, scenario, seed, is_fixed=is_fixed, operator=name or "trainee")
        for name, folder in folders.items()
    }
    doors = {secrets.token_urlsafe(24): day for day in days.values()}
    hall = (secrets.token_urlsafe(24), Hall(exam, days)) if exam else None
    names = {f"{name}:{port}" for name in {url_host, *(["localhost"] if host == LOOPBACK else [])}}
    application_served = application(doors, hosts=frozenset(names), secure=bool(tls), exam=hall)
    server = server_of(application_served, tls)
    thread = start(server, listen(family, numbers))
    scheme = "https" if tls else "http"
    page = "" if scenario else "replay"
    addresses = [f"{scheme}://{url_host}:{port}/{page}?token={token}" for token in doors]
    if hall:
        say(f"the trainer: open {scheme}://{url_host}:{port}/?token={hall[0]} once, in one browser")
    for (name, folder), address in zip(folders.items(), addresses, strict=True):
        status = "continued" if (folder / LOG).exists() else "begun"
        status = status if scenario else "replayed"
        instruction = (
            " (sign in again with the code in this address)" if hall else " once, in one browser"
        )
        say(f"{name or 'the day'}, {status} in {folder}: open {address}{instruction}")
    say("Ctrl-C stops the server. The day is saved. You can read the sealed file, but no page can")
    if browser:
        webbrowser.open(addresses[0])
    sys.setswitchinterval(5e-4)  # longest delay of an answer by imports in another thread [s]
    try:
        if len(folders) > 1 or exam:
            next(iter(folders.values())).parent.mkdir(exist_ok=True)  # folder of the class
        for day in days.values():
            day.first_view.wait(0.5)  # let the first page come before slow imports [s]
            day.open()
        if scenario:
            _warm(scenario.spec)
        thread.join()
    finally:
        server.should_exit = True
        thread.join()


def _require(tls: tuple[Path, Path] | None, trainees: int) -> None:
    for path in tls or ():
        if not path.is_file():
            raise InputError(str(path), "tls", None, "no such file")
    if not 1 <= trainees <= MOST_TRAINEES:
        raise InputError("", "trainees", trainees, f"allowed: 1 to {MOST_TRAINEES}")


def _warm(scenario: Scenario) -> None:
    """Load compiled code by playing another day, while the trainee takes the first readings."""
    from virtual_lab.bench.day.operators import operator_of
    from virtual_lab.bench.machines.apparatus import Apparatus
    from virtual_lab.bench.machines.stored_day import laboratory_of, run_operator

    run_operator(Apparatus(laboratory_of(scenario, 0, b"")), operator_of("book"))
