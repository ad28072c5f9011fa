"""The web server, which shows the pages of days and carries out the actions of their forms.

The server receives each day as a `TraineeDay` and opens no file, so it can show only what that day
shows. Every request is checked first. Its host name must be allowed, its origin must be a page of
this server, and it must have the cookie. The first address contains a one-time token, and the
server sets the cookie when this address is opened.
"""

from __future__ import annotations

import secrets
import threading
import time
from collections import deque
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from functools import partial
from importlib.resources import files
from typing import TYPE_CHECKING, Any, Protocol
from urllib.parse import parse_qsl

from starlette.applications import Starlette
from starlette.concurrency import run_in_threadpool
from starlette.datastructures import MutableHeaders
from starlette.requests import ClientDisconnect, Request
from starlette.responses import HTMLResponse, RedirectResponse, Response
from starlette.routing import Route
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from virtual_lab.bench.day.actions import Action, action_of
from virtual_lab.bench.day.day import DayEvent, ready_steps
from virtual_lab.bench.day.scenario import UNITS, Scenario
from virtual_lab.bench.pages.page import (
    Refusal,
    day_page,
    hall_page,
    notebook_page,
    notebook_table,
    plain_page,
    refusal_sentence,
    replay_page,
    wall_page,
)
from virtual_lab.bench.pages.slow_motion import Motion
from virtual_lab.errors import InputError

if TYPE_CHECKING:
    from virtual_lab.bench.day.desk import Desk
    from virtual_lab.bench.day.exam import Hall

