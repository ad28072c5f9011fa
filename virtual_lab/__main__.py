"""The command line, ``virtual-lab`` or ``python -m virtual_lab``. A signal ends it at once."""

from __future__ import annotations

import os
import signal
import sys
from contextlib import suppress
from pathlib import Path

from virtual_lab.files.drafts import remove_drafts

STOPS = ("SIGINT", "SIGTERM", "SIGHUP")  # Ctrl-C, kill, a closed terminal


def main() -> None:
    """Run the command line. The exit code after a stop signal is 128 plus the signal's number."""
    for stop in signal.Signals:
        # A program that was started with nohup, or with & in a script, ignores some signals.
        if stop.name in STOPS and signal.getsignal(stop) is not signal.SIG_IGN:
            signal.signal(stop, _end)
    from virtual_lab.cli import main as run

    run()


def main_of_page() -> None:
    """Open the page of all commands, without a terminal: results are in the user's home folder."""
    if sys.stdout is None:  # after a double click on Windows; the server asks what it is
        sys.stdout = open(os.devnull, "w", encoding="utf-8")  # noqa: SIM115
    sys.argv[1:] = ["open", *(sys.argv[1:] or [str(Path.home() / "virtual-lab")])]
    main()


def _end(number: int, _: object) -> None:
    """Remove partly written files and end at once.

    No exception is raised. In a callback of compiled code, a finalizer or an import, it would be
    lost or become another exception.
    """
    remove_drafts()
    with suppress(OSError):
        os.write(2, b"virtual-lab: interrupted\n")
    os._exit(128 + number)


if __name__ == "__main__":
    main()
