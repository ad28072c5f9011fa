"""What keeps the page from being served, in one line, and nothing half-begun."""

import socket
from pathlib import Path
from typing import Any

import pytest

from virtual_lab.bench.day.scenario import load_scenario
from virtual_lab.bench.entrance.serve import serve
from virtual_lab.errors import InputError

HERE = Path(__file__)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"host": "0.0.0.0"}, "the page needs --tls-certificate and --tls-key"),
        ({"tls": (Path("nowhere.pem"), HERE)}, "nowhere.pem: tls; no such file"),
        ({"tls": (HERE, HERE)}, "tls; cannot be used"),
        ({"folders": {}}, "trainees = 0; allowed: 1 to 50"),
        ({}, "try another"),
    ],
)
def test_what_cannot_be_served_is_said(tmp_path: Path, given: dict[str, Any], message: str) -> None:
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
