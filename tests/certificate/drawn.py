"""The marks of an SVG figure in the units of its axes, found from the ticks."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from typing import Any

import numpy as np

NUMBER = r"(-?[\d.]+)"
FRAME = re.compile(rf'<path d="M{NUMBER} {NUMBER}V{NUMBER}H{NUMBER}((?:M[^"]*)?)" fill="none"')
TEXT = re.compile(r'<text x="([\d.-]+)" y="([\d.-]+)"[^>]*text-anchor="(\w+)"([^>]*)>(.*?)</text>')
DOT = re.compile(rf'translate\({NUMBER},{NUMBER}\)"><(circle r="([\d.]+)" fill="([^"]*)"|path)')
PATH = re.compile(r'<path d="(M[^"]*)" fill="([^"]*)"([^>]*)/>')


@dataclass
class Plot:
    """One pair of axes, with its texts, and its marks in the units of the axes."""

    left: float
    top: float
    bottom: float
    right: float
    across: dict[float, str] = field(default_factory=dict)  # ticks: position [pt], label
    upward: dict[float, str] = field(default_factory=dict)
    words: list[tuple[float, float, str]] = field(default_factory=list)  # x, y of texts
    discs: dict[str, list[tuple[float, float]]] = field(default_factory=dict)  # disks by their fill
    lines: list[tuple[str, np.ndarray]] = field(default_factory=list)  # style, (point, 2)
    whiskers: list[tuple[float, float, float]] = field(default_factory=list)  # x, low, high
    shapes: list[tuple[str, np.ndarray]] = field(default_factory=list)  # fill, (point, 2)

    def _scale(self, ticks: dict[float, str]) -> np.poly1d:
        values = [float(words.replace("−", "-")) for words in ticks.values()]
        if len(values) < 2:  # without ticks: points of the page
            return np.poly1d([1.0, 0.0])
        fitted = np.poly1d(np.polyfit([*ticks], values, 1))
        assert np.ptp(fitted([*ticks]) - values) < 0.03 * abs(fitted[1])  # ticks at even steps
        return fitted

    @property
    def x(self) -> np.poly1d:
        return self._scale(self.across)

    @property
    def y(self) -> np.poly1d:
        named = all(re.fullmatch(r"[−\d.]+", words) for words in self.upward.values())
        return self._scale(self.upward if named else {})

    def holds(self, x: float, y: float) -> bool:
        return self.left - 0.1 <= x <= self.right + 0.1 and self.top - 5 <= y <= self.bottom + 0.1

    def points(self, pairs: Any) -> np.ndarray:
        x, y = np.transpose(np.array(pairs, float))
        return np.stack([self.x(x), self.y(y)], axis=-1)

    def near(self, points: float = 0.03) -> tuple[float, float]:
        """Return the lengths on both axes, in their units, of a distance in points of the page."""
        return abs(self.x[1]) * points, abs(self.y[1]) * points


def plots_of(drawing: str) -> list[Plot]:
    """Return the axes of a figure with everything drawn within them."""
    found = []
    for *corners, ticks in FRAME.findall(drawing):
        plot = Plot(*map(float, corners))
        _write(plot, drawing, ticks)
        _mark(plot, drawing)
        _draw(plot, drawing)
        found.append(plot)
    return found


def _write(plot: Plot, drawing: str, ticks: str) -> None:
    """Add ticks with their labels, and texts within the axes."""
    across = [float(at) for at in re.findall(r"M([\d.]+) [\d.]+v", ticks)]
    upward = [float(at) for at in re.findall(r"M[\d.]+ ([\d.]+)h", ticks)]
    for place_x, place_y, anchor, more, inner in TEXT.findall(drawing):
        words, x, y = re.sub(r"<[^>]+>|&#8203;", "", inner), float(place_x), float(place_y)
        if "rotate" in more and anchor == "middle":
            continue
        if anchor == "middle" and abs(y - plot.bottom - 12) < 0.02 and x in across:
            plot.across[x] = words
        elif anchor == "end" and abs(x + 5 - plot.left) < 0.02:
            (height,) = [each for each in upward if abs(each + 2.8 - y) < 0.02]
            plot.upward[height] = words
        elif plot.holds(x, y):
            plot.words.append((x, y, words))


def _mark(plot: Plot, drawing: str) -> None:
    """Add disks and crosses."""
    for x, y, _, _, fill in DOT.findall(drawing):
        if plot.holds(float(x), float(y)):
            marked = plot.discs.setdefault(fill or "cross", [])
            marked.append(tuple(plot.points([(x, y)])[0]))


def _draw(plot: Plot, drawing: str) -> None:
    """Add lines, whiskers and filled shapes."""
    for path, fill, style in PATH.findall(drawing):
        corners = [tuple(map(float, pair)) for pair in re.findall(rf"{NUMBER} {NUMBER}", path)]
        if not corners or not plot.holds(*corners[0]):
            continue
        if whisker := re.fullmatch(rf"M{NUMBER} {NUMBER}V{NUMBER}(M[^h]*h[^M]*){{2}}", path):
            x, high, low = map(float, whisker.groups()[:3])
            ((at, up), (_, down)) = plot.points([(x, high), (x, low)])
            plot.whiskers.append((at, down, up))
        elif band := re.fullmatch(rf"M{NUMBER} {NUMBER}H{NUMBER}V{NUMBER}H{NUMBER}Z", path):
            left, high, right, low, _ = map(float, band.groups())
            plot.shapes.append((fill, plot.points([(left, high), (right, low)])))
        elif fill == "none" and re.fullmatch(r"M[\d. L-]+", path):
            plot.lines.append((style, plot.points(corners)))
        elif fill != "none" and path.endswith("Z"):
            plot.shapes.append((fill, plot.points(corners)))
