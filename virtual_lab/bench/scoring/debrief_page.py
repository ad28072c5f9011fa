"""The debrief as an HTML page and as files beside the log of a day."""

from __future__ import annotations

import json
from functools import partial
from pathlib import Path

from virtual_lab.bench.day.doubts import fault_sheets, fault_titles
from virtual_lab.bench.day.scenario import UNITS
from virtual_lab.bench.day.table import action_table
from virtual_lab.bench.pages.tally import convert_units
from virtual_lab.bench.scoring.debrief import Debrief
from virtual_lab.output.metrics import METRICS
from virtual_lab.output.template import page_template


def debrief_page(debrief: Debrief, *, linked: bool = False) -> str:
    """Return the debrief as a self-contained HTML page. If `linked`, it has links to the replay."""
    return page_template("virtual_lab.bench.pages", "debrief.html").render(
        debrief=debrief,
        linked=linked,
        sheets=action_table().actions,
        titles=fault_titles(),
        faults=fault_sheets(),
        printed=partial(convert_units, system=debrief.units),
        length=UNITS[debrief.units][0],
        speed=UNITS[debrief.units][1],
        metric=METRICS[debrief.metric],
    )


def save_debrief(debrief: Debrief, folder: Path) -> None:
    """Write ``debrief.json`` and ``debrief.html`` into an existing folder, replacing older ones.

    Raises `FileNotFoundError` if the folder does not exist, and `ValueError` for a number that is
    NaN or infinite.
    """
    text = json.dumps(debrief.document(), indent=1, allow_nan=False)
    (folder / "debrief.json").write_text(text + "\n", encoding="utf-8")
    (folder / "debrief.html").write_text(debrief_page(debrief), encoding="utf-8")
