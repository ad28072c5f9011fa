"""The required contents of the files of every chart."""

from __future__ import annotations

import json
from pathlib import Path

from virtual_lab.fidelity.results import SpeedChart

__all__ = ["require_files"]


def require_files(chart: SpeedChart, folder: Path) -> None:
    """Require one line per row in text and table, and a picture."""
    text, rows, name = chart.text, chart.rows, chart.name
    lines, first = text.splitlines(), str(next(iter(rows[0].values())))
    assert lines[-len(rows)].startswith(first)  # below a head of one or more lines
    assert not lines[-len(rows) - 1].startswith(first)
    assert "None" not in text
    json.dumps(rows, allow_nan=False)
    chart.save(folder)
    assert (folder / f"{name}.png").read_bytes().startswith(b"\x89PNG")
    assert len((folder / f"{name}.csv").read_text().splitlines()) == len(rows) + 1
