"""A served day: a day in a folder, with its pages, camera frames and debrief.

The setup of the laboratory takes seconds and runs in the background. The first page does not wait
for it: it needs only the rules, the table of actions and, for a continued day, the log. Actions
wait for the setup.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from functools import cached_property, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from virtual_lab import catalog
from virtual_lab.bench.day.actions import Action
from virtual_lab.bench.day.day import Day, DayEvent
from virtual_lab.bench.day.desk import Desk
from virtual_lab.bench.day.log import LOG, DayLog
from virtual_lab.bench.day.scenario import Scenario, load_scenario, scenarios_to_choose
from virtual_lab.bench.pages.slow_motion import Motion
from virtual_lab.catalog import Entry
from virtual_lab.errors import InputError
from virtual_lab.files import first_free
from virtual_lab.measurement.procedure import Procedure
from virtual_lab.records.origin import Simulated
from virtual_lab.records.session import Session

if TYPE_CHECKING:
    from virtual_lab.bench.machines.stored_day import StoredDay
    from virtual_lab.bench.scoring.debrief import Debrief


class BackgroundJobs:
    """Background jobs, run one at a time in order, so that one core stays free for requests."""

    def __init__(self, name: str) -> None:
        self._pool = ThreadPoolExecutor(1, name)
        self._futures: list[Future[Any]] = []

    def do(self, work: Callable[[], Any]) -> Future[Any]:
        """Append a job to the queue, and return the future of its result."""
        future = self._pool.submit(work)
        self._futures = [each for each in self._futures if not each.done()] + [future]
        return future

    def jobs_ahead(self, future: Future[Any]) -> int:
        """Return the number of unfinished jobs before the job of `future`."""
        return sum(not each.done() for each in self._futures[: self._futures.index(future)])


FILMS, DEBRIEFS = BackgroundJobs("film"), BackgroundJobs("debrief")


class ServedDay:
    """A new or continued day in a folder, for the web server.

    Without a scenario the day is only viewed, after its hand-in, for example by the trainer of an
    exam.
    """

    def __init__(
        self,
        folder: Path,
        scenario: Entry[Scenario] | None,
        seed: int | None = None,
        *,
        is_fixed: bool = True,
        operator: str = "trainee",
    ) -> None:
        self.folder, self.scenario, self.seed = folder, scenario, seed
        self.operator = operator  # person who decides about the hits
        self.is_fixed = is_fixed  # whether the trainee can no longer choose the scenario
        self._opened: Future[StoredDay] = Future()
        self._begun = (folder / LOG).exists()
        self.first_view = threading.Event()
        self._expert: Future[Day] | None = None
        self._debrief_future: Future[Debrief] | None = None  # the debrief; None before hand-in
        self._films: dict[tuple[int, bool], Future[bytes]] = {}  # key: shot, whether true
        self._filming = threading.Lock()

    def open(self) -> StoredDay:
        """Set up the laboratory, which takes seconds, and return the day.

        Raises `InputError` if the scenario or the folder does not fit.
        """
        if self._begun:
            # the content of the first page, computed before the slow setup
            _ = self._first.reduction_error
        from virtual_lab.bench.machines.stored_day import StoredDay

        if self._begun or self.scenario is None:
            day = StoredDay(self.folder)
        else:
            day = StoredDay.begin(self.folder, self.scenario, self.seed, self.operator)
        self._opened.set_result(day)
        return day

    @property
    def stored(self) -> StoredDay:
        """The day on disk. It waits until the laboratory is set up."""
        return self._opened.result()

    @property
    def desk(self) -> Desk:
        self.first_view.set()
        return self.stored.desk if self._opened.done() else self._first

    @cached_property
    def _log(self) -> DayLog:
        return DayLog(self.folder / LOG)

    @cached_property
    def _first(self) -> Desk:
        """The desk before the setup: from the log, or for a new day from the rules alone."""
        if self._begun or self.scenario is None:
            return Desk(self._log.last)
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
        briefing: Mapping[str, Any] = self._log.morning["briefing"]
        return briefing

    @property
    def open_book(self) -> bool:
        day = self.desk.day
        return day.handed_in and not (day.exam and self.scenario)

    def do(self, action: Action, number: int | None = None) -> DayEvent:
        event = self.stored.do(action, number)
        if action.name == "fire" and self.briefing.get("camera"):
            self._film_future(len(self.stored.day.fired), False)  # in the background
        # after a reduction no action needs the machines
        if action.name == "reduce" and not self.stored.day.exam:
            from virtual_lab.bench.scoring.debrief import expert_day

            self._expert = DEBRIEFS.do(partial(expert_day, self.stored.apparatus, self.stored.day))
        if self.open_book:
            self._debrief_future = DEBRIEFS.do(self._make_debrief)
        return event

    def film(self, shot: int, *, true: bool) -> bytes:
        """Return camera frames of a shot, counted from 1, as one PNG; empty without frames.

        They show the blurred sketch, or with `true` the truth if it may be shown. The call waits
        until the frames are ready.
        """
        if not (self.briefing.get("camera") and 1 <= shot <= len(self.stored.day.fired)):
            return b""
        return self._film_future(shot, true and self.open_book).result()

    def _film_future(self, shot: int, true: bool) -> Future[bytes]:
        with self._filming:
            if (shot, true) not in self._films:
                if len(self._films) == 16:
                    del self._films[next(iter(self._films))]
                self._films[shot, true] = FILMS.do(partial(self._make_film, shot, true))
            return self._films[shot, true]

    def _make_film(self, shot: int, true: bool) -> bytes:
        from virtual_lab.bench.machines.sketching import before_shot, sketch_film, true_film

        day, machines = self.stored.day, self.stored.apparatus
        if true:
            return true_film(machines.at(before_shot(day, shot)).firing, day, shot)
        fired = [event for event in day.events if event.action == "fire"]
        return sketch_film(machines.laboratory.setup, fired[shot - 1])

    def motion(self, shot: int) -> Motion | None:
        """Return the true motion of a shot, counted from 1.

        It is None if the truth may not be shown. It is also None while the laboratory is being set
        up, because a page must not wait.
        """
        if not (self._opened.done() and self.open_book):
            return None
        from virtual_lab.bench.machines.sketching import before_shot, true_motion

        day = self.stored
        machines = day.apparatus.at(before_shot(day.day, shot))
        return true_motion(machines.firing, day.day, shot)

    def certificate(self) -> str:
        """Return the certificate as an HTML page. Raises `InputError` before the verdict."""
        from virtual_lab.certificate.filling import certificate
        from virtual_lab.certificate.html import certificate_page

        if not self.stored.day.reduced:
            raise InputError("certificate", "hits", None, "are not reduced yet: reduce comes first")
        if not self.stored.day.verdict:
            allowed = (
                "is missing: give-verdict comes first, so that your verdict precedes the program's"
            )
            raise InputError("certificate", "verdict", None, allowed)
        return certificate_page(certificate(self.stored.desk.certification))

    def debrief(self, patience: float | None = None) -> str:
        """Return the debrief as an HTML page, and save it beside the log.

        Raises
        ------
        TimeoutError
            It is not ready within `patience` [s]; the message states how many debriefs come first.
        InputError
            The day is not handed in, or it is an exam.
        """
        from virtual_lab.bench.scoring.debrief_page import debrief_page

        day = self.stored.day
        if day.exam and self.scenario:
            raise InputError(
                "debrief", "day", None, "is an exam, so your trainer opens the debrief"
            )
        debrief = self._debrief_future = self._debrief_future or DEBRIEFS.do(self._make_debrief)
        try:
            return debrief_page(debrief.result(patience), linked=True)
        except TimeoutError as late:
            jobs_ahead = DEBRIEFS.jobs_ahead(debrief)
            words = f"Debriefs before yours: {jobs_ahead}" if jobs_ahead else "Your debrief is next"
            raise TimeoutError(words) from late

    def _make_debrief(self) -> Debrief:
        from virtual_lab.bench.scoring.debrief import debrief_of
        from virtual_lab.bench.scoring.debrief_page import save_debrief

        debrief = debrief_of(self.stored, self._expert.result() if self._expert else None)
        save_debrief(debrief, self.folder)
        return debrief

    @property
    def scenarios_offered(self) -> Mapping[str, Scenario]:
        """Other scenarios that can be begun, keyed by name; none after the first entry."""
        return {} if self.is_fixed or self.desk.day.events else scenarios_to_choose()

    def begin(self, name: str) -> ServedDay:
        """Begin another scenario in the folder of this day, which is deleted, and return it.

        Raises `InputError` if `name` is not in `scenarios_offered`.
        """
        if name not in self.scenarios_offered:
            allowed = (
                f"allowed before the first entry: {', '.join(self.scenarios_offered) or 'none'}"
            )
            raise InputError("", "scenario", name, allowed)
        from virtual_lab.bench.machines.stored_day import SECRET

        _ = self.stored  # waits for the setup, after which nothing is written to the folder
        for each in (LOG, SECRET):
            (self.folder / each).unlink()
        self.folder.rmdir()
        day = ServedDay(self.folder, load_scenario(name), is_fixed=False, operator=self.operator)
        day.open()
        return day

    def branch(self, entry: int) -> ServedDay:
        """Begin a practice day in a folder beside this one, as a copy up to and including `entry`.

        Raises `InputError` if this day is not handed in or has no such entry.
        """
        from virtual_lab.bench.machines.stored_day import StoredDay

        target = first_free(self.folder.with_name(f"{self.folder.name}-from-{entry}"))
        StoredDay.branch(self.folder, entry, target)
        day = ServedDay(target, self.scenario)
        day.open()
        return day
