"""Requests straight to a web application, without a server or a network."""

from __future__ import annotations

import asyncio
from typing import Any, NamedTuple


class Answer(NamedTuple):
    """An answer of a web application."""

    status: int
    headers: dict[str, str]
    body: bytes

    @property
    def text(self) -> str:
        return self.body.decode(errors="replace")

    @property
    def cookie(self) -> str:
        """The cookie that the answer sets, or an empty string."""
        return self.headers.get("set-cookie", "").partition(";")[0]


def ask(
    application: Any, path: str, body: bytes, method: str, headers: dict[str, str], **message: Any
) -> Answer:
    """Send a request. `message` is what the application receives in place of the body."""
    path, _, query = path.partition("?")
    scope = {
        "type": "http",
        "method": method,
        "path": path,
        "query_string": query.encode(),
        "headers": [(key.encode(), value.encode()) for key, value in headers.items()],
    }
    got: list[Any] = []

    async def receive() -> dict[str, Any]:
        return message or {"type": "http.request", "body": body}

    async def send(message: Any) -> None:
        got.append(message)

    asyncio.run(application(scope, receive, send))
    answer = {key.decode(): value.decode() for key, value in got[0]["headers"]}
    return Answer(got[0]["status"], answer, b"".join(each.get("body", b"") for each in got[1:]))
