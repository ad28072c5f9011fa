"""A browser without a window: it sends requests to a page's application, and reads its forms."""

from __future__ import annotations

import asyncio
import re
from dataclasses import dataclass
from html.parser import HTMLParser
from pathlib import Path
from typing import Any
from urllib.parse import urlencode

import cv2
import numpy as np

from virtual_lab.page.server import Page, page_application

HOST, TOKEN = "127.0.0.1:8000", "the-token"


@dataclass(frozen=True)
class Answer:
    status: int
    headers: dict[str, str]
    body: bytes

    @property
    def text(self) -> str:
        return self.body.decode(errors="replace")

    @property
    def words(self) -> str:
        """The text that a user reads or hears, without the shell and Python lines."""
        text = re.sub(r"<(script|style|pre).*?</\1>", " ", self.text, flags=re.DOTALL)
        text = re.sub(r"<code>.*?</code>", " ", text)  # the path of the folder
        said = re.findall(r'(?:aria-label|title|placeholder|alt)="([^"]*)"', text)
        return " ".join([re.sub(r"<[^>]*>", " ", text), *said])


class Visitor:
    """A browser with the cookie of a page, unless it never opened the first address."""

    def __init__(self, folder: Path, *, enters: bool = True) -> None:
        self.quits: list[bool] = []
        self.page = Page(folder, lambda: self.quits.append(True))
        self.door = page_application(self.page, TOKEN, frozenset({HOST}))
        self.cookie = ""
        if enters:
            self.ask(f"/?token={TOKEN}")

    def ask(self, path: str, body: bytes | None = None, method: str = "", **more: str) -> Answer:
        """Send a request; with a body it is a POST from a page of the server."""
        path, _, query = path.partition("?")
        sent = {"host": HOST, "content-length": str(len(body or b"")), "cookie": self.cookie}
        sent |= {"origin": f"http://{HOST}"} | {key.replace("_", "-"): more[key] for key in more}
        scope = {
            "type": "http",
            "method": method or ("GET" if body is None else "POST"),
            "path": path,
            "query_string": query.encode(),
            "headers": [(key.encode(), value.encode()) for key, value in sent.items()],
        }
        got: list[Any] = []

        async def receive() -> dict[str, Any]:
            return {"type": "http.request", "body": body or b""}

        async def send(message: Any) -> None:
            got.append(message)

        for seat in self.door.seats.values():
            seat.request_times.clear()
        asyncio.run(self.door(scope, receive, send))
        headers = {key.decode(): value.decode() for key, value in got[0]["headers"]}
        if "set-cookie" in headers:
            self.cookie = headers["set-cookie"].partition(";")[0]
        body = b"".join(message.get("body", b"") for message in got[1:])
        return Answer(got[0]["status"], headers, body)

    def submit(self, name: str, fields: list[tuple[str, str]]) -> Answer:
        return self.ask(f"/form/{name}", urlencode(fields).encode())


class Form(HTMLParser):
    """The fields of a form, as a browser sends them, and the names of all its controls."""

    def __init__(self, html: str) -> None:
        super().__init__()
        self.sent: list[tuple[str, str]] = []
        self.names: set[str] = set()
        self.select, self.first = "", True
        self.feed(html)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        has = dict(attrs)
        name, value = has.get("name") or "", has.get("value") or ""
        self.names |= {has["data-name"] or ""} if "data-name" in has else set()
        if tag == "select":
            self.select, self.first = name, True
            self.names.add(name)
        elif tag == "option" and self.select and ("selected" in has or self.first):
            if not self.first:
                self.sent.pop()
            self.sent.append((self.select, value))
            self.first = False
        elif tag == "input" and name:
            self.names.add(name)
            if has.get("type") != "checkbox" or "checked" in has:
                self.sent.append((name, value))

    def handle_endtag(self, tag: str) -> None:
        if tag == "select":
            self.select = ""


def clip_of(path: Path, first: int = 0) -> Path:
    """Write frames `first` to 11 of a clip, 320 x 240, of a falling ball: 10 cm, 200 px/m."""
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"MJPG"), 30, (320, 240))
    for number in range(first, 12):
        frame = np.full((240, 320, 3), 60, np.uint8)
        x, y = 40 + 20 * number, 60 + 200 * 9.81 / 2 * (number / 30) ** 2
        at = (x << 8, round(256 * y))  # in 1/256 pixel
        writer.write(cv2.circle(frame, at, 10 << 8, (0, 220, 0), -1, cv2.LINE_AA, 8))
    writer.release()
    return path
