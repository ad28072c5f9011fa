"""The page started on this machine: days in folders, a server that serves each to one browser.

The first page needs the rules and the table of actions alone, and of a day that is taken up again
the log: so it is served while the laboratory is still being set up behind it; what is done on the
day waits for that, which takes seconds.
"""

from __future__ import annotations

import secrets
import socket
import sys
import threading
import time
import webbrowser
from collections.abc import Callable, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from virtual_lab import catalog
from virtual_lab.bench.day.actions import Action
from virtual_lab.bench.day.day import Day, DayEvent, replayed
from virtual_lab.bench.day.desk import Desk
from virtual_lab.bench.day.log import LOG, DayLog
from virtual_lab.bench.day.scenario import Scenario, load_scenario, scenarios_to_choose
from virtual_lab.bench.pages.slow_motion import Motion
from virtual_lab.bench.web.exam import Hall
from virtual_lab.catalog import Entry
from virtual_lab.errors import InputError
from virtual_lab.files import first_free
from virtual_lab.measurement.procedure import Procedure
from virtual_lab.records.origin import Simulated
from virtual_lab.records.session import Session

if TYPE_CHECKING:
    from virtual_lab.bench.machines.keeping import KeptDay
    from virtual_lab.bench.scoring.debrief import Debrief

LOOPBACK = "127.0.0.1"
MOST_TRAINEES = 50
FILM_MAKER = ThreadPoolExecutor(1, "film")  # one core is left to the answers


