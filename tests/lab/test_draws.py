"""No two things that chance decides share a random number.

A number belongs to (seed, branch, laboratory, name, slot, index). Whoever asks for one is told by
the line that asks and the line that called it: a cannon fires at a bat and at an aim paper by the
same line, called from two. One key asked for from two places would give two things one number.
"""

import sys
from collections import defaultdict
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import FrameType

import pytest

from tests.laboratories import certify
from virtual_lab import catalog, streams
from virtual_lab.simulation.instruments import RecordDetail

STREAMS = Path(streams.__file__).parent
Place = tuple[str, int]
PROCEDURES = ("asa", "astm-f1881", "bbcor", "ncaa-besr", "ncaa-modified", "proposed")


@contextmanager
def overheard(monkeypatch: pytest.MonkeyPatch) -> Iterator[dict[tuple, set[tuple[Place, ...]]]]:
    """Collect who asks for the numbers of each (seed, branch, laboratory, name)."""
    asked: dict[tuple, set[tuple[Place, ...]]] = defaultdict(set)
    draw = streams.Streams._numbers

    def listening(self: streams.Streams, name: str, *rest: object) -> object:
        asked[(self.seed, self.branch, self.laboratory, name)].add(_callers())
        return draw(self, name, *rest)

    with monkeypatch.context() as patch:
        patch.setattr(streams.Streams, "_numbers", listening)
        yield asked


def _callers() -> tuple[Place, ...]:
    """Return the line outside the streams that asks, and the line that called it."""
    frame: FrameType | None = sys._getframe(2)
    while frame is not None and Path(frame.f_code.co_filename).parent == STREAMS:
        frame = frame.f_back
    places = []
    while frame is not None and len(places) < 2:
        places.append((frame.f_code.co_filename, frame.f_lineno))
        frame = frame.f_back
    return tuple(places)


@pytest.mark.parametrize("detail", RecordDetail)
@pytest.mark.parametrize("procedure", PROCEDURES)
def test_no_two_places_ask_for_the_same_numbers(
    procedure: str, detail: RecordDetail, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert set(PROCEDURES) <= set(catalog.names("procedures"))
    bat = "softball-wood-34" if procedure == "asa" else "r161"
    with overheard(monkeypatch) as asked:
        certify(bat, procedure=procedure, seed=11, test=1, detail=detail)
    assert len(asked) > 25
    shared = {key: who for key, who in asked.items() if len(who) > 1}
    assert not shared
