"""A worker process: ``python -m virtual_lab.processes.worker WORDS``; the words identify it.

It reads pickled calls from its standard input and answers each with a pickle. It ends when its
input ends, so it never outlives the process that started it.
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
    """Read pickled calls from stdin and write a pickled answer to each on stdout. Never return.

    An answer is (result, None), or (None, exception) if the call failed. The process ends when
    stdin ends.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C ends the parent, which ends this process
    calls: SimpleQueue[bytes] = SimpleQueue()
    Thread(target=_hear, args=(calls,), daemon=True).start()
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # output of libraries must not mix with the answers
    answer: tuple[Any, Exception | None]
    while True:
        try:
            function, arguments = pickle.loads(calls.get())
            answer = function(*arguments), None
        except Exception as fault:  # the parent raises it
            answer = None, fault
        pickle.dump(answer, answers)
        answers.flush()


def _hear(calls: SimpleQueue[bytes]) -> None:
    """Put incoming calls into the queue. End this process at once when the input ends."""
    while length := sys.stdin.buffer.read(8):
        calls.put(sys.stdin.buffer.read(int.from_bytes(length, "big")))
    remove_drafts()
    os._exit(0)


if __name__ == "__main__":
    work()
