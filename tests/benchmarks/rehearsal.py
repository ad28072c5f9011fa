"""Response times of the rehearsal bench: ``python -m tests.benchmarks.rehearsal``.

The command is started as by a trainee, and forms are sent as by a browser. The time of an action
runs from its form to the next page. Then eight trainees take the day at once, and twenty hand in at
once while another one continues. The last line has the time of a numpy normal, which shows
whether the machine is loaded.
"""

from __future__ import annotations

import http.client
import os
import re
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from statistics import median, quantiles
from urllib.parse import urlencode, urlsplit

import numpy as np

from tests.bench.browsing import FOCUSED, free_port, opened, served
from tests.bench.days import PLAIN

TRAINEES = 8
MANY = 20  # number of trainees who hand in at once
SALVO = 7  # shots in one salvo
KINDS = {"fire": "shot", "reduce": "reduce"}
END = (("reduce", {}), ("give-verdict", {"verdict": "PASS"}), ("hand-in", {}))
AGAIN = 47  # actions, with five hits among them, until a day is interrupted and resumed
PACE = 0.12  # time between actions of a trainee [s], below the limit of requests
KEYS = 26  # actions of a day by the book
LOOK = 4.0  # pause at the first page [s]
LATER = 0.3  # pause before a debrief is requested again [s]
TOGETHER = 0.5  # time between actions with many trainees [s]
GOALS = {  # median and worst [ms]
    "first page": (2000, 2000),
    "first page, again": (2000, 2000),  # day that is resumed after five hits
    "first entry": (200, 200),  # action after a look at the page
    "entry": (50, 200),
    "shot": (500, 500),
    "reduce": (500, 500),
    "certificate": (1500, 1500),
    "key to loaded page": (60, None),  # time in Chromium; 95 of 100 within 200
    f"entry, {TRAINEES} at once": (500, None),
    f"shot, {TRAINEES} at once": (500, None),
    "salvo, a shot": (100, None),
    f"entry, {MANY} debriefs at once": (200, None),  # entry in another day
    f"{MANY} debriefs at once, all": (5000, 5000),
}
LARGEST = 500  # memory of the server with MANY days [MB]


class Trainee:
    """Client that sends forms with the cookie of its address."""

    def __init__(self, address: str, pace: float) -> None:
        parts, self.pace = urlsplit(address), pace
        self.host, self.path, self.cookie = parts.netloc, f"/?{parts.query}", ""
        self.line = http.client.HTTPConnection(self.host, timeout=60)

    def ask(self, method: str, path: str, body: str = "") -> str:
        headers = {"cookie": self.cookie, "origin": f"http://{self.host}"}
        self.line.request(method, path, body, headers)
        reply = self.line.getresponse()
        text = reply.read().decode()
        if set_cookie := reply.headers["set-cookie"]:
            self.cookie = set_cookie.partition(";")[0]
        assert reply.status in {200, 202, 303}, (reply.status, re.findall(r'role="alert".*', text))
        if reply.status == 202:  # debrief in preparation: the page reloads itself
            time.sleep(LATER)
            return self.ask(method, path, body)
        return self.ask("GET", "/") if reply.status == 303 else text

    def do(self, number: int, name: str, fields: dict[str, object]) -> float:
        """Return the time of an action [s], up to the next page."""
        begun = time.perf_counter()
        page = self.ask("POST", "/do", urlencode({"do": name, "entry_number": number, **fields}))
        took = time.perf_counter() - begun
        after = self.number(page)
        assert after > number if name == "fire-shots" else after in {0, number + 1}
        time.sleep(max(0.0, self.pace - took))
        return took

    @staticmethod
    def number(page: str) -> int:
        """Return the number of the next entry, 0 after the day was handed in."""
        match = re.search(r'name="entry_number" value="(\d+)"', page)
        return int(match[1]) if match else 0

    def day(self, done: int = 0) -> Iterator[tuple[str, float]]:
        """Take the rest of the plain day, and yield the kind and time [s] of each action."""
        for number, (name, fields) in enumerate((*PLAIN, *END)[done:], done + 1):
            if name == "hand-in":
                begun = time.perf_counter()
                self.ask("GET", "/certificate")
                yield "certificate", time.perf_counter() - begun
            yield KINDS.get(name, "entry"), self.do(number, name, fields)


@contextmanager
def rehearsal(folder: str, *more: str) -> Iterator[tuple[list[str], float, int]]:
    """Start the command; yield its addresses, its time of start [s] and its process id."""
    command = [sys.executable, "-m", "virtual_lab", "rehearse", "--seed", "3", "--port"]
    started = time.perf_counter()
    server = subprocess.Popen(
        [*command, str(free_port()), "--day", f"{folder}/day", *more],
        stderr=subprocess.PIPE,
        text=True,
        env={**os.environ, "OPENBLAS_NUM_THREADS": "1"},
    )
    assert server.stderr is not None
    addresses: list[str] = []
    for line in server.stderr:
        addresses += re.findall(r"http\S+", line)
        if "Ctrl-C" in line:
            break
    try:
        yield addresses, started, server.pid
    finally:
        server.terminate()
        server.wait()


def first_page(addresses: list[str], started: float, _: int) -> tuple[Trainee, float]:
    """Open the first page; return the trainee, and the time since the command [s]."""
    trainee = Trainee(addresses[0], PACE)
    trainee.ask("GET", trainee.path)
    took = time.perf_counter() - started
    trainee.line.close()
    time.sleep(LOOK)
    return trainee, took