PATIENCE = 1.0  # longest wait for a debrief before a page asks for patience [s]
LARGEST_BODY = 64 * 1024  # largest request [B]
MOST_A_SECOND = 20  # largest rate of requests per session [1/s]
KEPT = {"Cache-Control": "private, max-age=600"}  # header of responses that do not change
STATES = {"not begun": "has not begun yet", "begun": "has begun", "over": "is over"}
OPEN_TO_ALL = {"/bench.css", "/icon.svg"}
HEADERS = {
    "Content-Security-Policy": "default-src 'self'; base-uri 'none'; form-action 'self'; "
    "frame-ancestors 'none'",
    "X-Content-Type-Options": "nosniff",
    "Cache-Control": "no-store",
    "Referrer-Policy": "same-origin",  # with no-referrer a browser's POST has the origin null
}


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
class Seat:
    """A signed-in browser: its day, a lock for one action at a time, and its request times."""

    day: TraineeDay | None  # None for a trainer
    lock: threading.Lock = field(default_factory=threading.Lock)
    request_times: deque[float] = field(default_factory=lambda: deque(maxlen=MOST_A_SECOND))


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

    def do_in_thread(seat: Seat, fields: dict[str, str]) -> Response:
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

        def switch_in_thread(seat: Seat, fields: dict[str, str]) -> Response:
            with seat.lock:
                try:
                    seat.day = to(seat.day, fields) if seat.day else None
                except InputError as fault:
                    return _sentence_page(422, refusal_sentence(fault))
            return RedirectResponse("/", status_code=303)

        async def move(request: Request) -> Response:
            return await run_in_threadpool(
                switch_in_thread, request.scope["seat"], await _form_fields(request)
            )

        return move

    def static(name: str, kind: str) -> Route:
        content = files("virtual_lab.bench.pages").joinpath("templates", name).read_bytes()
        return Route(f"/{name}", lambda _: Response(content, media_type=kind, headers=KEPT))

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
        static("bench.css", "text/css"),
        static("bench.js", "text/javascript"),
        static("icon.svg", "image/svg+xml"),
    ]
    door = Door(Starlette(routes=routes), days, hosts=hosts, secure=secure)
    if exam is not None:
        token, door.hall = exam
        door.codes[token] = Seat(day=None)
        door.hall_inside = Starlette(routes=[*_hall_routes(door.hall), *routes[-3:]])
    return door


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
        return _sentence_page(409, "A day can be replayed after the hand-in, and not in an exam.")
    if entry > len(state.events):
        return _sentence_page(
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
        return _sentence_page(404, "There are no camera frames.")
    return Response(picture, media_type="image/png", headers=KEPT)


def _debrief(day: TraineeDay, _: Request) -> Response:
    """Answer with the debrief or, while it is being made, with a page that reloads itself."""
    try:
        return _sandbox(partial(day.debrief, PATIENCE))
    except TimeoutError as late:
        page = plain_page(
            "The debrief is being prepared", f"This page reloads automatically. {late}."
        )
        return HTMLResponse(page, status_code=202, headers={"Refresh": "1"})


def _sandbox(page: Callable[[], str]) -> Response:
    policy = "default-src 'none'; style-src 'unsafe-inline'; img-src data:; "
    policy += "sandbox allow-same-origin"  # otherwise a link back has no cookie
    try:
        return HTMLResponse(page(), headers={"Content-Security-Policy": policy})
    except InputError as fault:
        return HTMLResponse(plain_page("Not yet", refusal_sentence(fault)), status_code=409)


def _hall_routes(hall: Hall) -> list[Route]:
    """Return the routes of the trainer in an exam."""

    async def turn(request: Request) -> Response:
        try:
            hall.turn((await _form_fields(request)).get("do", ""))
        except InputError as fault:
            return _sentence_page(422, str(fault))
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


class Door:
    """Access control in front of the application, which also adds headers to each response."""

    def __init__(
        self,
        inside: ASGIApp,
        days: Mapping[str, TraineeDay],
        *,
        hosts: frozenset[str],
        secure: bool,
    ) -> None:
        self.inside, self.hosts, self.secure = inside, hosts, secure
        self.codes = {token: Seat(day=day) for token, day in days.items()}
        self.hall: Hall | None = None
        self.hall_inside = inside  # application for the trainer
        self.seats: dict[str, Seat] = {}  # seats by cookie
        self.cookie = (
            "bench-" + min(hosts).rpartition(":")[2]
        )  # browsers share cookies between ports

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            if scope["type"] == "lifespan":
                await self.inside(scope, receive, send)
            return
        request = Request(scope)

        async def send_with_headers(message: Message) -> None:
            if message["type"] == "http.response.start":
                headers = MutableHeaders(scope=message)
                for key, value in HEADERS.items():
                    headers.setdefault(key, value)
            await send(message)

        refused = (
            self._refuse_request(request)
            or self._enter(request)
            or self._refuse_session(request)
            or self._refuse_by_exam(request)
        )
        if refused is None:
            trainer = request.scope["seat"].day is None
            inside = self.hall_inside if trainer else self.inside
            with suppress(ClientDisconnect):  # the client no longer waits
                await inside(scope, receive, send_with_headers)
        else:
            await refused(scope, receive, send_with_headers)

    def _refuse_request(self, request: Request) -> Response | None:
        """Return the rejection of a wrong host or origin, or of too long a request; else None."""
        if request.headers.get("host", "") not in self.hosts:
            return _sentence_page(403, "This address is not served here.")
        if request.method == "POST":
            scheme = "https" if self.secure else "http"
            if request.headers.get("origin") not in {f"{scheme}://{name}" for name in self.hosts}:
                return _sentence_page(403, "A request must come from a page of this server.")
            length = request.headers.get("content-length", "")
            if "transfer-encoding" in request.headers:  # the length is unknown in advance
                return _sentence_page(411, "A request must state its length, and come whole.")
            if not length.isdigit() or int(length) > LARGEST_BODY:
                return _sentence_page(413, f"A request may have at most {LARGEST_BODY} bytes.")
        return None

    def _enter(self, request: Request) -> Response | None:
        """Return the answer to a request with a token, or None without one.

        A token is valid once. In an exam the token of a trainee stays valid. A request that only
        looks at the address, or fetches the page in advance, does not use the token.
        """
        token = _find_key(self.codes, request.query_params.get("token", ""))
        early = "prefetch" in request.headers.get("sec-purpose", "")
        if token is None or early or request.method != "GET":
            return None
        seat = self.codes[token]
        if self.hall is None or seat.day is None:
            del self.codes[token]
        for earlier in [session for session, occupied in self.seats.items() if occupied is seat]:
            del self.seats[earlier]  # the earlier browser must not continue
            if self.hall is not None:
                self.hall.join_again(seat.day)
        session = secrets.token_urlsafe(32)
        self.seats[session] = seat
        to = "/replay" if request.url.path == "/replay" else "/"
        answer = RedirectResponse(to, status_code=303)
        answer.set_cookie(
            self.cookie, session, httponly=True, samesite="strict", secure=self.secure
        )
        return answer

    def _refuse_session(self, request: Request) -> Response | None:
        """Return the rejection of a request without a cookie, or of too many; else None."""
        session = _find_key(self.seats, request.cookies.get(self.cookie, ""))
        if session is None:
            request.scope["seat"] = Seat(day=None)
            return None if request.url.path in OPEN_TO_ALL else self._stranger(request)
        seat = request.scope["seat"] = self.seats[session]
        now = time.monotonic()
        if len(seat.request_times) == MOST_A_SECOND and now - seat.request_times[0] < 1:
            return _sentence_page(429, "Too many requests. Wait a second, then go back.")
        seat.request_times.append(now)
        return None

    def _stranger(self, request: Request) -> Response:
        if self.hall is None:
            return _sentence_page(
                403, "Open the address that the command printed. It works once, in one browser."
            )
        wrong = "This code does not exist. " if "token" in request.query_params else ""
        opens = (
            "Enter your code to open your day. If it is open in another browser, it closes there."
        )
        sentence = f"{wrong}{opens}"
        return _sentence_page(403, sentence, title=self.hall.title, by_code=True)

    def _refuse_by_exam(self, request: Request) -> Response | None:
        """Return the rejection of a trainee while the exam is not in progress; else None."""
        trainer = request.scope["seat"].day is None
        free = trainer or request.url.path in OPEN_TO_ALL
        if free or self.hall is None or self.hall.is_open:
            return None
        return _sentence_page(409, f"The exam {STATES[self.hall.state]}.", title=self.hall.title)


def _find_key(keys: Mapping[str, object], text: str) -> str | None:
    """Return the key that equals `text`, or None. The comparison takes constant time."""
    matches = [key for key in keys if secrets.compare_digest(key.encode(), text.encode())]
    return matches[0] if matches else None


def _sentence_page(
    status: int, sentence: str, *, title: str = "Not available", by_code: bool = False
) -> Response:
    return HTMLResponse(plain_page(title, sentence, by_code=by_code), status_code=status)
