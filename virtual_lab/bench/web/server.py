"""The web server, which shows the pages of days and carries out the actions of their forms.

The server receives each day as a `TraineeDay` and opens no file, so it can show only what that day
shows.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial
from typing import TYPE_CHECKING, Any, Protocol
from urllib.parse import parse_qsl

from starlette.applications import Starlette
from starlette.concurrency import run_in_threadpool
from starlette.requests import Request
from starlette.responses import HTMLResponse, RedirectResponse, Response
from starlette.routing import Route
from starlette.types import ASGIApp, Receive, Scope, Send

from virtual_lab.bench.day.actions import Action, action_of
from virtual_lab.bench.day.day import DayEvent, ready_steps
from virtual_lab.bench.day.scenario import UNITS, Scenario
from virtual_lab.bench.pages.page import (
    Refusal,
    day_page,
    hall_page,
    notebook_page,
    notebook_table,
    refusal_sentence,
    replay_page,
    wall_page,
)
from virtual_lab.bench.pages.slow_motion import Motion
from virtual_lab.errors import InputError
from virtual_lab.web import door
from virtual_lab.web.answers import KEPT, SANDBOX, sentence_page, static_routes

if TYPE_CHECKING:
    from virtual_lab.bench.day.desk import Desk
    from virtual_lab.bench.day.exam import Hall

PATIENCE = 1.0  # longest wait for a debrief before a page asks for patience [s]
STATES = {"not begun": "has not begun yet", "begun": "has begun", "over": "is over"}
STARTS = ("/replay",)


class TraineeDay(Protocol):
    """A day that a trainee can view and continue."""

    @property
    def desk(self) -> Desk: ...
    @property
    def briefing(self) -> Mapping[str, Any]: ...
    @property
    def open_book(self) -> bool:
        """Whether the truth may be shown.

        It may be shown after the day is handed in, but in an exam only to trainers.
        """
        ...

    def do(self, action: Action, number: int | None = None) -> DayEvent: ...
    def motion(self, shot: int) -> Motion | None:
        """Return the true motion of a shot, counted from 1; None until the day is handed in."""
        ...

    def film(self, shot: int, *, true: bool) -> bytes:
        """Return camera frames of a shot, counted from 1, as one PNG; empty without frames."""
        ...

    @property
    def scenarios_offered(self) -> Mapping[str, Scenario]:
        """Scenarios that the trainee may begin instead of this day, keyed by name."""
        ...

    def begin(self, name: str) -> TraineeDay:
        """Begin another scenario instead of this day. Raises `InputError` if it is not offered."""
        ...

    def branch(self, entry: int) -> TraineeDay:
        """Begin a practice day from an entry. Raises `InputError` if there is no such entry."""
        ...

    def certificate(self) -> str:
        """Return the certificate as an HTML page. Raises `InputError` before the verdict."""
        ...

    def debrief(self, patience: float | None = None) -> str:
        """Return the debrief as an HTML page.

        Raises `InputError` before the day is handed in, and `TimeoutError` if it takes longer than
        `patience` [s].
        """
        ...


@dataclass(kw_only=True)
class DaySeat(door.Seat):
    """A signed-in browser: its day, and a lock for one action at a time."""

    day: TraineeDay | None  # None for a trainer
    lock: threading.Lock = field(default_factory=threading.Lock)


def application(
    days: Mapping[str, TraineeDay],
    *,
    hosts: frozenset[str],
    secure: bool = False,
    exam: tuple[str, Hall] | None = None,
) -> ASGIApp:
    """Return the web application that serves days.

    Parameters
    ----------
    days
        The days, keyed by token. The token is part of the address that opens the day, and it works
        once. In an exam it works repeatedly. If a second browser uses it, the first browser loses
        its access.
    hosts
        Host names with port under which the pages are served, such as ``127.0.0.1:8000``. At least
        one. A request to another name is answered with status 403.
    secure
        Whether TLS is used.
    exam
        The trainer's token and the state of the exam. The token works once. Trainees can work only
        while the exam is in progress. If None, there is no exam.
    """

    async def act(request: Request) -> Response:
        return await run_in_threadpool(
            do_in_thread, request.scope["seat"], await _form_fields(request)
        )

    def do_in_thread(seat: DaySeat, fields: dict[str, str]) -> Response:
        name, number = fields.pop("do", ""), fields.pop("entry_number", "")
        day = seat.day
        assert day is not None  # the door redirects a trainer
        with seat.lock:
            try:
                _do(day, name, number, fields)
            except InputError as fault:
                refusal = Refusal(
                    sentence=refusal_sentence(fault), action=name, argument=fault.key, fields=fields
                )
                return HTMLResponse(_day(day, refusal=refusal), status_code=422)
        return RedirectResponse("/", status_code=303)

    def switch_day(
        to: Callable[[TraineeDay, dict[str, str]], TraineeDay],
    ) -> Callable[[Request], Any]:
        """Return the request handler that moves a trainee to the day that `to` returns."""

        def switch_in_thread(seat: DaySeat, fields: dict[str, str]) -> Response:
            with seat.lock:
                try:
                    seat.day = to(seat.day, fields) if seat.day else None
                except InputError as fault:
                    return sentence_page(422, refusal_sentence(fault))
            return RedirectResponse("/", status_code=303)

        async def move(request: Request) -> Response:
            return await run_in_threadpool(
                switch_in_thread, request.scope["seat"], await _form_fields(request)
            )

        return move

    routes = [
        Route("/", _with_lock(lambda day, request: _day(day, _query(request, "shot")))),
        Route("/do", act, methods=["POST"]),
        Route("/do", lambda _: RedirectResponse("/", status_code=303)),
        Route("/branch", switch_day(_branch), methods=["POST"]),
        Route(
            "/begin",
            switch_day(lambda day, fields: day.begin(fields.get("scenario", ""))),
            methods=["POST"],
        ),
        Route("/film", _film),
        Route("/progress", _progress),
        Route("/replay", _with_lock(_replay)),
        Route("/notebook", _with_lock(lambda day, _: notebook_page(day.desk, day.briefing))),
        Route(
            "/notebook.csv",
            _with_lock(
                lambda day, _: Response(
                    notebook_table(day.desk, day.briefing), media_type="text/csv"
                )
            ),
        ),
        Route("/rules", _with_lock(lambda day, _: wall_page(day.desk, day.briefing, "rules"))),
        Route(
            "/instruments",
            _with_lock(lambda day, _: wall_page(day.desk, day.briefing, "instruments")),
        ),
        Route("/certificate", _with_lock(lambda day, _: _sandbox(day.certificate))),
        Route("/debrief", _with_lock(_debrief)),
    ]
    static = [
        *static_routes("virtual_lab.bench.pages", "bench.css", "bench.js"),
        *static_routes("virtual_lab.web", "base.css", "icon.svg"),
    ]
    inside, seats = Starlette(routes=[*routes, *static]), {}
    for token, day in days.items():
        seats[token] = DaySeat(day=day)
    if exam is None:
        return door.Door(inside, seats, hosts=hosts, secure=secure, starts=STARTS)
    trainer, hall = exam
    in_hall = Starlette(routes=[*_hall_routes(hall), *static])

    async def by_seat(scope: Scope, receive: Receive, send: Send) -> None:
        await (inside if scope["seat"].day else in_hall)(scope, receive, send)

    seats[trainer] = DaySeat(day=None)
    return ExamDoor(hall, by_seat, seats, hosts=hosts, secure=secure, starts=STARTS)


def _branch(day: TraineeDay, fields: Mapping[str, str]) -> TraineeDay:
    if not day.open_book:
        raise InputError("", "day", None, "can be repeated after the hand-in, and not in an exam")
    entry = fields.get("entry", "")
    return day.branch(int(entry) if entry.isdecimal() else -1)


def _with_lock(
    answer: Callable[[TraineeDay, Request], Response | str],
) -> Callable[[Request], Response]:
    """Return the handler of requests that `answer` answers, one at a time for each trainee."""

    def answer_with_lock(request: Request) -> Response:
        seat = request.scope["seat"]
        with seat.lock:
            content = answer(seat.day, request)
        return HTMLResponse(content) if isinstance(content, str) else content

    return answer_with_lock


async def _form_fields(request: Request) -> dict[str, str]:
    """Return the fields of a form keyed by name; empty if there are more than 50."""
    body = (await request.body()).decode("utf-8", errors="replace")
    try:
        return dict(parse_qsl(body, max_num_fields=50))
    except ValueError:
        return {}


def _query(request: Request, name: str) -> int:
    """Return the number of a field in an address; -1 if it is not a number."""
    text = request.query_params.get(name, "")
    return int(text) if text.isdecimal() and len(text) < 7 else -1


def _day(day: TraineeDay, shot_asked: int = -1, refusal: Refusal | None = None) -> str:
    desk = day.desk
    fired = len(desk.day.fired)
    shot = shot_asked if 1 <= shot_asked <= fired else fired
    true = day.motion(shot) if shot and desk.day.handed_in else None
    return day_page(
        desk,
        day.briefing,
        refusal=refusal,
        shot=shot,
        true_motion=true,
        scenarios_offered=day.scenarios_offered,
    )


def _replay(day: TraineeDay, request: Request) -> Response | str:
    state, entry = day.desk.day, max(_query(request, "entry"), 0)
    if not day.open_book:
        return sentence_page(409, "A day can be replayed after the hand-in, and not in an exam.")
    if entry > len(state.events):
        return sentence_page(
            404, f"There is no such entry. Entries are numbered from 0 to {len(state.events)}."
        )
    return replay_page(state, day.briefing, entry)


def _progress(request: Request) -> Response:
    """Answer with the number of shots so far, without waiting for shots in progress."""
    return Response(str(len(request.scope["seat"].day.desk.day.fired)), media_type="text/plain")


def _film(request: Request) -> Response:
    """Answer with the camera frames of a shot, without blocking other requests."""
    true = request.query_params.get("as") == "it-was"
    picture = request.scope["seat"].day.film(_query(request, "shot"), true=true)
    if not picture:
        return sentence_page(404, "There are no camera frames.")
    return Response(picture, media_type="image/png", headers=KEPT)


def _debrief(day: TraineeDay, _: Request) -> Response:
    """Answer with the debrief or, while it is being made, with a page that reloads itself."""
    try:
        return _sandbox(partial(day.debrief, PATIENCE))
    except TimeoutError as late:
        page = sentence_page(
            202, f"This page reloads automatically. {late}.", title="The debrief is being prepared"
        )
        page.headers["Refresh"] = "1"
        return page


def _sandbox(page: Callable[[], str]) -> Response:
    try:
        return HTMLResponse(page(), headers=SANDBOX)
    except InputError as fault:
        return sentence_page(409, refusal_sentence(fault), title="Not yet")


def _hall_routes(hall: Hall) -> list[Route]:
    """Return the routes of the trainer in an exam."""

    async def turn(request: Request) -> Response:
        try:
            hall.turn((await _form_fields(request)).get("do", ""))
        except InputError as fault:
            return sentence_page(422, str(fault))
        return RedirectResponse("/", status_code=303)

    return [
        Route("/", lambda _: HTMLResponse(hall_page(hall))),
        Route("/do", turn, methods=["POST"]),
    ]


def _do(day: TraineeDay, name: str, number: str, fields: dict[str, str]) -> None:
    """Carry out one action, or all actions of a button. Each action becomes one entry."""
    due = len(day.desk.day.events) + 1
    if number != str(due):
        allowed = f"entry {due} is next: this page was out of date, so nothing was done"
        raise InputError("", "entry", number, allowed)
    if name == "fire-shots":
        _fire_shots(day, fields)
    elif name == "accept-within":
        for shot, why in enumerate(day.desk.reasons):
            if not why and shot not in day.desk.day.decisions:
                day.do(action_of("accept", {"shot": shot + 1}))
    else:
        day.do(action_of(name, fields, UNITS[day.briefing["units"]][0][0]), due)


def _fire_shots(day: TraineeDay, fields: Mapping[str, str]) -> None:
    """Load, prepare and fire up to twelve balls, as the fields of the form request.

    With the field `accept` each hit within the windows is accepted, and the next impact position is
    set. With the field `stop` the firing ends after the first shot outside the windows.
    """
    try:
        shots = int(fields.get("shots", "1"))
    except ValueError:
        shots = 0
    if not 1 <= shots <= 12:
        raise InputError("", "shots", fields.get("shots"), "allowed: 1 to 12")
    if day.desk.reduction_error:
        raise InputError("", "next ball", None, f"is not known yet: {day.desk.reduction_error}")
    for _ in range(shots):
        if "accept" in fields:
            place = day.desk.next_position
            if place is None:
                return
            if day.desk.needs_position:
                day.do(action_of("set-place", {"place": round(place * 1e3, 3)}))
        day.do(action_of("load-ball", {"ball": day.desk.next_ball + 1}))
        for step in ready_steps(day.desk.day):
            day.do(action_of(step))
        day.do(action_of("fire"))
        rejected = bool(day.desk.reasons[-1])
        if rejected and "stop" in fields:
            return
        if "accept" in fields and not rejected:
            day.do(action_of("accept", {"shot": len(day.desk.day.fired)}))


class ExamDoor(door.Door):
    """The door of an exam: a trainee's token stays valid, and the exam must be in progress."""

    def __init__(self, hall: Hall, *inside_and_seats: Any, **more: Any) -> None:
        super().__init__(*inside_and_seats, **more)
        self.hall = hall

    def readmits(self, seat: Any) -> bool:
        """Return whether the token of a seat stays valid: it does for a trainee."""
        return seat.day is not None

    def note_replacement(self, seat: Any) -> None:
        """Take note that a trainee continues in another browser."""
        self.hall.join_again(seat.day)

    def refuse_seat(self, request: Request) -> Response | None:
        """Return the rejection of a trainee while the exam is not in progress, too."""
        refused = super().refuse_seat(request)
        seat = request.scope.setdefault("seat", DaySeat(day=None))
        if refused or seat.day is None or request.url.path in door.OPEN_TO_ALL or self.hall.is_open:
            return refused
        return sentence_page(409, f"The exam {STATES[self.hall.state]}.", title=self.hall.title)

    def stranger(self, request: Request) -> Response:
        """Return the page on which a trainee enters the code."""
        wrong = "This code does not exist. " if "token" in request.query_params else ""
        opens = (
            "Enter your code to open your day. If it is open in another browser, it closes there."
        )
        return sentence_page(403, f"{wrong}{opens}", title=self.hall.title, by_code=True)
