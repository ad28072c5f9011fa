"""A worker process: ``python -m virtual_lab.processes.worker WORDS``, the words for who looks.

It takes pickled calls from its standard input and answers each with a pickle. It ends with that
input, so it never outlives the one that started it, however that one ended.
"""

from __future__ import annotations

import os
import pickle
import signal
import sys
from queue import SimpleQueue
from threading import Thread
from typing import Any

from virtual_lab.files.drafts import remove_drafts


def work() -> None:
    """Answer the calls that come in; end when no more can come."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C ends the parent, and that this one
    asked: SimpleQueue[bytes] = SimpleQueue()
    Thread(target=_hear, args=(asked,), daemon=True).start()
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # what a library prints is no answer
    answer: tuple[Any, Exception | None]
    while True:
        try:
            function, arguments = pickle.loads(asked.get())
            answer = function(*arguments), None
        except Exception as fault:  # for the parent to raise
            answer = None, fault
        pickle.dump(answer, answers)
        answers.flush()


def _hear(asked: SimpleQueue[bytes]) -> None:
    """Pass on what comes in; its end ends this process at once, whatever it is about."""
    while length := sys.stdin.buffer.read(8):
        asked.put(sys.stdin.buffer.read(int.from_bytes(length, "big")))
    remove_drafts()
    os._exit(0)


if __name__ == "__main__":
    work()
