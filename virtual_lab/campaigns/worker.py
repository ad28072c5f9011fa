"""A worker process of a campaign: ``python -m virtual_lab.campaigns.worker FOLDER``.

It takes numbers of blocks from its standard input and answers each with a pickle. It ends with
that input, so it never outlives the one that started it, however that one ended.
"""

from __future__ import annotations

import os
import pickle
import signal
import sys
from queue import SimpleQueue
from threading import Thread

from virtual_lab.files.drafts import remove_drafts


def work() -> None:
    """Make the blocks whose numbers come in, a line each; end when no more can come."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C ends the parent, and that this one
    asked: SimpleQueue[int] = SimpleQueue()
    Thread(target=_hear, args=(asked,), daemon=True).start()
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # what a library prints is no answer
    from virtual_lab.campaigns.workers import make_part

    while True:
        pickle.dump(make_part(sys.argv[1], asked.get()), answers)
        answers.flush()


def _hear(asked: SimpleQueue[int]) -> None:
    """Pass on what comes in; its end ends this process at once, whatever it is about."""
    for line in sys.stdin:
        asked.put(int(line))
    remove_drafts()
    os._exit(0)


if __name__ == "__main__":
    work()
