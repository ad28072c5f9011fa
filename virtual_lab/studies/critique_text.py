"""What the study of procedures prints in a terminal."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from virtual_lab.output.tables import number, table_text
from virtual_lab.studies.bats.text import balls_text, swing_text

__all__ = ["critique_text"]

FIELD = "v_f_mph_"  # begins the keys of the field's speeds


def critique_text(
    metrics: Sequence[Mapping[str, Any]],
    pairs: Sequence[Mapping[str, Any]],
    balls: Mapping[str, str],
) -> str:
    """Return how each procedure places each bat, beside the field, and which pairs it misranks."""
    fields = [key for key in metrics[0] if key.startswith(FIELD)]
    tables: dict[str, dict[str, str]] = {}
    for row in metrics:
        line = tables.setdefault(row["bat"], {"bat": row["bat"]})
        for key in fields:
            rank = 1 + sum(other > row[key] for other in {each[key] for each in metrics})
            swing = key.removeprefix(FIELD)
            swing = f"n = {swing[1:]}" if swing.startswith("n") else "constant energy"
            line[f"v_f, {swing}"] = f"{row[key]:.1f} ({rank})"
        rivals = [each["value"] for each in metrics if each["procedure"] == row["procedure"]]
        line[row["procedure"]] = _placed(row, [value for value in rivals if value is not None])
    tested = {row["procedure"]: row["ball"] for row in metrics}
    fires = [f"{name} fires {ball}" for name, ball in tested.items()]
    fired = "; ".join([f"in the field {balls_text(balls)}", *fires])
    found: dict[tuple[str, str, str], dict[str, str]] = {}
    for row in pairs:
        pair, swing = f"{row['first']} - {row['second']}", swing_text(row["n"])
        empty = {"pair": pair, "procedure": "the field", "error-free": "", "mean": "", "sd": ""}
        field = found.setdefault((row["first"], row["second"], ""), empty)
        field[swing] = f"{row['v_f_mph']:+.2f} mph"
        line = found.setdefault(
            (row["first"], row["second"], row["procedure"]),
            {
                "pair": "",
                "procedure": f"{row['procedure']}, {row['metric']}",
                "error-free": number(row["difference"], "+.4f"),
                "mean": number(row["mean"], "+.4f"),
                "sd": number(row["sd"], ".4f"),
            },
        )
        line[swing] = row["verdict"]
        if row["probability"] is not None:
            line[swing] += f" {row['probability']:.3f} ({row['wrong']} of {row['laboratories']})"
    return (
        "error-free laboratory, place among the bats in brackets\n"
        f"{table_text(list(tables.values()))}\n{fired}\n\n"
        "first bat less second; probability of the other order than the field's, and laboratories "
        f"that found it\n{table_text(list(found.values()))}"
    )


def _placed(row: Mapping[str, Any], rivals: Sequence[float]) -> str:
    """Return an error-free metric with its rank among those of all bats."""
    if row["value"] is None:
        return "no result"
    places = 2 if row["unit"] == "mph" else 4
    rank = 1 + sum(other > row["value"] for other in rivals)
    return f"{row['metric']} {row['value']:.{places}f} ({rank})"
