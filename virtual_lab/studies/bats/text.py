"""Profiles and comparisons of bats as plain text for a terminal."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from virtual_lab.catalog.specs import PublishedBat
from virtual_lab.output.tables import number, table_text
from virtual_lab.units import INCH, OUNCE, OZ_IN2

__all__ = [
    "balls_text",
    "comparison_text",
    "profile_text",
    "sensitivity_text",
    "swing_text",
]


def profile_text(document: Mapping[str, Any], published: PublishedBat | None) -> str:
    """Return a bat's properties, beside the published ones where there are any, and its curve."""
    computed = {
        "mass_oz": document["mass_oz"],
        "z_cm_in": document["z_cm_in"],
        "i_cm_oz_in2": document["i_cm_oz_in2"],
        "i_knob_oz_in2": document["i_knob_oz_in2"],
        **{f"f{i + 1}_hz": f for i, f in enumerate(document["modal_frequencies_hz"][:4])},
        **{f"node{i + 1}_in": node for i, node in enumerate(document["barrel_nodes_in"])},
    }
    said = _published(published)
    rows = [
        {
            "property": name,
            "computed": f"{value:.6g}",
            "published": number(said.get(name), "g"),
        }
        for name, value in computed.items()
    ]
    columns = ("z_in", "e", "r", "e_A", "v_bat_mph", "v_f_mph")
    forms = ("5.2f", ".4f", ".4f", "+.4f", ".2f", ".2f")
    curve = [
        {name: f"{document[name][i]:{form}}" for name, form in zip(columns, forms, strict=True)}
        for i in range(len(document["z_in"]))
    ]
    swung = swing_text(document["swing_exponent"])
    return (
        f"{table_text(rows)}\n\nstruck by {document['ball']}, swing: {swung}\n{table_text(curve)}"
    )


def swing_text(exponent: float | None) -> str:
    """Return which law of the swing it is."""
    return "constant energy" if exponent is None else f"n = {exponent:g}"


def balls_text(balls: Mapping[str, str]) -> str:
    """Return which ball each bat meets, in one sentence where it is the same one."""
    if len(set(balls.values())) == 1:
        return f"struck by {next(iter(balls.values()))}"
    return "; ".join(f"{bat} struck by {ball}" for bat, ball in balls.items())


def comparison_text(
    peaks: Sequence[Mapping[str, Any]],
    differences: Sequence[Mapping[str, Any]],
    balls: Mapping[str, str],
) -> str:
    """Return the peaks of several bats, and how far they lie from those of the first."""
    forms = {"e": ".4f", "BPF": ".4f", "e_A": ".4f", "v_f_mph": ".2f"}
    tops = [
        {"bat": row["bat"], "swing": swing_text(row["n"])}
        | {name: f"{row[name]:{form}} @ {row[f'{name}_at_in']:.2f}" for name, form in forms.items()}
        for row in peaks
    ]
    apart = [
        {"bat": f"{row['bat']} against {row['against']}", "swing": swing_text(row["n"])}
        | {name: f"{row[f'{name}_percent']:+.1f} %" for name in ("e", "BPF", "e_A")}
        | {"v_f": f"{row['v_f_mph']:+.2f} mph"}
        for row in differences
    ]
    return (
        f"peak @ inches from the tip, {balls_text(balls)}\n"
        f"{table_text(tops)}\n\n{table_text(apart)}"
    )


def sensitivity_text(rows: Sequence[Mapping[str, Any]]) -> str:
    """Return what each law of the ball makes of a bat, and how far the results spread."""
    forms = {"e": ".4f", "BPF": ".4f", "e_A": ".4f", "v_f_mph": ".2f"}
    cells = [
        {
            "law": row["law"],
            "exponent": f"{row['exponent']:g}",
            "wall, ms": f"{row['wall_time_ms']:.3f}",
            "wall, kN": f"{row['wall_force_kn']:.1f}",
        }
        | {name: f"{row[name]:{form}} @ {row[f'{name}_at_in']:.2f}" for name, form in forms.items()}
        for row in rows
    ]
    apart = {
        name: max(row[name] for row in rows) - min(row[name] for row in rows)
        for pair in forms
        for name in (pair, f"{pair}_at_in")
    }
    spread = {"law": "spread", "exponent": "", "wall, ms": "", "wall, kN": ""} | {
        name: f"{apart[name]:{form}} @ {apart[f'{name}_at_in']:.2f}" for name, form in forms.items()
    }
    return f"{rows[0]['bat']}: peak @ inches from the tip\n{table_text([*cells, spread])}"


def _published(bat: PublishedBat | None) -> dict[str, float]:
    if bat is None:
        return {}
    return {
        "mass_oz": bat.mass / OUNCE,
        "z_cm_in": bat.z_cm / INCH,
        "i_cm_oz_in2": bat.inertia_cm / OZ_IN2,
        "i_knob_oz_in2": bat.inertia_knob / OZ_IN2,
        **{f"f{i + 1}_hz": f for i, f in enumerate(bat.bending_frequencies)},
        **{f"node{i + 1}_in": node / INCH for i, node in enumerate(bat.barrel_nodes)},
    }
