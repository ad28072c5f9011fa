"""The server of the pages, which carries out the actions of forms on a day.

The server receives each day as a `Room` and opens no file, so it can show only what the day shows.
Access is checked first: a one-time token in the opened address, then a cookie; the served host
names; and the origin of the request, which must be the page itself.
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

PATIENCE = 1.0  # time until a page says that a debrief is being made [s]
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


class Room(Protocol):
    """A day that can be viewed and continued."""

    @property
    def desk(self) -> Desk: ...
    @property
    def briefing(self) -> Mapping[str, Any]: ...
    @property
    def open_book(self) -> bool:
        """Whether the truth may be shown: after the hand-in, and in an exam only to the trainer."""
        ...

    def do(self, action: Action, number: int | None = None) -> DayEvent: ...
    def motion(self, shot: int) -> Motion | None:
        """Return the true motion of a shot, from 1, None before the day is handed in."""
        ...

    def film(self, shot: int, *, true: bool) -> bytes:
        """Return a camera's frames of a shot, from 1, as one PNG, or no bytes without frames."""
        ...

    @property
    def others(self) -> Mapping[str, Scenario]:
        """Days that can be begun instead of this one, by name."""
        ...

    def begin(self, name: str) -> Room:
        """Return another day begun instead. Raises `InputError` if it is not offered."""
        ...

    def branch(self, entry: int) -> Room:
        """Return a day of practice that continues from an entry. Raises `InputError` if none."""
        ...

    def certificate(self) -> str:
        """Return the certificate's page. Raises `InputError` before there is one."""
        ...

    def debrief(self, patience: float | None = None) -> str:
        """Return the debrief's page. Raises `InputError` before the day is handed in.

        Raises `TimeoutError` if it is not ready within `patience` [s].
        """
        ...


@dataclass(kw_only=True)
class Seat:
    """The seat of a trainee: the day, a lock for one action at a time, and times of requests."""

    room: Room | None  # None for a trainer
    lock: threading.Lock = field(default_factory=threading.Lock)
    asked: deque[float] = field(default_factory=lambda: deque(maxlen=MOST_A_SECOND))


def application(
    rooms: Mapping[str, Room],
    *,
    hosts: frozenset[str],
    secure: bool = False,
    exam: tuple[str, Hall] | None = None,
) -> ASGIApp:
    """Return the server of some days.

    Parameters
    ----------
    rooms
        The days, by the one-time token of their first address.
    hosts
        Served names with port, such as ``127.0.0.1:8000``.
    secure
        Whether TLS is used.
    exam
        The trainer's token, and the hall that opens and closes the days.
    """

    async def act(request: Request) -> Response:
        return await run_in_threadpool(acted, request.scope["seat"], await _sent(request))

    def acted(seat: Seat, given: dict[str, str]) -> Response:
        name, number = given.pop("do", ""), given.pop("entry_number", "")
        room = seat.room
        assert room is not None  # the door redirects a trainer
        with seat.lock:
            try:
                _do(room, name, number, given)
            except InputError as fault:
                refusal = Refusal(
                    sentence=refusal_sentence(fault), action=name, argument=fault.key, given=given
                )
                return HTMLResponse(_day(room, refusal=refusal), status_code=422)
        return RedirectResponse("/", status_code=303)

    def moving(to: Callable[[Room, dict[str, str]], Room]) -> Callable[[Request], Any]:
        """Return the handler that moves a trainee from one day to another."""

        def moved(seat: Seat, given: dict[str, str]) -> Response:
            with seat.lock:
                try:
                    seat.room = to(seat.room, given) if seat.room else None
                except InputError as fault:
                    return _says(422, refusal_sentence(fault))
            return RedirectResponse("/", status_code=303)

        async def move(request: Request) -> Response:
            return await run_in_threadpool(moved, request.scope["seat"], await _sent(request))

        return move

    def static(name: str, kind: str) -> Route:
        content = files("virtual_lab.bench.pages").joinpath("templates", name).read_bytes()
        return Route(f"/{name}", lambda _: Response(content, media_type=kind, headers=KEPT))

    routes = [
        Route("/", _locked(lambda room, request: _day(room, _query(request, "shot")))),
        Route("/do", act, methods=["POST"]),
        Route("/do", lambda _: RedirectResponse("/", status_code=303)),
        Route("/branch", moving(_branched), methods=["POST"]),
        Route(
            "/begin",
            moving(lambda room, given: room.begin(given.get("scenario", ""))),
            methods=["POST"],
        ),
        Route("/film", _film),
        Route("/progress", _progress),
        Route("/replay", _locked(_replayed)),
        Route("/notebook", _locked(lambda room, _: notebook_page(room.desk, room.briefing))),
        Route(
            "/notebook.csv",
            _locked(
                lambda room, _: Response(
                    notebook_table(room.desk, room.briefing), media_type="text/csv"
                )
            ),
        ),
        Route("/rules", _locked(lambda room, _: wall_page(room.desk, room.briefing, "rules"))),
        Route(
            "/instruments",
            _locked(lambda room, _: wall_page(room.desk, room.briefing, "instruments")),
        ),
        Route("/certificate", _locked(lambda room, _: _sandboxed(room.certificate))),
        Route("/debrief", _locked(_debriefed)),
        static("bench.css", "text/css"),
        static("bench.js", "text/javascript"),
        static("icon.svg", "image/svg+xml"),
    ]
    door = Door(Starlette(routes=routes), rooms, hosts=hosts, secure=secure)
    if exam is not None:
        token, door.hall = exam
        door.codes[token] = Seat(room=None)
        door.hall_inside = Starlette(routes=[*_hall_routes(door.hall), *routes[-3:]])
    return door