class ServedDay:
    """A day as a page is given it, in a folder: begun there, or taken up again.

    Without a scenario it is there to be looked at, once it is handed in: by the trainer of an exam.
    """

    def __init__(
        self,
        folder: Path,
        scenario: Entry[Scenario] | None,
        seed: int | None = None,
        *,
        chosen: bool = True,
    ) -> None:
        self.folder, self.scenario, self.seed = folder, scenario, seed
        self.chosen = chosen  # by a trainer, or once the first entry is made
        self._opened: Future[KeptDay] = Future()
        self._begun = (folder / LOG).exists()
        self.looked_at = threading.Event()
        self._told: Debrief | None = None
        self._films: dict[tuple[int, bool], Future[bytes]] = {}  # shot, whether as it was
        self._filming = threading.Lock()

    def open(self) -> KeptDay:
        """Set the laboratory up; `InputError` where scenario or folder are unfit."""
        if self._begun:
            _ = self._first.missing  # first what the first page is made of, then the machines
        from virtual_lab.bench.machines.keeping import KeptDay

        if self._begun or self.scenario is None:
            kept = KeptDay(self.folder)
        else:
            kept = KeptDay.begin(self.folder, self.scenario, self.seed)
        self._opened.set_result(kept)
        return kept

    @property
    def kept(self) -> KeptDay:
        """The day on disk, once its laboratory is set up."""
        return self._opened.result()

    @property
    def desk(self) -> Desk:
        self.looked_at.set()
        return self.kept.desk if self._opened.done() else self._first

    @cached_property
    def _log(self) -> DayLog:
        return DayLog(self.folder / LOG)

    @cached_property
    def _first(self) -> Desk:
        """The desk that the log gives, or nothing but the rules of a day that begins."""
        if self._begun or self.scenario is None:
            return Desk(replayed(self._log.first, self._log.events()))
        rules = catalog.load("procedures", self.scenario.spec.procedure, Procedure)
        session = Session(
            bat=self.scenario.spec.bat,
            ball=rules.spec.ball,
            rigs={},
            procedure_text=rules.text,
            calibration={},
            records={},
            origin=Simulated(
                reality="", sealing="", seed_commitment="", unverified_numbers={}, rungs={}
            ),
        )
        return Desk(Day(morning=session, balls=rules.spec.balls))

    @property
    def briefing(self) -> Mapping[str, Any]:
        if self.scenario and not (self._begun or self._opened.done()):
            return self.scenario.spec.briefing()
        found: Mapping[str, Any] = self._log.morning["briefing"]
        return found

    @property
    def open_book(self) -> bool:
        day = self.desk.day
        return day.handed_in and not (day.exam and self.scenario)

    def do(self, action: Action, number: int | None = None) -> DayEvent:
        done = self.kept.do(action, number)
        if action.name == "fire" and self.briefing.get("camera"):
            self._film(len(self.kept.day.fired), False)  # behind the answer
        return done

    def film(self, shot: int, *, true: bool) -> bytes:
        """Return a camera's frames of a shot, from 1, as one PNG; nothing where there are none.

        As the eye had it, or once that may be seen as it was. It waits until they are made.
        """
        if not (self.briefing.get("camera") and 1 <= shot <= len(self.kept.day.fired)):
            return b""
        return self._film(shot, true and self.open_book).result()

    def _film(self, shot: int, true: bool) -> Future[bytes]:
        with self._filming:
            if (shot, true) not in self._films:
                if len(self._films) == 16:
                    del self._films[next(iter(self._films))]
                self._films[shot, true] = FILM_MAKER.submit(self._filmed, shot, true)
            return self._films[shot, true]

    def _filmed(self, shot: int, true: bool) -> bytes:
        from virtual_lab.bench.machines.sketching import before_shot, film_as_seen, true_film

        day, machines = self.kept.day, self.kept.apparatus
        if true:
            return true_film(machines.at(before_shot(day, shot)).firing, day, shot)
        fired = [event for event in day.events if event.action == "fire"]
        return film_as_seen(machines.laboratory.setup, fired[shot - 1])

    def motion(self, shot: int) -> Motion | None:
        """Return how a shot, from 1, really went, once the day is handed in.

        None while the laboratory is being set up: no page waits for it.
        """
        if not (self._opened.done() and self.open_book):
            return None
        from virtual_lab.bench.machines.sketching import before_shot, true_motion

        kept = self.kept
        machines = kept.apparatus.at(before_shot(kept.day, shot))
        return true_motion(machines.firing, kept.day, shot)

    def certificate(self) -> str:
        """Return the certificate of what was reduced; `InputError` before that."""
        from virtual_lab.certificate.filling import certificate
        from virtual_lab.certificate.html import certificate_page

        if not self.kept.day.reduced:
            raise InputError("certificate", "hits", None, "reduce comes first")
        if not self.kept.day.verdict:
            allowed = "give-verdict comes first: your own before the program's"
            raise InputError("certificate", "verdict", None, allowed)
        return certificate_page(certificate(self.kept.desk.certification))

    def debrief(self) -> str:
        """Open the truth of a day that was handed in, and keep the debrief beside its log."""
        from virtual_lab.bench.running import save_debrief
        from virtual_lab.bench.scoring.debrief import debrief_page, debriefed

        kept = self.kept
        if kept.day.exam and self.scenario:
            raise InputError("debrief", "day", None, "is an exam: your trainer opens the debrief")
        if self._told is None or len(self._told.entries) != len(kept.day.events):
            self._told = debriefed(kept)
            save_debrief(self._told, kept.folder)
        return debrief_page(self._told, linked=True)

    @property
    def others(self) -> Mapping[str, Scenario]:
        """The days that may be begun in place of this one, by name: none after its first entry."""
        return {} if self.chosen or self.desk.day.events else scenarios_to_choose()

    def begin(self, name: str) -> ServedDay:
        """Return another day in a folder beside this one; `InputError` where it is not offered."""
        if name not in self.others:
            allowed = f"allowed before the first entry: {', '.join(self.others) or 'none'}"
            raise InputError("", "scenario", name, allowed)
        target = first_free(self.folder.with_name(name))
        day = ServedDay(target, load_scenario(name), chosen=False)
        day.open()
        return day

    def branch(self, entry: int) -> ServedDay:
        """Return a day of practice that goes on from an entry of this one, in a folder beside it.

        Raises `InputError` as `KeptDay.branch`.
        """
        from virtual_lab.bench.machines.keeping import KeptDay

        target = first_free(self.folder.with_name(f"{self.folder.name}-from-{entry}"))
        KeptDay.branch(self.folder, entry, target)
        day = ServedDay(target, self.scenario)
        day.open()
        return day


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
    """Begin days in folders, or take them up again, and serve them until stopped.

    Parameters
    ----------
    folders
        Of each trainee, by name.
    scenario, seed
        Of days that begin; the trainees of one seed have the same day. Without a scenario days
        that were handed in are played back.
    port, host
        Where the page is served; beyond this machine only with `tls`.
    browser
        Whether to open the page of the first day.
    say
        Is given the lines that tell a trainer what to do.
    tls
        Certificate and key, files as OpenSSL writes them.
    exam
        The title of one: the days are closed until the trainer begins it on a page of its own.

    Raises
    ------
    InputError
        An unfit scenario or folder, a port that is taken, a host that needs `tls`.
    """
    import uvicorn

    from virtual_lab.bench.web.server import application

    _require(host, tls, len(folders))
    chosen = scenario is None or len(folders) > 1 or bool(exam)
    days = {
        name: ServedDay(folder, scenario, seed, chosen=chosen) for name, folder in folders.items()
    }
    doors = {secrets.token_urlsafe(24): day for day in days.values()}
    hall = (secrets.token_urlsafe(24), Hall(exam, days)) if exam else None
    names = {f"{host}:{port}", *([f"localhost:{port}"] if host == LOOPBACK else [])}
    certificate, key = tls or (None, None)
    settings = uvicorn.Config(
        application(doors, hosts=frozenset(names), secure=tls is not None, exam=hall),
        log_level="warning",
        access_log=False,
        server_header=False,
        ws="none",
        lifespan="off",
        backlog=64,
        limit_concurrency=4 * MOST_TRAINEES,
        ssl_certfile=certificate,
        ssl_keyfile=key,
    )
    try:
        settings.load()
    except OSError as fault:  # SSLError is one
        raise InputError(str(certificate), "tls", None, f"cannot be used ({fault})") from fault
    server = uvicorn.Server(settings)
    thread = threading.Thread(
        target=server.run, kwargs={"sockets": [_listening(host, port)]}, daemon=True
    )
    thread.start()
    while not server.started:
        time.sleep(0.005)
    scheme = "https" if tls else "http"
    page = "" if scenario else "replay"
    addresses = [f"{scheme}://{host}:{port}/{page}?token={token}" for token in doors]
    if hall:
        say(f"the trainer: open {scheme}://{host}:{port}/?token={hall[0]} once, in one browser")
    for (name, folder), address in zip(folders.items(), addresses, strict=True):
        again = "taken up again" if (folder / LOG).exists() else "begun"
        again = again if scenario else "played back"
        once = "; the code in it lets them in again" if hall else " once, in one browser"
        say(f"{name or 'the day'}, {again} in {folder}: open {address}{once}")
    say("Ctrl-C stops, the day stays; root and your account can read the sealed file, no page can")
    if browser:
        webbrowser.open(addresses[0])
    sys.setswitchinterval(5e-4)  # s, that loading may hold up an answer
    try:
        for day in days.values():
            day.looked_at.wait(0.5)  # s: a first page before what is loaded for later
            day.open()
        if scenario:
            _warm(scenario.spec)
        thread.join()
    finally:
        server.should_exit = True
        thread.join()


