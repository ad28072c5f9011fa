"""``virtual-lab`` and ``python -m virtual_lab``: the command line, which ends when asked to."""

from __future__ import annotations

import os
import signal
from contextlib import suppress

from virtual_lab.files.drafts import remove_drafts

STOPS = ("SIGINT", "SIGTERM", "SIGHUP")  # Ctrl-C, kill, a closed terminal


def main() -> None:
    """Run the command line; a signal to stop ends it with 128 and the signal's number."""
    for stop in signal.Signals:
        # a program that starts with nohup, or with & in a script, ignores some of them
        if stop.name in STOPS and signal.getsignal(stop) is not signal.SIG_IGN:
            signal.signal(stop, _end)
    from virtual_lab.cli import main as run

    run()


def _end(number: int, _: object) -> None:
    """Remove what is half-written and end at once.

    An exception would have to find its way out of wherever the program is, and in a callback of
    compiled code, a finaliser or an import it gets lost or becomes another one.
    """
    remove_drafts()
    with suppress(OSError):
        os.write(2, b"virtual-lab: interrupted\n")
    os._exit(128 + number)


if __name__ == "__main__":
    main()
