"""Chart of the whole test: effect of each model of each part on the metric, against its time.

The chart is drawn from ``data/uncertainty/laboratory.csv``, which a command of the benchmarks
writes (CONTRIBUTING.md).
"""

from __future__ import annotations

import csv
from typing import TYPE_CHECKING, Any

from virtual_lab.catalog.reading import DATA
from virtual_lab.fidelity.results import SpeedChart
from virtual_lab.output.progress import Progress, quiet
from virtual_lab.simulation.collision.ladder import SHARE

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Row = dict[str, Any]
LEAST = 1e-4  # smallest effect that is drawn; smaller ones are drawn there [u]
CLOSE = 3  # ratio of effects below which the labels are placed on opposite sides
EXPLAINED = {  # reason why a part does not use the fastest model below a tenth of u
    "camera": "one test films the windows that it tracks, for the clip is the record",
    "uncertainty": "by draws the interval of few hits is longer; that of the first order holds the "
    "truth as often as stated",
}
SIZES = ("effect", "se", "rms", "ms")


def laboratory_chart(_progress: Progress = quiet) -> SpeedChart:
    """Return one row per part and model: effect on the metric [u], its error, and time."""
    text = (DATA / "uncertainty" / "laboratory.csv").read_text("utf-8")
    rows: list[Row] = []
    for line in csv.DictReader(text.splitlines()):
        shipped, many = bool(int(line["shipped"])), int(line["laboratories"])
        known = {"part": line["part"], "rung": line["rung"], "shipped": shipped}
        rows.append(known | {"laboratories": many} | {key: float(line[key]) for key in SIZES})
    said = "; ".join(f"{part}: {why}" for part, why in EXPLAINED.items())
    return SpeedChart(
        name="laboratory",
        title="The whole test: effect of every rung on the metric over its time",
        words="r161 by astm-f1881. Effect: mean over laboratories of the metric less that by the "
        "finest rung of the part, over u, with its standard error; of the uncertainty half the "
        "length of the interval, of the camera e_A of one filmed shot over its own u. Grey: below "
        f"a tenth of u. Full: what studies of many laboratories take; a single certificate keeps "
        f"every edge and count, for its records are what it shows. Otherwise {said}.",
        rows=rows,
        figure=draw_laboratory,
    )


def draw_laboratory(rows: list[Row], title: str) -> Figure:
    """Return the figure of the rows of `laboratory_chart`, with one panel per part."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(11.5, 6.4), dpi=150, layout="constrained")
    panels = figure.subplots(2, 3, sharex=True, sharey=True).ravel()
    parts = list(dict.fromkeys(row["part"] for row in rows))
    for axes, part in zip(panels, parts, strict=True):
        axes.axhspan(LEAST, SHARE, color="0.93", linewidth=0)
        own = [row for row in rows if row["part"] == part]
        finest, own = own[-1], sorted(own, key=lambda row: row["ms"])
        for at, row in enumerate(own):
            size, time = max(abs(row["effect"]), LEAST), row["ms"]
            far = abs(row["effect"]) + 2 * row["se"]
            axes.plot([time, time], [LEAST, max(far, LEAST)], color="0.6", linewidth=1)
            look = {"markersize": 8, "markerfacecolor": "black" if row["shipped"] else "white"}
            axes.plot(time, size, "o", color="black", zorder=3, **look)
            words = row["rung"] if row is not finest else f"{row['rung']}\n(held against)"
            before, after = (own[k]["ms"] if 0 <= k < len(own) else 0 for k in (at - 1, at + 1))
            side, shift = "center", (0, 9)
            if time > before > time / CLOSE:
                side, shift = "left", (8, -3)
            elif time < after < time * CLOSE:
                side, shift = "right", (-8, -3)
            look = {"textcoords": "offset points", "ha": side, "fontsize": 8}
            axes.annotate(words, (time, size), shift, **look)
        axes.set(xscale="log", yscale="log", xlim=(0.005, 2e5), ylim=(LEAST / 1.5, 60))
        unit = "shot" if part == "camera" else "certificate"
        axes.set_xlabel(f"time a {unit}, one core [ms]")
        axes.set_title(f"{part}, {min(row['laboratories'] for row in own)} laboratories")
        axes.grid(True, which="major", linewidth=0.3)
    for axes in panels[::3]:
        axes.set_ylabel("effect on the metric, over u")
    figure.suptitle(f"{title}\nlines: to two standard errors", fontsize=11)
    return figure
