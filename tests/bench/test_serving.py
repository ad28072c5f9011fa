"""What keeps the page from being served, in one line, and nothing half-begun."""

import re
import socket
from contextlib import closing
from http.client import HTTPConnection
from pathlib import Path
from typing import Any

import pytest

from virtual_lab.bench.day.scenario import load_scenario
from virtual_lab.bench.entrance import serve as serve_module
from virtual_lab.bench.entrance.serve import serve
from virtual_lab.errors import InputError

HERE = Path(__file__)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        (
            {"host": "0.0.0.0"},
            "beyond this computer the page needs tls_certificate= and tls_key=",
        ),
        ({"host": "no such host"}, "host = 'no such host'; has no address"),
        ({"tls": (Path("nowhere.pem"), HERE)}, "nowhere.pem: tls; no such file"),
        ({"tls": (HERE, HERE)}, "tls; cannot be used"),
        ({"folders": {}}, "trainees = 0; allowed: 1 to 50"),
        ({}, "try another"),
    ],
)
def test_an_address_that_cannot_be_served_is_refused(
    tmp_path: Path, given: dict[str, Any], message: str
) -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        usual = {
            "folders": {"": tmp_path / "day"},
            "scenario": load_scenario("plain-day"),
            "seed": 3,
            "port": taken.getsockname()[1],
            "browser": False,
            "say": print,
        }
        with pytest.raises(InputError, match=message):
            serve(**usual | given)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("host", "name"),
    [("127.0.0.1", "127.0.0.1"), ("localhost", "localhost"), ("::1", "[::1]")],
)
def test_the_page_is_served_under_each_name_of_this_computer(
    tmp_path: Path, host: str, name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Open the printed address as a browser does; no certificate is asked for."""
    with socket.socket(socket.AF_INET6 if ":" in host else socket.AF_INET) as free:
        free.bind((host, 0))
        port = free.getsockname()[1]
    answers = []

    def look(line: str) -> None:
        for address in re.findall(rf"open (http://{re.escape(name)}:{port}/\S+)", line):
            with closing(HTTPConnection(host, port, timeout=10)) as connection:
                connection.request("GET", address.partition(str(port))[2])
                with connection.getresponse() as answer:
                    answers.append((answer.status, answer.headers["location"]))
                connection.request("GET", "/", headers={"cookie": answer.headers["set-cookie"]})
                with connection.getresponse() as answer:
                    answers.append((answer.status, b"<h1>" in answer.read()))

    def interrupt(_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(serve_module, "_warm", interrupt)
    usual = {"scenario": load_scenario("plain-day"), "seed": 3, "port": port, "browser": False}
    with pytest.raises(KeyboardInterrupt):
        serve({"": tmp_path / "day"}, **usual, say=look, host=host)
    assert answers == [(303, "/"), (200, True)]
