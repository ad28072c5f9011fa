"""An inspector who is given the text of a page alone, and a table of what each reading means.

It parses the HTML: every row of the table of checks whose last word is not "within" points to a
fault by the words of its reading; never an object of the bench is looked at.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from html.parser import HTMLParser

MEANS = (  # words of a reading beyond its limit: the fault
    ("check mass on the scale", "scale-not-tared"),
    ("mass of the bat", "bat-ounces-as-grams"),
    ("mean mass of the balls,", "ounces-as-grams"),
    ("balls on the display", "ball-mass-typed"),
    ("balance point", "balance-from-knob"),
    ("decrease of the period", "pendulum-wide"),
    ("clamp alone", "clamp-forgotten"),
    ("slowest ball at the wall", "ball-worn-out"),
    ("check ball at the wall", "wall-drift"),
    ("test balls at the wall", "wrong-lot"),
    ("from the bat", "gate-moved"),
    ("pivot axis from the knob", "pivot-off"),
    ("gate clock", "gate-clock"),
    ("marks along", "aim-along"),
    ("marks across", "aim-across"),
    ("frequency of the bat", "bat-cracked"),
    ("balls that a gate missed", "gate-misses"),
    ("blocked the first gate too early", "sabot-trip"),
    ("median speed at the gates", "cannon-slow"),
    ("rate of the bat before the hit", "bat-not-at-rest"),
    ("largest minus smallest", "encoder-slip"),
    ("smallest over the shots", "encoder-play"),
)
EXPLAINED = {  # a fault that is not named where another shows
    "ball-mass-typed": {"ounces-as-grams"},
    "ball-out-of-round": {"gate-doubles", "sabot-trip"},
    "ball-worn-out": {"wall-drift"},
    "wrong-lot": {"wall-drift"},
    "wall-drift": {"ball-out-of-round"},
    "cannon-slow": {"gate-doubles", "sabot-trip", "ounces-as-grams"},
    "encoder-play": {"encoder-slip"},
    "encoder-half-counts": {"bat-not-at-rest"},
    "bearing-friction": {
        "encoder-half-counts",
        "encoder-slip",
        "encoder-play",
        "aim-along",
        "bat-not-at-rest",
    },
}


class _Checks(HTMLParser):
    """Collects the rows of the tables of checks as lists of text."""

    def __init__(self) -> None:
        super().__init__()
        self.rows: list[list[str]] = []
        self.inside = self.cell = False

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        if tag == "table":
            self.inside = ("class", "checks") in attrs
        elif self.inside and tag == "tr":
            self.rows.append([])
        elif self.inside and tag in {"td", "th"}:
            self.cell = True
            self.rows[-1].append("")

    def handle_endtag(self, tag: str) -> None:
        self.cell = self.cell and tag not in {"td", "th"}
        self.inside = self.inside and tag != "table"

    def handle_data(self, data: str) -> None:
        if self.inside and self.cell:
            self.rows[-1][-1] += data


def rows(page: str) -> list[list[str]]:
    """Return reading, result, value, expected, difference, u, limit, unit, entry of each check."""
    parser = _Checks()
    parser.feed(page)
    return [row for row in parser.rows if row[0] != "Reading"]


def faults_on(page: str) -> set[str]:
    """Return the faults that a page shows, those that another explains left out."""
    found = {_fault(row) for row in rows(page) if "beyond the limit" in row[1]}
    return {name for name in found if not found & EXPLAINED.get(name, set())}


def margins(page: str) -> Iterator[tuple[str, float, float]]:
    """Yield of each check with a u: its fault, limit and reading off what it should be, in u."""
    for row in rows(page):
        _, _, _, certificate, off, u, limit, *_ = row
        if u == "counted" or certificate == "–":
            continue
        known, (bound,) = float(certificate), re.findall(r"-?[\d.]+", limit)[-1:]
        reach = float(bound) if limit.startswith("±") else abs(float(bound) - known)
        yield _fault(row), reach / float(u), abs(float(off)) / float(u)


def _fault(row: list[str]) -> str:
    words, off = row[0], row[4]
    if words.startswith("check cylinder"):
        return "encoder-half-counts" if -float(off) > 0.25 * float(row[3]) else "bearing-friction"
    if "ratio of the blocking times" in words:
        ratio = float(row[2])
        if ratio > 1.2:
            return "sabot-trip"
        return "gate-doubles" if ratio < 1 / 1.1 else "ball-out-of-round"
    return next(fault for part, fault in MEANS if part in words)