def _branched(room: Room, given: Mapping[str, str]) -> Room:
    if not room.open_book:
        raise InputError("", "day", None, "can be repeated after the hand-in, and not in an exam")
    asked = given.get("entry", "")
    return room.branch(int(asked) if asked.isdecimal() else -1)


def _locked(answer: Callable[[Room, Request], Response | str]) -> Callable[[Request], Response]:
    """Return a handler that answers from a trainee's room, one request at a time."""

    def locked(request: Request) -> Response:
        seat = request.scope["seat"]
        with seat.lock:
            found = answer(seat.room, request)
        return HTMLResponse(found) if isinstance(found, str) else found

    return locked


async def _sent(request: Request) -> dict[str, str]:
    """Return the fields of a form; none where there are too many."""
    body = (await request.body()).decode("utf-8", errors="replace")
    try:
        return dict(parse_qsl(body, max_num_fields=50))
    except ValueError:
        return {}


def _query(request: Request, name: str) -> int:
    """Return a number in an address, or -1."""
    asked = request.query_params.get(name, "")
    return int(asked) if asked.isdecimal() and len(asked) < 7 else -1


def _day(room: Room, asked: int = -1, refusal: Refusal | None = None) -> str:
    desk = room.desk
    fired = len(desk.day.fired)
    shot = asked if 1 <= asked <= fired else fired
    true = room.motion(shot) if shot and desk.day.handed_in else None
    return day_page(
        desk, room.briefing, refusal=refusal, shot=shot, true_motion=true, others=room.others
    )


def _replayed(room: Room, request: Request) -> Response | str:
    day, entry = room.desk.day, max(_query(request, "entry"), 0)
    if not room.open_book:
        return _says(409, "A day can be replayed after the hand-in, and not in an exam.")
    if entry > len(day.events):
        return _says(
            404, f"There is no such entry. Entries are numbered from 0 to {len(day.events)}."
        )
    return replay_page(day, room.briefing, entry)


def _progress(request: Request) -> Response:
    """Answer with the shots so far, without waiting for a salvo in progress."""
    return Response(str(len(request.scope["seat"].room.desk.day.fired)), media_type="text/plain")


def _film(request: Request) -> Response:
    """Answer with frames, without blocking other requests."""
    true = request.query_params.get("as") == "it-was"
    picture = request.scope["seat"].room.film(_query(request, "shot"), true=true)
    if not picture:
        return _says(404, "There are no camera frames.")
    return Response(picture, media_type="image/png", headers=KEPT)


