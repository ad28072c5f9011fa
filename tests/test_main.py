"""The program and the signals that stop it, in real processes at any stage."""

import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

STOPS = {signal.SIGINT: 130, signal.SIGTERM: 143, signal.SIGHUP: 129}
# program with a replaced command line; signals work even if pytest ignores them (nohup)
PROGRAM = """
import os, signal, sys, time
from pathlib import Path
signal.signal(signal.SIGINT, signal.default_int_handler)
for stop in (signal.SIGTERM, signal.SIGHUP):
    signal.signal(stop, signal.SIG_DFL)
import virtual_lab.__main__ as program, virtual_lab.cli
def sleep():  # in steps: Python 3.14 does not look for a signal between `print` and `sleep`
    for _ in range(600):
        time.sleep(0.1)
def run():
    {body}
if {replaced}:
    virtual_lab.cli.main = run
{before}
program.main()
"""
BUSY = {
    "a draft": """
    from virtual_lab.files import new_folder
    with new_folder(Path("out")) as draft:
        (draft / "half.txt").write_text("half of a certificate")
        print("ready", flush=True)
        sleep()""",
    "a compilation": """
    from numba import njit
    njit(lambda x: x + 1)(1.0)
    print("ready", flush=True)
    while True:
        njit(lambda x: x + 1)(1.0)""",
    # code in which an exception is printed and ignored
    "a finaliser": """
    class Last:
        def __del__(self):
            print("ready", flush=True)
            end = time.monotonic() + 60
            while time.monotonic() < end:
                pass
    Last()""",
    # code in which an exception becomes another one
    "a handler of errors": """
    try:
        print("ready", flush=True)
        sleep()
    except BaseException as fault:
        raise ValueError("cannot be read") from fault""",
}


def start(folder: Path, *words: str, body: str = "", before: str = "") -> subprocess.Popen[str]:
    text = PROGRAM.format(body=body or "pass", replaced=bool(body), before=before)
    return subprocess.Popen(
        [sys.executable, "-c", text, *words],
        cwd=folder,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


@pytest.mark.parametrize(
    ("busy", "stop"),
    [
        *(("a draft", stop) for stop in STOPS),
        ("a compilation", signal.SIGINT),
        ("a finaliser", signal.SIGINT),
        ("a handler of errors", signal.SIGTERM),
    ],
)
def test_a_signal_stops_the_program_at_any_stage(
    busy: str, stop: signal.Signals, tmp_path: Path
) -> None:
    """The exit code is that of the signal; there is one line and nothing half-written."""
    with start(tmp_path, body=BUSY[busy]) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "ready\n"
        process.send_signal(stop)
        _, err = process.communicate(timeout=30)
    assert (process.returncode, err) == (STOPS[stop], "virtual-lab: interrupted\n")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("words", "stop", "after"),
    [
        ("certify r161 --out out", signal.SIGINT, 0.3),
        ("coverage r161", signal.SIGTERM, 1.5),
    ],
)
def test_a_signal_stops_a_command(
    words: str, stop: signal.Signals, after: float, tmp_path: Path
) -> None:
    """A command stops during imports or compilation, and reports no fault of its own."""
    with start(tmp_path, *words.split(), before="print('ready', flush=True)") as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "ready\n"
        time.sleep(after)
        process.send_signal(stop)
        out, err = process.communicate(timeout=60)
    assert (process.returncode, out, err) == (STOPS[stop], "", "virtual-lab: interrupted\n")
    assert list(tmp_path.iterdir()) == []


def test_an_ignored_signal_does_not_stop_the_program(tmp_path: Path) -> None:
    """The case is ``nohup virtual-lab coverage … &`` after the terminal closes."""
    body = "os.kill(os.getpid(), signal.SIGHUP); print('still here')"
    before = "signal.signal(signal.SIGHUP, signal.SIG_IGN)"
    with start(tmp_path, body=body, before=before) as process:
        assert process.communicate(timeout=30) == ("still here\n", "")
    assert process.returncode == 0
