"""The page started on this machine: a day in a folder, a server that serves it to one browser."""

from __future__ import annotations

import secrets
import threading
import webbrowser
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from virtual_lab.bench.apparatus import Apparatus
from virtual_lab.bench.debrief import debrief_page, debriefed
from virtual_lab.bench.keeping import LOG, KeptDay, laboratory_of, taken
from virtual_lab.bench.operators import operator_of
from virtual_lab.bench.running import save_debrief
from virtual_lab.bench.scenario import Scenario
from virtual_lab.catalog import Entry
from virtual_lab.certificate.filling import certificate
from virtual_lab.certificate.html import certificate_page
from virtual_lab.errors import InputError

__all__ = ["ServedDay", "serve"]


class ServedDay(KeptDay):
    """A day as a page is given it."""

    @property
    def briefing(self) -> Mapping[str, Any]:
        found: Mapping[str, Any] = self.log.morning["briefing"]
        return found

    def certificate(self) -> str:
        """Return the certificate of what was reduced; `InputError` before that."""
        if not self.day.reduced:
            raise InputError("certificate", "hits", None, "reduce comes first")
        return certificate_page(certificate(self.desk.certification))

    def debrief(self) -> str:
        """Open the truth of a day that was handed in, and keep the debrief beside its log."""
        if self.day.exam:
            raise InputError("debrief", "day", None, "is an exam: your trainer opens the debrief")
        told = debriefed(self)
        save_debrief(told, self.log.path.parent)
        return debrief_page(told)


def serve(
    folder: Path,
    scenario: Entry[Scenario],
    *,
    seed: int | None,
    port: int,
    browser: bool,
    say: Callable[[str], None],
) -> None:
    """Begin a day in a folder, or take it up again, and serve it until it is stopped."""
    import uvicorn

    from virtual_lab.bench.web import application

    begun = (folder / LOG).exists()
    room = ServedDay(folder) if begun else ServedDay.begin(folder, scenario, seed)
    token = secrets.token_urlsafe(24)
    hosts = frozenset({f"127.0.0.1:{port}", f"localhost:{port}"})
    address = f"http://127.0.0.1:{port}/?token={token}"
    say(f"{'taken up again' if begun else 'begun'}: {folder}")
    say(f"open {address} (once, in one browser); Ctrl-C stops, the day stays")
    say("root and your own account can read the sealed file; a page cannot")
    threading.Thread(target=_warm, args=(scenario.spec,), daemon=True).start()
    if browser:
        threading.Timer(1.0, webbrowser.open, (address,)).start()
    uvicorn.run(
        application(room, token=token, hosts=hosts),
        host="127.0.0.1",
        port=port,
        log_level="warning",
        access_log=False,
        server_header=False,
    )


def _warm(scenario: Scenario) -> None:
    """Load what is compiled, on another laboratory's day, while the first readings are made."""
    taken(Apparatus(laboratory_of(scenario, 0, b"")), operator_of("book"))
