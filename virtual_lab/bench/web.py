"""The server of the page: what is asked for by forms is done on a day that is handed in.

It is given the day as a `Room` and opens no file: it can show nothing that the day does not. Who
may ask is settled before anything else: a one-time token in the opened address, then a cookie;
names that are served; requests that come from the page itself.
"""

from __future__ import annotations

import secrets
import threading
import time
from collections import deque
from collections.abc import Awaitable, Callable, Mapping
from importlib.resources import files
from typing import Any, Protocol
from urllib.parse import parse_qsl

from starlette.applications import Starlette
from starlette.concurrency import run_in_threadpool
from starlette.requests import Request
from starlette.responses import HTMLResponse, RedirectResponse, Response
from starlette.routing import Route
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from virtual_lab.bench.actions import Action, action_of
from virtual_lab.bench.day import DayEvent
from virtual_lab.bench.desk import Desk
from virtual_lab.bench.page import day_page, plain_page
from virtual_lab.bench.table import MAKE_READY
from virtual_lab.errors import InputError

__all__ = ["Room", "application"]

LARGEST_BODY = 64 * 1024  # B
MOST_A_SECOND = 20  # requests of a session
MOST_SHOTS = 12  # of one button
COOKIE = "bench"
POLICY = (
    "default-src 'self'; script-src 'none'; base-uri 'none'; form-action 'self'; "
    "frame-ancestors 'none'"
)
SANDBOX = "default-src 'none'; style-src 'unsafe-inline'; img-src data:; sandbox"
HEADERS = {
    "X-Content-Type-Options": "nosniff",
    "Cache-Control": "no-store",
    "Referrer-Policy": "no-referrer",
}


class Room(Protocol):
    """A day that can be looked at and gone on with."""

    @property
    def desk(self) -> Desk: ...
    @property
    def briefing(self) -> Mapping[str, Any]: ...
    def do(self, action: Action, number: int | None = None) -> DayEvent: ...
    def certificate(self) -> str:
        """Return the certificate's page; `InputError` before there is one."""
        ...

    def debrief(self) -> str:
        """Return the debrief's page; `InputError` before the day is handed in."""
        ...


def application(room: Room, *, token: str, hosts: frozenset[str]) -> ASGIApp:
    """Return the server of a day.

    Parameters
    ----------
    room
        The day.
    token
        That the first address must carry, once.
    hosts
        Names with port that are served, such as ``127.0.0.1:8000``.
    """
    lock = threading.Lock()

    def show(_: Request) -> Response:
        with lock:
            return HTMLResponse(day_page(room.desk, room.briefing))

    async def act(request: Request) -> Response:
        body = (await request.body()).decode("utf-8", errors="replace")
        try:
            given = dict(parse_qsl(body, max_num_fields=50))
        except ValueError:
            given = {}
        return await run_in_threadpool(acted, given)

    def acted(given: dict[str, str]) -> Response:
        name, number = given.pop("do", ""), given.pop("entry_number", "")
        with lock:
            try:
                _do(room, name, number, given)
            except InputError as fault:
                page = day_page(room.desk, room.briefing, str(fault))
                return HTMLResponse(page, status_code=422)
        return RedirectResponse(f"/#{given.get('back', 'now')}", status_code=303)

    def page_answer(page: Callable[[], str]) -> Callable[[Request], Response]:
        def answer(_: Request) -> Response:
            with lock:
                try:
                    return HTMLResponse(page(), headers={"Content-Security-Policy": SANDBOX})
                except InputError as fault:
                    return HTMLResponse(plain_page("Not yet", str(fault)), status_code=409)

        return answer

    style = files("virtual_lab.bench").joinpath("templates", "bench.css").read_text("utf-8")

    def sheet(_: Request) -> Response:
        return Response(style, media_type="text/css")

    routes = [
        Route("/", show),
        Route("/do", act, methods=["POST"]),
        Route("/certificate", page_answer(room.certificate)),
        Route("/debrief", page_answer(room.debrief)),
        Route("/bench.css", sheet),
    ]
    return Door(Starlette(routes=routes), token=token, hosts=hosts)


