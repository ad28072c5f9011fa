"""Small line figures as SVG: black and gray, text as text, reproducible.

The figures of a certificate take some milliseconds and need no import.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from html import escape, unescape
from math import ceil, floor, isfinite, log10

PAGE_WIDTH = 497.0  # text width of an A4 page [pt]
BAND = "#d9d9d9"  # gray of an interval; markers on it stay visible in greyscale print
DASHED = "5 2.5"
TICK = 3.0  # length of a tick [pt]
DIGIT = 5.1  # width of a digit of a wide sans-serif font (DejaVu Sans) at 8 pt [pt]


def figure(panels: Iterable[Panel], height: float, name: str, title: str, description: str) -> str:
    """Return panels as one SVG element for an HTML page, as wide as the text of an A4 page.

    Parameters
    ----------
    panels
        Panels of the figure.
    height
        Height of the figure [pt].
    name
        Name of the figure, used in the ids of the element.
    title, description
        Alternative text for readers who cannot see the figure.
    """
    drawn = "".join(panel.svg() for panel in panels)
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {PAGE_WIDTH:g} {height:g}" '
        f'role="img" aria-labelledby="{name}-title {name}-description" font-size="8" '
        'font-family="sans-serif" stroke-linecap="butt">'
        f'<title id="{name}-title">{escape(title)}</title>'
        f'<desc id="{name}-description">{escape(description)}</desc>{drawn}</svg>'
    )


def description_of(figure: str) -> str:
    """Return the description of a figure for readers who cannot see it; it may be empty.

    `figure` is the text of the SVG element, as returned by the function `figure`.
    """
    return unescape(figure.partition('-description">')[2].partition("</desc>")[0])


def symbol_markup(text: str) -> str:
    """Return text as SVG markup, with its first symbol typeset, such as ``e_A``.

    The letter of the symbol is in italics, and its index is a subscript. All other text is escaped.
    """
    match = re.search(r"\b([A-Za-z])_(\w)\b", text)
    if match is None:
        return escape(text)
    before, after = escape(text[: match.start()]), escape(text[match.end() :])
    letter, index = match.groups()
    lowered = f'<tspan dy="2" font-size="6">{index}</tspan>'
    raised = f'<tspan dy="-2">{after or "&#8203;"}</tspan>'
    return f'{before}<tspan font-style="italic">{letter}</tspan>{lowered}{raised}'


@dataclass(kw_only=True)
class Panel:
    """One pair of axes; marks are drawn in the order in which they are added."""

    left: float  # edges of the axes in the figure [pt]
    right: float
    top: float
    bottom: float
    x: tuple[float, float]  # limits of the axes
    y: tuple[float, float]
    title: str = ""
    x_label: str = ""
    y_label: str = ""
    x_ticks: Sequence[float] | None = None  # None: round numbers
    y_ticks: Sequence[float] | None = None
    y_words: Sequence[str] = ()  # words at the y_ticks, instead of numbers
    _marks: list[str] = field(default_factory=list)
    _legend: list[tuple[str, str]] = field(default_factory=list)

    def band(self, low: float, high: float, label: str) -> None:
        """Fill the area between two heights."""
        top, bottom = self._y(high), self._y(low)
        self._put(
            f'<path d="M{_at(self.left, top)}H{self.right:.2f}V{bottom:.2f}H{self.left:.2f}Z"'
            f' fill="{BAND}"/>'
        )
        self._legend.append((_swatch(), label))

    def ribbon(
        self, x: Sequence[float], low: Sequence[float], high: Sequence[float], label: str
    ) -> None:
        """Fill the area between two lines."""
        there = [self._point(*each) for each in zip(x, low, strict=True)]
        back = [self._point(*each) for each in zip(x, high, strict=True)][::-1]
        self._put(f'<path d="M{"L".join(there + back)}Z" fill="{BAND}"/>')
        self._legend.append((_swatch(), label))

    def line(
        self,
        x: Sequence[float],
        y: Sequence[float],
        label: str = "",
        *,
        width: float = 0.9,
        colour: str = "black",
        dashes: str = "",
    ) -> None:
        """Draw a line through points."""
        points = "L".join(self._point(*each) for each in zip(x, y, strict=True))
        style = _stroke(width, colour, dashes)
        self._put(f'<path d="M{points}" fill="none"{style}/>')
        if label:
            self._legend.append((f'<path d="M0 0H14"{style}/>', label))

    def shape(self, x: Sequence[float], y: Sequence[float], fill: str = "black") -> None:
        """Fill the area within points."""
        points = "L".join(self._point(*each) for each in zip(x, y, strict=True))
        self._put(f'<path d="M{points}Z" fill="{fill}"/>')

    def level(self, y: float, label: str = "", *, width: float = 0.9, dashes: str = "") -> None:
        """Draw a horizontal line across the panel."""
        self.line(self.x, (y, y), label, width=width, dashes=dashes)

    def upright(self, x: float, label: str = "") -> None:
        """Draw a thin dotted vertical line."""
        self.line((x, x), self.y, label, width=0.7, dashes="1 1.6")

    def dots(
        self,
        x: Sequence[float],
        y: Sequence[float],
        label: str = "",
        *,
        radius: float = 2.4,
        fill: str = "black",
        cross: bool = False,
    ) -> None:
        """Mark points with disks or crosses."""
        for each in zip(x, y, strict=True):
            place = self._point(*each).replace(" ", ",")
            self._put(f'<g transform="translate({place})">{_mark(radius, fill, cross)}</g>')
        if label:
            sign = f'<g transform="translate(7,0)">{_mark(radius, fill, cross)}</g>'
            self._legend.append((sign, label))

    def whisker(self, x: float, low: float, high: float, cap: float = 4.0) -> None:
        """Draw an interval with caps."""
        at, top, bottom = self._x(x), self._y(high), self._y(low)
        caps = "".join(f"M{_at(at - cap, end)}h{2 * cap:g}" for end in (top, bottom))
        self._put(f'<path d="M{_at(at, top)}V{bottom:.2f}{caps}" fill="none"{_stroke(0.9)}/>')

    def note(
        self, x: float, y: float, text: str, *, anchor: str = "end", upright: bool = False
    ) -> None:
        """Write a few words at a point of the data, horizontally or vertically."""
        place = self._point(x, y).split(" ")
        turned = f' transform="rotate(-90 {" ".join(place)})"' if upright else ""
        self._put(
            f'<text x="{place[0]}" y="{place[1]}" dy="-4" text-anchor="{anchor}"{turned}>'
            f"{symbol_markup(text)}</text>"
        )

    def svg(self) -> str:
        """Return the panel as SVG: marks, axes with ticks and labels, title and legend."""
        middle = (self.left + self.right) / 2
        parts = [*self._marks, self._axes()]
        if self.title:
            parts.append(_text(self.left, self.top - 17, self.title))
        below = self.bottom + (12 if self.x_ticks is not None and not self.x_ticks else 23)
        for number, words in enumerate(self.x_label.splitlines()):
            parts.append(_text(middle, below + 9.5 * number, words, "middle"))
        if self.y_label:
            height = (self.top + self.bottom) / 2
            beside = max(7.0, self.left - self._label_distance())  # not beyond the figure's edge
            turned = f' transform="rotate(-90 {_at(beside, height)})"'
            parts.append(_text(beside, height, self.y_label, "middle", turned))
        across = self.left
        for sign, label in self._legend:
            parts.append(f'<g transform="translate({across:.2f},{self.top - 8:.2f})">{sign}</g>')
            parts.append(_text(across + 18, self.top - 5.2, label))
            across += 30 + 4.1 * len(label)
        return "".join(parts)

    def _axes(self) -> str:
        frame = f"M{_at(self.left, self.top)}V{self.bottom:.2f}H{self.right:.2f}"
        labels = []
        across = _ticks(*self.x, 7) if self.x_ticks is None else list(self.x_ticks)
        for value, words in zip(across, _numbers(across), strict=True):
            at = self._x(value)
            frame += f"M{_at(at, self.bottom)}v{TICK:g}"
            labels.append(_text(at, self.bottom + 12, words, "middle"))
        for value, words in self._upward():
            at = self._y(value)
            frame += f"M{_at(self.left, at)}h{-TICK:g}"
            labels.append(_text(self.left - 5, at + 2.8, words, "end"))
        return f'<path d="{frame}" fill="none"{_stroke(0.6)}/>' + "".join(labels)

    def _upward(self) -> list[tuple[float, str]]:
        """Return position and text of each tick of the vertical axis."""
        upward = _ticks(*self.y, 4) if self.y_ticks is None else list(self.y_ticks)
        return list(zip(upward, self.y_words or _numbers(upward), strict=True))

    def _label_distance(self) -> float:
        """Return the distance of the vertical axis's label, beyond the longest word [pt]."""
        longest = max((len(words) for _, words in self._upward()), default=0)
        return max(33.0, 8 + DIGIT * longest)

    def _put(self, mark: str) -> None:
        self._marks.append(mark)

    def _x(self, value: float) -> float:
        low, high = self.x
        return self.left + (value - low) / (high - low) * (self.right - self.left)

    def _y(self, value: float) -> float:
        low, high = self.y
        return self.bottom - (value - low) / (high - low) * (self.bottom - self.top)

    def _point(self, x: float, y: float) -> str:
        return _at(self._x(x), self._y(y))