def _debriefed(room: Room, _: Request) -> Response:
    """Answer with the debrief or, while it is being made, with a page that reloads itself."""
    try:
        return _sandboxed(partial(room.debrief, PATIENCE))
    except TimeoutError as late:
        page = plain_page(
            "The debrief is being prepared", f"This page reloads automatically. {late}."
        )
        return HTMLResponse(page, status_code=202, headers={"Refresh": "1"})


def _sandboxed(page: Callable[[], str]) -> Response:
    policy = "default-src 'none'; style-src 'unsafe-inline'; img-src data:; "
    policy += "sandbox allow-same-origin"  # otherwise a link back has no cookie
    try:
        return HTMLResponse(page(), headers={"Content-Security-Policy": policy})
    except InputError as fault:
        return HTMLResponse(plain_page("Not yet", refusal_sentence(fault)), status_code=409)


def _hall_routes(hall: Hall) -> list[Route]:
    """Return the routes of a trainer."""

    async def turn(request: Request) -> Response:
        try:
            hall.turn((await _sent(request)).get("do", ""))
        except InputError as fault:
            return _says(422, str(fault))
        return RedirectResponse("/", status_code=303)

    return [
        Route("/", lambda _: HTMLResponse(hall_page(hall))),
        Route("/do", turn, methods=["POST"]),
    ]


def _do(room: Room, name: str, number: str, given: dict[str, str]) -> None:
    """Do one action, or the several actions of a button, each of which is one entry."""
    due = len(room.desk.day.events) + 1
    if number != str(due):
        allowed = f"entry {due} is next: this page was out of date, so nothing was done"
        raise InputError("", "entry", number, allowed)
    if name == "fire-shots":
        _fire_shots(room, given)
    elif name == "accept-within":
        for shot, why in enumerate(room.desk.reasons):
            if not why and shot not in room.desk.day.decisions:
                room.do(action_of("accept", {"shot": shot + 1}))
    else:
        room.do(action_of(name, given, UNITS[room.briefing["units"]][0][0]), due)


def _fire_shots(room: Room, given: Mapping[str, str]) -> None:
    """Load, prepare and fire up to twelve balls.

    If requested, accept each hit within the windows and move to the next impact position. Stop at
    the first hit outside them.
    """
    try:
        shots = int(given.get("shots", "1"))
    except ValueError:
        shots = 0
    if not 1 <= shots <= 12:
        raise InputError("", "shots", given.get("shots"), "allowed: 1 to 12")
    if room.desk.missing:
        raise InputError("", "next ball", None, f"is not known yet: {room.desk.missing}")
    for _ in range(shots):
        if "accept" in given:
            place = room.desk.next_place
            if place is None:
                return
            if room.desk.rule_off:
                room.do(action_of("set-place", {"place": round(place * 1e3, 3)}))
        room.do(action_of("load-ball", {"ball": room.desk.next_ball + 1}))
        for step in ready_steps(room.desk.day):
            room.do(action_of(step))
        room.do(action_of("fire"))
        odd = bool(room.desk.reasons[-1])
        if odd and "stop" in given:
            return
        if "accept" in given and not odd:
            room.do(action_of("accept", {"shot": len(room.desk.day.fired)}))


