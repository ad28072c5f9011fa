"""The door of a web application: it decides which requests come from a browser that may see it.

Every request is checked first. Its host name must be allowed, its origin must be a page of this
server, and it must have the cookie. The first address contains a one-time token, and the server
sets the cookie when this address is opened.
"""

from __future__ import annotations

import secrets
import time
from collections import deque
from collections.abc import Collection, Mapping
from contextlib import suppress
from dataclasses import dataclass, field

from starlette.datastructures import MutableHeaders
from starlette.requests import ClientDisconnect, Request
from starlette.responses import RedirectResponse, Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from virtual_lab.web.answers import sentence_page

LARGEST_BODY = 64 * 1024  # largest request [B]
MOST_A_SECOND = 20  # largest rate of requests per session [1/s]
OPEN_TO_ALL = {"/base.css", "/icon.svg"}
HEADERS = {
    "Content-Security-Policy": "default-src 'self'; base-uri 'none'; form-action 'self'; "
    "frame-ancestors 'none'",
    "X-Content-Type-Options": "nosniff",
    "Cache-Control": "no-store",
    "Referrer-Policy": "same-origin",  # with no-referrer a browser's POST has the origin null
}


@dataclass(kw_only=True)
class Seat:
    """A signed-in browser, and the times of its last requests."""

    request_times: deque[float] = field(default_factory=lambda: deque(maxlen=MOST_A_SECOND))


class Door:
    """Access control in front of an application, which also adds headers to each response.

    Parameters
    ----------
    inside
        The application. In its requests ``scope["seat"]`` is the seat of the browser.
    seats
        The seats, keyed by token. The token is part of the address that opens the first page.
    hosts
        Host names with port under which the pages are served, such as ``127.0.0.1:8000``. At least
        one. A request to another name is answered with status 403.
    secure
        Whether TLS is used.
    starts
        Paths that may be the first page, in addition to ``/``.
    """

    once = "Open the address that the command printed. It works once, in one browser."

    def __init__(
        self,
        inside: ASGIApp,
        seats: Mapping[str, Seat],
        *,
        hosts: frozenset[str],
        secure: bool = False,
        starts: Collection[str] = (),
    ) -> None:
        self.inside, self.hosts, self.secure, self.starts = inside, hosts, secure, starts
        self.codes = dict(seats)
        self.seats: dict[str, Seat] = {}  # seats by cookie
        # browsers share cookies between ports
        self.cookie = "seat-" + min(hosts).rpartition(":")[2]

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

        refused = self.refuse_request(request) or self.enter(request) or self.refuse_seat(request)
        with suppress(ClientDisconnect):  # the client no longer waits
            await (refused or self.inside)(scope, receive, send_with_headers)

    def refuse_request(self, request: Request) -> Response | None:
        """Return the rejection of a wrong host or origin, or of too long a request; else None."""
        if request.headers.get("host", "") not in self.hosts:
            return sentence_page(403, "This address is not served here.")
        if request.method == "POST":
            scheme = "https" if self.secure else "http"
            if request.headers.get("origin") not in {f"{scheme}://{name}" for name in self.hosts}:
                return sentence_page(403, "A request must come from a page of this server.")
            length = request.headers.get("content-length", "")
            if "transfer-encoding" in request.headers:  # the length is unknown in advance
                return sentence_page(411, "A request must state its length, and come whole.")
            most = self.largest_body(request)
            if not length.isdigit() or int(length) > most:
                return sentence_page(413, f"A request may have at most {most} bytes.")
        return None

    def largest_body(self, _: Request) -> int:
        """Return the largest length of a request [B]."""
        return LARGEST_BODY

    def enter(self, request: Request) -> Response | None:
        """Return the answer to a request with a token, or None without one.

        A token is valid once, unless `readmits` is True of its seat. A request that only looks at
        the address, or fetches the page in advance, does not use the token.
        """
        token = _find_key(self.codes, request.query_params.get("token", ""))
        early = "prefetch" in request.headers.get("sec-purpose", "")
        if token is None or early or request.method != "GET":
            return None
        seat = self.codes[token]
        if not self.readmits(seat):
            del self.codes[token]
        for earlier in [session for session, occupied in self.seats.items() if occupied is seat]:
            del self.seats[earlier]  # the earlier browser must not continue
            self.note_replacement(seat)
        session = secrets.token_urlsafe(32)
        self.seats[session] = seat
        to = request.url.path if request.url.path in self.starts else "/"
        answer = RedirectResponse(to, status_code=303)
        answer.set_cookie(
            self.cookie, session, httponly=True, samesite="strict", secure=self.secure
        )
        return answer

    def readmits(self, _: Seat) -> bool:
        """Return whether the token of a seat stays valid after its first use."""
        return False

    def note_replacement(self, seat: Seat) -> None:
        """Take note that a second browser took a seat from the first one."""

    def refuse_seat(self, request: Request) -> Response | None:
        """Return the rejection of a request without a cookie, or of too many; else None."""
        session = _find_key(self.seats, request.cookies.get(self.cookie, ""))
        if session is None:
            return None if request.url.path in OPEN_TO_ALL else self.stranger(request)
        seat = request.scope["seat"] = self.seats[session]
        now = time.monotonic()
        if len(seat.request_times) == MOST_A_SECOND and now - seat.request_times[0] < 1:
            return sentence_page(429, "Too many requests. Wait a second, then go back.")
        seat.request_times.append(now)
        return None

    def stranger(self, _: Request) -> Response:
        """Return the answer to a browser without a seat."""
        return sentence_page(403, self.once)


def _find_key(keys: Mapping[str, object], text: str) -> str | None:
    """Return the key that equals `text`, or None. The comparison takes constant time."""
    matches = [key for key in keys if secrets.compare_digest(key.encode(), text.encode())]
    return matches[0] if matches else None