def _do(room: Room, name: str, number: str, given: dict[str, str]) -> None:
    """Do one action, or what a button of several does; each is an entry of its own."""
    given.pop("back", None)
    due = len(room.desk.day.events) + 1
    if number != str(due):
        allowed = f"entry {due} is next: the page was older than the day, nothing was done"
        raise InputError("", "entry", number, allowed)
    if name == "make-ready":
        for step in MAKE_READY:
            room.do(action_of(step))
    elif name == "fire-shots":
        _fire_shots(room, given)
    elif name == "accept-within":
        for shot, why in enumerate(room.desk.reasons):
            if not why and shot not in room.desk.day.decisions:
                room.do(action_of("accept", {"shot": shot + 1}))
    else:
        room.do(action_of(name, given), due)


def _fire_shots(room: Room, given: Mapping[str, str]) -> None:
    """Load, make ready and fire some balls, and stop at the first that the windows reject."""
    try:
        shots = int(given.get("shots", "1"))
    except ValueError:
        shots = 0
    if not 1 <= shots <= MOST_SHOTS:
        raise InputError("", "shots", given.get("shots"), f"allowed: 1 to {MOST_SHOTS}")
    if room.desk.missing:
        raise InputError("", "whose turn it is", None, f"is not known yet: {room.desk.missing}")
    for _ in range(shots):
        room.do(action_of("load-ball", {"ball": room.desk.next_ball + 1}))
        for step in MAKE_READY:
            room.do(action_of(step))
        room.do(action_of("fire"))
        if "stop" in given and not room.desk.missing and room.desk.reasons[-1]:
            return


class Door:
    """Who may come in, and what goes out with every answer."""

    def __init__(self, inside: ASGIApp, *, token: str, hosts: frozenset[str]) -> None:
        self.inside, self.token, self.hosts = inside, token, hosts
        self.session = secrets.token_urlsafe(32)
        self.asked: deque[float] = deque(maxlen=MOST_A_SECOND)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            if scope["type"] == "lifespan":
                await self.inside(scope, receive, send)
            return
        request = Request(scope)

        async def guarded(message: Message) -> None:
            if message["type"] == "http.response.start":
                names = {name.lower() for name, _ in message["headers"]}
                own = HEADERS | {"Content-Security-Policy": POLICY}
                message["headers"] = [
                    *message["headers"],
                    *(
                        (key.lower().encode(), value.encode())
                        for key, value in own.items()
                        if key.lower().encode() not in names
                    ),
                ]
            await send(message)

        refused = self._refused(request)
        if refused is None:
            await self.inside(scope, _limited(receive), guarded)
        else:
            await refused(scope, receive, guarded)

    def _refused(self, request: Request) -> Response | None:
        """Return the answer to who may not come in, None to who may."""
        return self._misdirected(request) or self._unknown(request)

    def _misdirected(self, request: Request) -> Response | None:
        """Return the answer to another host, another page, or too long a request."""
        if request.headers.get("host", "") not in self.hosts:
            return _says(403, "This name is not served here.")
        if request.method == "POST":
            if request.headers.get("origin") not in {f"http://{name}" for name in self.hosts}:
                return _says(403, "A request must come from the page itself.")
            length = request.headers.get("content-length", "")
            if not length.isdigit() or int(length) > LARGEST_BODY:
                return _says(413, f"A request may have up to {LARGEST_BODY} bytes.")
        return None

    def _unknown(self, request: Request) -> Response | None:
        """Return the answer to who has no cookie yet, or asks too often."""
        given = request.query_params.get("token", "")
        if self.token and given and secrets.compare_digest(given.encode(), self.token.encode()):
            self.token = ""  # it opens the door once
            answer = RedirectResponse("/", status_code=303)
            answer.set_cookie(COOKIE, self.session, httponly=True, samesite="strict")
            return answer
        cookie = request.cookies.get(COOKIE, "")
        if not secrets.compare_digest(cookie.encode(), self.session.encode()):
            return _says(403, "Open the address that the command printed, in one browser.")
        now = time.monotonic()
        if len(self.asked) == MOST_A_SECOND and now - self.asked[0] < 1:
            return _says(429, "Too many requests; wait a second.")
        self.asked.append(now)
        return None


def _says(status: int, sentence: str) -> Response:
    return HTMLResponse(plain_page("Not here", sentence), status_code=status)


def _limited(receive: Receive) -> Callable[[], Awaitable[Message]]:
    """Return what hands a request's body on, and no more of it than is allowed."""
    taken = 0

    async def limited() -> Message:
        nonlocal taken
        message = await receive()
        taken += len(message.get("body", b""))
        if taken > LARGEST_BODY:
            return {"type": "http.disconnect"}
        return message

    return limited