class Door:
    """Access control, and the headers of every response."""

    def __init__(
        self, inside: ASGIApp, rooms: Mapping[str, Room], *, hosts: frozenset[str], secure: bool
    ) -> None:
        self.inside, self.hosts, self.secure = inside, hosts, secure
        self.codes = {token: Seat(room=room) for token, room in rooms.items()}
        self.hall: Hall | None = None
        self.hall_inside = inside  # application for a trainer
        self.seats: dict[str, Seat] = {}  # seats by cookie
        self.cookie = "bench-" + min(hosts).rpartition(":")[2]  # cookies do not depend on the port

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            if scope["type"] == "lifespan":
                await self.inside(scope, receive, send)
            return
        request = Request(scope)

        async def guarded(message: Message) -> None:
            if message["type"] == "http.response.start":
                headers = MutableHeaders(scope=message)
                for key, value in HEADERS.items():
                    headers.setdefault(key, value)
            await send(message)

        refused = (
            self._misdirected(request)
            or self._entering(request)
            or self._unknown(request)
            or self._too_early(request)
        )
        if refused is None:
            trainer = request.scope["seat"].room is None
            inside = self.hall_inside if trainer else self.inside
            with suppress(ClientDisconnect):  # the client no longer waits
                await inside(scope, receive, guarded)
        else:
            await refused(scope, receive, guarded)

    def _misdirected(self, request: Request) -> Response | None:
        """Return the refusal of another host, another origin, or too long a request, else None."""
        if request.headers.get("host", "") not in self.hosts:
            return _says(403, "This address is not served here.")
        if request.method == "POST":
            scheme = "https" if self.secure else "http"
            if request.headers.get("origin") not in {f"{scheme}://{name}" for name in self.hosts}:
                return _says(403, "A request must come from a page of this server.")
            length = request.headers.get("content-length", "")
            if "transfer-encoding" in request.headers:  # its length is unknown before its end
                return _says(411, "A request must state its length, and come whole.")
            if not length.isdigit() or int(length) > LARGEST_BODY:
                return _says(413, f"A request may have at most {LARGEST_BODY} bytes.")
        return None

    def _entering(self, request: Request) -> Response | None:
        """Return the answer to a token, which is valid once, or again for a trainee of an exam."""
        token = _known(self.codes, request.query_params.get("token", ""))
        if token is None:
            return None
        seat = self.codes[token]
        if self.hall is None or seat.room is None:
            del self.codes[token]
        for earlier in [session for session, taken in self.seats.items() if taken is seat]:
            del self.seats[earlier]  # the lost browser must not continue
            if self.hall is not None:
                self.hall.join_again(seat.room)
        session = secrets.token_urlsafe(32)
        self.seats[session] = seat
        to = "/replay" if request.url.path == "/replay" else "/"
        answer = RedirectResponse(to, status_code=303)
        answer.set_cookie(
            self.cookie, session, httponly=True, samesite="strict", secure=self.secure
        )
        return answer

    def _unknown(self, request: Request) -> Response | None:
        """Return the refusal of a request without cookie or too many requests, else None."""
        session = _known(self.seats, request.cookies.get(self.cookie, ""))
        if session is None:
            request.scope["seat"] = Seat(room=None)
            return None if request.url.path in OPEN_TO_ALL else self._stranger(request)
        seat = request.scope["seat"] = self.seats[session]
        now = time.monotonic()
        if len(seat.asked) == MOST_A_SECOND and now - seat.asked[0] < 1:
            return _says(429, "Too many requests. Wait a second, then go back.")
        seat.asked.append(now)
        return None

    def _stranger(self, request: Request) -> Response:
        if self.hall is None:
            return _says(
                403, "Open the address that the command printed. It works once, in one browser."
            )
        wrong = "This code does not exist. " if "token" in request.query_params else ""
        opens = "Enter your code to open your day. A day open in another browser closes there."
        sentence = f"{wrong}{opens}"
        return _says(403, sentence, title=self.hall.title, by_code=True)

    def _too_early(self, request: Request) -> Response | None:
        """Return the answer to a trainee before the exam begins or after it ends, else None."""
        trainer = request.scope["seat"].room is None
        free = trainer or request.url.path in OPEN_TO_ALL
        if free or self.hall is None or self.hall.is_open:
            return None
        return _says(409, f"The exam {STATES[self.hall.state]}.", title=self.hall.title)


def _known(keys: Mapping[str, object], given: str) -> str | None:
    """Return the matching key, compared in constant time, or None."""
    found = [key for key in keys if secrets.compare_digest(key.encode(), given.encode())]
    return found[0] if found else None


def _says(
    status: int, sentence: str, *, title: str = "Not available", by_code: bool = False
) -> Response:
    return HTMLResponse(plain_page(title, sentence, by_code=by_code), status_code=status)