def _require(host: str, tls: tuple[Path, Path] | None, trainees: int) -> None:
    if host != LOOPBACK and tls is None:
        allowed = f"beyond {LOOPBACK} the page needs --tls-certificate and --tls-key"
        raise InputError("", "host", host, allowed)
    for path in tls or ():
        if not path.is_file():
            raise InputError(str(path), "tls", None, "no such file")
    if not 1 <= trainees <= MOST_TRAINEES:
        raise InputError("", "trainees", trainees, f"allowed: 1 to {MOST_TRAINEES}")


def _listening(host: str, port: int) -> socket.socket:
    own = socket.socket(proto=socket.IPPROTO_TCP)  # without it an answer in two parts waits 40 ms
    own.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        own.bind((host, port))
    except OSError as fault:
        own.close()
        allowed = f"cannot be served at {host} ({fault.strerror}); try another"
        raise InputError("", "port", port, allowed) from fault
    return own


def _warm(scenario: Scenario) -> None:
    """Load what is compiled, on another laboratory's day, while the first readings are made."""
    from virtual_lab.bench.day.operators import operator_of
    from virtual_lab.bench.machines.apparatus import Apparatus
    from virtual_lab.bench.machines.keeping import laboratory_of, taken

    taken(Apparatus(laboratory_of(scenario, 0, b"")), operator_of("book"))
