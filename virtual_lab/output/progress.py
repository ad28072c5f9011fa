"""Progress of long computations: amount done, rate, and time left.

On a terminal one line is updated; in a pipe a line is written every ten seconds, so that a log
shows that the program is running. While a kernel is compiled, the line names it. Computations of
less than two seconds show nothing.
"""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from shutil import get_terminal_size
from typing import Protocol, TextIO

PATIENCE = 2.0  # time before the first line on a terminal [s]
TERMINAL_STEP, PIPE_STEP = 0.2, 10.0  # times between two lines [s]
CLEAR_LINE = "\r\x1b[K"


class Progress(Protocol):
    """Callback for the present task and, if items are counted, the number done and the total."""

    def __call__(self, text: str, done: int = 0, total: int = 0) -> None: ...


class _Quiet:
    """Shows nothing."""

    def __call__(self, text: str, done: int = 0, total: int = 0) -> None:
        pass

    def __repr__(self) -> str:
        return "quiet"


quiet = _Quiet()


@contextmanager
def show_progress(stream: TextIO | None = None) -> Iterator[Progress]:
    """Yield a `Progress` that writes to a stream, by default stderr, until the context ends.

    Without a stream, as in a program without a terminal, nothing is written.
    """
    stream = stream or sys.stderr
    if stream is None:  # a program without a terminal has no stderr
        yield quiet
        return
    status, over = _Status(), threading.Event()
    writer = threading.Thread(target=_write, args=(status, stream, over), daemon=True)
    writer.start()
    try:
        yield status.update
    finally:
        over.set()
        writer.join()


class _Status:
    """The last message, and the start time of the present task."""

    def __init__(self) -> None:
        self.begun = self.since = time.monotonic()
        self.text, self.done, self.total, self.first = "", 0, 0, 0

    def update(self, text: str, done: int = 0, total: int = 0) -> None:
        if (text, total) != (self.text, self.total):
            self.since, self.first = time.monotonic(), done
        self.text, self.done, self.total = text, done, total

    def line(self) -> str:
        now = time.monotonic()
        if not self.total:
            return f"{self.text or 'working'}, {_duration(now - self.begun)}"
        line = f"{self.text}: {self.done} of {self.total}"
        if self.done > self.first and now > self.since:
            rate = (self.done - self.first) / (now - self.since)
            remaining = (self.total - self.done) / rate
            line += f", {_rate(rate)}, {_duration(remaining)} left"
        return line


def _write(status: _Status, stream: TextIO, over: threading.Event) -> None:
    terminal = stream.isatty()
    if over.wait(PATIENCE if terminal else PIPE_STEP):
        return
    while True:
        line = f"… {status.line()}{_compilation()}"
        if terminal:
            line = CLEAR_LINE + line[: get_terminal_size().columns - 1]
        try:
            print(line, end="" if terminal else "\n", file=stream, flush=True)
            if over.wait(TERMINAL_STEP if terminal else PIPE_STEP):
                if terminal:
                    print(CLEAR_LINE, end="", file=stream, flush=True)
                return
        except (OSError, ValueError):  # the reader has closed the stream
            return


def _compilation() -> str:
    """Return the words of a line about the present compilation, empty if there is none."""
    if not hasattr(sys.modules.get("numba"), "njit"):  # not loaded, and slow to load
        return ""
    from virtual_lab.output.compiling import COMPILED

    return "".join(f", compiling {name} (first run only)" for name in COMPILED.names[:1])


def _rate(rate: float) -> str:
    """Return the rate per second or, for slow work, per minute."""
    return f"{rate:.3g} per second" if rate >= 1 else f"{60 * rate:.3g} per minute"


def _duration(seconds: float) -> str:
    whole = round(seconds)
    hours, minutes = divmod(whole // 60, 60)
    if hours:
        return f"{hours} h {minutes:02d} min"
    return f"{minutes} min {whole % 60:02d} s" if minutes else f"{whole} s"
