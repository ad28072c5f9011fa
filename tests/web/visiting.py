"""A browser without a window: it sends requests to a page's application, and reads its forms."""

from __future__ import annotations

import re
from html import unescape
from pathlib import Path

import cv2
import numpy as np

from tests.asking import Answer, ask
from virtual_lab.page.server import Page, page_application

HOST, TOKEN = "127.0.0.1:8000", "the-token"


def words_of(answer: Answer) -> str:
    """Return the text that a user reads or hears, without the shell and Python lines."""
    # the content of `code` is the path of the folder
    text = re.sub(r"<(script|style|pre|code).*?</\1>", " ", answer.text, flags=re.DOTALL)
    said = re.findall(r'(?:aria-label|title|placeholder|alt)="([^"]*)"', text)
    return " ".join([re.sub(r"<[^>]*>", " ", text), *said])


class Visitor:
    """A browser that has opened the first address of a page."""

    def __init__(self, folder: Path) -> None:
        self.quits: list[bool] = []
        self.page = Page(folder, lambda: self.quits.append(True))
        self.door = page_application(self.page, TOKEN, frozenset({HOST}))
        self.cookie = ""
        assert self.ask("/").status == 403
        assert self.ask(f"/?token={TOKEN}").headers["location"] == "/"

    def ask(self, path: str, body: bytes | None = None, **more: str) -> Answer:
        """Send a request; with a body it is a POST from a page of the server."""
        method, body = ("GET", b"") if body is None else ("POST", body)
        sent = {"host": HOST, "content-length": str(len(body)), "cookie": self.cookie}
        sent |= {"origin": f"http://{HOST}"} | {key.replace("_", "-"): more[key] for key in more}
        for seat in self.door.seats.values():
            seat.request_times.clear()
        answer = ask(self.door, path, body, method, sent)
        self.cookie = answer.cookie or self.cookie
        return answer


def form_of(html: str) -> tuple[list[tuple[str, str]], set[str]]:
    """Return the fields of a form, as a browser sends them, and the names of all its controls.

    Of a select without a choice the first option is sent.
    """
    sent = []
    for tag in re.findall(r"<input ([^>]*)>", html):
        has = dict(re.findall(r'\b(name|type|value)="(.*?)"', tag))
        if "name" in has and ("checked" in tag or has.get("type") not in ("checkbox", "radio")):
            sent.append((has["name"], unescape(has["value"])))
    select = r'(?s)<select [^>]*name="(.*?)".*?>(.*?)</select>'
    for name, options in re.findall(select, html):
        every = re.findall(r'<option value="(.*?)"( selected)?', options)
        sent.append((name, unescape(([each for each, on in every if on] or every[0])[0])))
    control = r'<(?:input|select|div class="choices") (?:[^>]*? )?(?:data-)?name="(.*?)"'
    return sent, set(re.findall(control, html))


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
