"""Chart of the methods to propagate uncertainty: errors of u and of the interval against time.

The chart is drawn from ``data/uncertainty/methods.csv``, which a command of the benchmarks writes
in minutes (CONTRIBUTING.md).
"""

from __future__ import annotations

import csv
from typing import TYPE_CHECKING, Any

from virtual_lab.catalog.reading import DATA
from virtual_lab.fidelity.results import SpeedChart
from virtual_lab.output.progress import Progress, quiet

if TYPE_CHECKING:
    from virtual_lab.output.page_figure import PageFigure

Row = dict[str, Any]
PANELS = {"u_error": "of u", "low_error": "of the lower end", "high_error": "of the upper end"}
MARKERS = {"first-order": "o", "second-order": "s", "monte-carlo": "."}
COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7")
EXACT = 1e-5  # error of the reference, due to its number of draws [u]
TWO_DIGITS = 0.05, 0.005  # half of the second digit of a u of 1.0 and of 9.9 [u]


def uncertainty_chart(_progress: Progress = quiet) -> SpeedChart:
    """Return a chart of error and run time of the methods to propagate uncertainty.

    There is one row per measurement model and method; Monte Carlo has one row per number of draws.
    A row states the number of draws (None for other methods), the time [ms], and the errors of u
    and of the lower and upper end of the interval. The errors are divided by u. The reference is
    Monte Carlo with 2^27 draws. The rows come from a stored table; nothing is propagated.
    """
    text = (DATA / "uncertainty" / "methods.csv").read_text("utf-8")
    rows: list[Row] = []
    for line in csv.DictReader(text.splitlines()):
        numbers = {name: float(line[name]) for name in ("ms", *PANELS)}
        draws = int(line["draws"]) if line["draws"] else None
        rows.append({"model": line["model"], "method": line["method"], "draws": draws} | numbers)
    return SpeedChart(
        name="uncertainty",
        title="Uncertainty of a model: error of each method against its time",
        words="Errors over u; reference: 134 million draws by JCGM 101. For Monte Carlo: rms "
        "errors over seeds. Errors below 1e-5 are drawn at 1e-5. Gray band: half of the second "
        "digit of u.",
        rows=rows,
        figure=draw_uncertainty,
    )


def draw_uncertainty(rows: list[Row], title: str) -> PageFigure:
    """Return a figure of the errors of uncertainties against the run time [ms].

    The three panels show the errors of the standard uncertainty u, the lower end of the coverage
    interval, and its upper end. The errors are divided by u. The run time is for one processor
    core. `rows` are the rows of `uncertainty_chart`.
    """
    from virtual_lab.output.page_figure import PageFigure

    figure = PageFigure(figsize=(11.5, 4.6), dpi=150, layout="constrained")
    panels = figure.subplots(1, len(PANELS), sharex=True, sharey=True)
    models = list(dict.fromkeys(row["model"] for row in rows))
    for axes, (key, words) in zip(panels, PANELS.items(), strict=True):
        axes.axhspan(*TWO_DIGITS[::-1], color="0.9", linewidth=0)
        for model, colour in zip(models, COLOURS, strict=True):
            for method, marker in MARKERS.items():
                model_rows = [
                    row for row in rows if (row["model"], row["method"]) == (model, method)
                ]
                errors = [max(row[key], EXACT) for row in model_rows]
                look = {"marker": marker, "color": colour, "linewidth": 1, "markersize": 6}
                axes.plot([row["ms"] for row in model_rows], errors, **look)
        axes.set(xscale="log", yscale="log", xlabel="time, one core [ms]")
        axes.set_title(f"error {words}, over u", fontsize=10)
        axes.grid(True, which="major", linewidth=0.3)
    keys = [panels[0].plot([], [], color=c, linewidth=3)[0] for c in COLOURS[: len(models)]]
    keys += [panels[0].plot([], [], m, color="0.4")[0] for m in MARKERS.values()]
    figure.legend(
        *(keys, [*models, *MARKERS]),
        loc="outside lower center",
        ncols=len(keys),
        frameon=False,
        fontsize=8,
    )
    figure.suptitle(title, fontsize=11)
    return figure
