"""Progress of long computations: amount done, and time left.

On a terminal and in a notebook one line with a bar is updated (a saved notebook keeps it as one
output, empty at the end); in a pipe a line is written every
ten seconds, so that a log shows that the program is running. While a kernel is compiled, the line
names it. Computations of less than two seconds show nothing, and load no tqdm.
"""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from importlib import import_module
from io import StringIO
from shutil import get_terminal_size
from typing import Protocol, TextIO

PATIENCE = 2.0  # time before the first bar [s]
BAR_STEP, PIPE_STEP = 0.2, 10.0  # times between two bars, and between two lines in a pipe [s]
COUNTED = "{n_fmt} of {total_fmt}{postfix}"
BAR, LINE = f"{{desc}} |{{bar}}| {COUNTED}", f"{{desc}}: {COUNTED}"  # formats of tqdm


class Progress(Protocol):
    """Callback for the current task and, if items are counted, the number done and the total.

    While the text is empty, nothing is shown, for example while a page is served.
    """

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

    If there is no stderr, as in a program without a terminal, nothing is written.
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
    """The last message, and the start time of the current task."""

    def __init__(self) -> None:
        self.begun = self.since = time.monotonic()
        self.text, self.done, self.total, self.first, self.steady = "working", 0, 0, 0, False

    def update(self, text: str, done: int = 0, total: int = 0) -> None:
        is_new = (text, total) != (self.text, self.total)
        if is_new or (done > self.first and not self.steady):
            # the first part of a task is not timed: a kernel may have been compiled for it
            self.since, self.first, self.steady = time.monotonic(), done, not is_new
        self.text, self.done, self.total = text, done, total

    def _time_left(self, elapsed: float) -> str:
        """Return the time left in words, empty if nothing was counted in `elapsed` seconds."""
        done = self.done - self.first
        if not (self.total and done):
            return ""
        seconds = elapsed / done * (self.total - self.done)
        units = {"h": 3600, "min": 60, "s": 1}
        unit = next((each for each, size in units.items() if seconds >= 1.5 * size), "s")
        return f"about {seconds / units[unit]:.0f} {unit} left"

    def line(self, counted: str, width: int | None = None, *, plain: bool = False) -> str:
        """Return the line of the current task.

        `counted` is tqdm's format for a task that is counted. Any other task shows its duration. A
        bar fills the line of `width` characters. It is drawn in ASCII if `plain`.
        """
        from tqdm import tqdm

        elapsed = time.monotonic() - (self.since if self.total else self.begun)
        return str(
            tqdm.format_meter(
                self.done,
                self.total,
                elapsed,
                ncols=width,
                prefix=self.text,
                ascii=plain,
                bar_format=counted if self.total else "{desc}, {elapsed}{postfix}",
                postfix=", ".join(filter(None, (self._time_left(elapsed), _compilation()))),
                initial=self.first,
            )
        )


def _write(status: _Status, stream: TextIO, over: threading.Event) -> None:
    notebook = type(stream).__module__.startswith("ipykernel")
    bar = stream.isatty() or notebook
    write = _write_bar if bar else _write_lines
    if not over.wait(PATIENCE if bar else PIPE_STEP):
        with suppress(OSError, ValueError):  # the reader has closed the stream
            write(status, _CellOutput() if notebook else stream, over)


class _CellOutput(StringIO):
    """An output of a notebook's cell that shows the last text written."""

    def __init__(self) -> None:
        super().__init__()
        display = import_module("IPython.display").display
        self.update = display({"text/plain": ""}, raw=True, display_id=True).update

    def write(self, text: str) -> int:
        if text:
            self.update({"text/plain": text.strip()}, raw=True)
        return len(text)


def _write_bar(status: _Status, stream: TextIO, over: threading.Event) -> None:
    """Update one line with a bar until the end, and remove it."""
    plain = not (stream.encoding or "utf-8").lower().startswith("utf")
    line = ""
    while True:
        width, before = get_terminal_size().columns - 1, line
        line = status.line(BAR, width, plain=plain) if status.text else ""
        if line or before:
            print("\r" + line[:width].ljust(width), end="", file=stream, flush=True)
        if over.wait(BAR_STEP):
            print("\r" + " " * width, end="\r", file=stream, flush=True)
            return


def _write_lines(status: _Status, stream: TextIO, over: threading.Event) -> None:
    """Write a line every ten seconds until the end."""
    while True:
        if status.text:
            print(f"… {status.line(LINE)}", file=stream, flush=True)
        if over.wait(PIPE_STEP):
            return


def _compilation() -> str:
    """Return the words of a line about the current compilation, empty if there is none."""
    if not hasattr(sys.modules.get("numba"), "njit"):  # numba, which loads slowly, is not loaded
        return ""
    from virtual_lab.output.compiling import COMPILED

    return "".join(f"compiling {name} (first run only)" for name in COMPILED.names[:1])