def _at(x: float, y: float) -> str:
    return f"{x:.2f} {y:.2f}"


def _text(x: float, y: float, words: str, anchor: str = "start", more: str = "") -> str:
    where = f'x="{x:.2f}" y="{y:.2f}" text-anchor="{anchor}"'
    return f"<text {where}{more}>{symbol_markup(words)}</text>"


def _stroke(width: float, colour: str = "black", dashes: str = "") -> str:
    dashed = f' stroke-dasharray="{dashes}"' if dashes else ""
    return f' stroke="{colour}" stroke-width="{width:g}"{dashed}'


def _swatch() -> str:
    return f'<path d="M0 -3H14V3H0Z" fill="{BAND}"/>'


def _mark(radius: float, fill: str, cross: bool) -> str:
    if cross:
        r = radius
        return f'<path d="M{-r:g} {-r:g}L{r:g} {r:g}M{-r:g} {r:g}L{r:g} {-r:g}"{_stroke(1.0)}/>'
    return f'<circle r="{radius:g}" fill="{fill}"{_stroke(0.8 if radius > 1 else 0)}/>'


def _ticks(low: float, high: float, most: int) -> list[float]:
    """Return at most `most` round numbers between two limits, at equal distances."""
    if not (isfinite(low) and isfinite(high) and high > low):
        return []
    power = 10.0 ** floor(log10((high - low) / most))
    steps = (power * each for each in (1.0, 2.0, 2.5, 5.0, 10.0, 20.0))
    step = next(step for step in steps if (high - low) / step <= most)
    first, last = ceil(low / step - 1e-9), floor(high / step + 1e-9)
    return [number * step for number in range(first, last + 1)]


def _numbers(values: Sequence[float]) -> list[str]:
    """Return the numbers of an axis, all with as many decimals as their step needs."""
    places = 0
    while places < 6 and any(abs(round(value, places) - value) > 1e-9 for value in values):
        places += 1
    return [f"{value + 0.0:.{places}f}".replace("-", "−") for value in values]
