"""The server killed at random moments: no answered action is lost, the day is the same."""

from __future__ import annotations

import http.client
import json
import os
import random
import re
import signal
import threading
import time
from contextlib import closing
from dataclasses import asdict
from multiprocessing import get_context
from pathlib import Path
from urllib.parse import urlencode

import pytest

from tests.bench.browsing import SEED, free_port
from tests.bench.days import PLAIN, Asked, day_of
from virtual_lab.bench.day.log import DayLog
from virtual_lab.bench.day.scenario import load_scenario
from virtual_lab.bench.entrance.served_day import ServedDay
from virtual_lab.bench.machines.stored_day import LOG
from virtual_lab.bench.web.server import application

FEW, MANY = 4, 100
LONGEST = 0.35  # s until a server is killed


def serve(folder: Path, port: int) -> None:
    import uvicorn

    day = ServedDay(folder, load_scenario("plain-day"), SEED)
    day.open()
    app = application({"token": day}, hosts=frozenset({f"127.0.0.1:{port}"}))
    uvicorn.run(app, port=port, log_level="critical")


def asked_until_killed(port: int, entries: list[Asked], begun: int) -> int:
    """Ask for one entry after the other; return how many were answered when the server died."""
    answered = begun
    with closing(connected(port)) as line:
        try:
            line.request("GET", "/?token=token")
            reply = line.getresponse()
            reply.read()
            cookie = reply.headers["set-cookie"].partition(";")[0]
            for number, (name, given) in enumerate(entries[begun:], begun + 1):
                form = urlencode({"do": name, "entry_number": number, **given})
                line.request(
                    "POST",
                    "/do",
                    form,
                    {"cookie": cookie, "origin": f"http://127.0.0.1:{port}"},
                )
                reply = line.getresponse()
                text = reply.read().decode()
                if reply.status == 429:
                    time.sleep(0.2)
                    return answered
                assert reply.status == 303, re.findall(r'role="alert".*', text)
                answered = number
        except (OSError, http.client.HTTPException):
            pass
    return answered


def connected(port: int) -> http.client.HTTPConnection:
    line = http.client.HTTPConnection("127.0.0.1", port, timeout=20)
    for _ in range(2000):
        try:
            line.connect()
        except OSError:
            time.sleep(0.005)
        else:
            return line
    raise TimeoutError("no server")


@pytest.mark.filterwarnings("ignore:.*fork:DeprecationWarning")
@pytest.mark.parametrize("kills", [FEW, pytest.param(MANY, marks=pytest.mark.long)])
def test_a_killed_server_loses_no_answered_action(tmp_path: Path, kills: int) -> None:
    whole = day_of(PLAIN)  # and what is compiled is loaded before the first fork
    moments = random.Random(kills)
    folder, number, days = tmp_path / "day-0", 0, 0
    for _ in range(kills):
        port = free_port()
        server = get_context("fork").Process(target=serve, args=(folder, port), daemon=True)
        server.start()
        assert server.pid is not None
        with closing(connected(port)):
            pass
        death = threading.Timer(moments.uniform(0, LONGEST), os.kill, (server.pid, signal.SIGKILL))
        death.start()
        answered = asked_until_killed(port, list(PLAIN), number)
        server.join()
        events = DayLog(folder / LOG).events()
        number = len(events)
        assert number - answered in (0, 1)  # one may be on disk whose answer was on its way
        assert [json.dumps(asdict(each)) for each in events] == [
            json.dumps(asdict(each)) for each in whole.events[:number]
        ]
        if number == len(PLAIN):
            days += 1
            folder, number = tmp_path / f"day-{days}", 0
    assert number + days > 0