def by_key(folder: Path) -> list[float]:
    """Take the plain day by the Enter key in Chromium; return the times to each loaded page [s]."""
    took = []
    with served(folder) as (_, address), opened() as browser:
        page = browser.new_page(viewport={"width": 1280, "height": 800})
        page.goto(address)
        for _ in range(KEYS):
            page.wait_for_selector(FOCUSED, state="attached")
            begun = time.perf_counter()
            with page.expect_navigation(wait_until="load"):
                page.keyboard.press("Enter")
            took.append(time.perf_counter() - begun)
    return took


def handed_in_at_once(folder: str) -> tuple[dict[str, list[float]], float]:
    """Let many trainees fire, hand in and open the debrief at once, while another continues.

    Return times by kind [s], and then the memory of the server [MB].
    """
    times: dict[str, list[float]] = {name: [] for name in list(GOALS)[-3:]}
    salvo, entry, all_of_them = times
    with rehearsal(folder, "--trainees", str(MANY + 1)) as (addresses, _, process):
        time.sleep(8)
        *trainees, other = [Trainee(address, TOGETHER) for address in addresses]
        for trainee in (*trainees, other):
            trainee.ask("GET", trainee.path)
        preparing = PLAIN[: PLAIN.index(("load-ball", {"ball": 1}))]
        for trainee in trainees:
            trainee.line.close()  # connection that the server closed in the meantime
            trainee.pace = PACE
            for number, (name, fields) in enumerate(preparing, 1):
                trainee.do(number, name, fields)
            fields = {"shots": SALVO, "accept": "yes"}
            times[salvo].append(trainee.do(len(preparing) + 1, "fire-shots", fields) / SALVO)
            next_one = trainee.number(trainee.ask("GET", "/"))
            for number, (name, fields) in enumerate(END, next_one):
                trainee.do(number, name, fields)
        for each in (*trainees, other):
            each.line.close()
        begun = time.perf_counter()
        threads = [threading.Thread(target=each.ask, args=("GET", "/debrief")) for each in trainees]
        for thread in threads:
            thread.start()
        for number, (name, fields) in enumerate(PLAIN[:8], 1):
            if any(thread.is_alive() for thread in threads):
                times[entry].append(other.do(number, name, fields))
        for thread in threads:
            thread.join()
        times[all_of_them].append(time.perf_counter() - begun)
        status = Path(f"/proc/{process}/status").read_text("utf-8")
        return times, int(re.findall(r"VmRSS:\s+(\d+)", status)[0]) / 1e3


def main() -> None:
    """Measure and print."""
    times: dict[str, list[float]] = {name: [] for name in GOALS}
    for _ in range(3):
        with tempfile.TemporaryDirectory() as place:
            with rehearsal(place) as begun:
                trainee, took = first_page(*begun)
                times["first page"].append(took)
                for number, (name, fields) in enumerate(PLAIN[:AGAIN], 1):
                    took = trainee.do(number, name, fields)
                    times[KINDS.get(name, "entry") if number > 1 else "first entry"].append(took)
            with rehearsal(place) as begun:
                trainee, took = first_page(*begun)
                times["first page, again"].append(took)
                for kind, took in trainee.day(AGAIN):
                    times[kind].append(took)
    eight = ("--trainees", str(TRAINEES))
    with tempfile.TemporaryDirectory() as place, rehearsal(place, *eight) as (addresses, *_):
        trainees = [Trainee(address, TOGETHER) for address in addresses]
        actions: list[list[tuple[str, float]]] = [[] for _ in trainees]

        def take(number: int) -> None:
            trainees[number].ask("GET", trainees[number].path)
            actions[number] += trainees[number].day()

        threads = [threading.Thread(target=take, args=(n,)) for n in range(TRAINEES)]
        time.sleep(8)
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        lost = sum(len(each) != len(PLAIN) + len(END) + 1 for each in actions)
        for kind, took in (pair for each in actions for pair in each):
            if (name := f"{kind}, {TRAINEES} at once") in times:
                times[name].append(took)
    with tempfile.TemporaryDirectory() as place:
        times["key to loaded page"] = by_key(Path(place) / "day")
    with tempfile.TemporaryDirectory() as place:
        found_of_many, memory = handed_in_at_once(place)
        times |= found_of_many
    late = 1e3 * quantiles(times["key to loaded page"], n=20)[-1]
    print(f"{'ms':<28}{'median':>8}{'worst':>8}{'to reach':>16}{'of':>6}")
    for name, spent in times.items():
        goal = " / ".join("-" if each is None else f"{each}" for each in GOALS[name])
        print(
            f"{name:<28}{1e3 * median(spent):8.0f}{1e3 * max(spent):8.0f}{goal:>16}{len(spent):6}"
        )
    print(f"key to loaded page, 95 of 100 within {late:.0f} ms, to reach 200")
    print(f"memory of the server, {MANY + 1} days: {memory:.0f} MB, to reach {LARGEST}")
    begun, draws = time.process_time(), np.random.default_rng(1)
    for _ in range(20):
        draws.normal(size=1_000_000)
    print(f"a numpy normal: {(time.process_time() - begun) * 50:.1f} ns")
    print(f"days lost of {TRAINEES} at once: {lost}")


if __name__ == "__main__":
    main()
