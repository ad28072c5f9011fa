"""Profiles and comparisons of bats as plain text for a terminal."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from virtual_lab.catalog.specs import PublishedBat
from virtual_lab.output.tables import Column, column, columns_of, inline, number, table_text
from virtual_lab.relations.peaks import Peak
from virtual_lab.units import INCH, OUNCE, OZ_IN2

PEAKS = {"e": ("", ".4f"), "BPF": ("", ".4f"), "e_A": ("", ".4f"), "v_f_mph": ("mph", ".2f")}
PROPERTIES = {  # key: words, unit
    "mass_oz": ("mass", "oz"),
    "z_cm_in": ("balance point from the tip", "in"),
    "i_cm_oz_in2": ("moment of inertia about it", "oz in²"),
    "i_knob_oz_in2": ("moment of inertia, 1 in from the knob", "oz in²"),
    **{f"f{i}_hz": (f"bending frequency {i}", "Hz") for i in range(1, 5)},
    **{f"node{i}_in": (f"node of mode {i} from the tip", "in") for i in range(1, 3)},
}
CURVE = {
    "z_in": Column("place from the tip", "in", ".2f"),
    "e": Column("e", form=".4f"),
    "r": Column("r", form=".4f"),
    "e_A": Column("e_A", form="+.4f"),
    "v_bat_mph": Column("bat speed", "mph", ".2f"),
    "v_f_mph": Column("batted-ball speed", "mph", ".2f"),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Peaks:
    """The greatest values along a bat, each with its place [in]: `e` at `e_at_in`, and so on."""

    bat: str
    n: float | None  # exponent of the swing law; None: constant energy
    peaks: Mapping[str, float] = inline()


@dataclass(frozen=True, slots=True, kw_only=True)
class Difference:
    """The peaks of a bat against those of another."""

    bat: str
    against: str
    n: float | None
    e_percent: float = column("e", "%", "+.1f")
    BPF_percent: float = column("BPF", "%", "+.1f")
    e_A_percent: float = column("e_A", "%", "+.1f")
    v_f_mph: float = column("v_f", "mph", "+.2f")


@dataclass(frozen=True, slots=True, kw_only=True)
class LawRow:
    """A force law of the ball: on a wall, and the peaks of a bat hit by this ball."""

    bat: str
    law: str = column("law")
    exponent: float = column("exponent", form="g")
    stiffness: float
    wall_time_ms: float = column("time on a wall", "ms", ".3f")
    wall_force_kn: float = column("force on a wall", "kN", ".1f")
    peaks: Mapping[str, float] = inline()


def placed(peaks: Mapping[str, Peak]) -> dict[str, float]:
    """Return greatest values and their places, by key."""
    return {
        key: number
        for name, (value, place) in peaks.items()
        for key, number in ((name, value), (f"{name}_at_in", place))
    }


def profile_text(document: Mapping[str, Any], published: PublishedBat | None) -> str:
    """Return a bat's properties, with published ones if there are any, and its curve."""
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
            "property": PROPERTIES[name][0],
            "unit": PROPERTIES[name][1],
            "computed": f"{value:.6g}",
            "published": number(said.get(name), "g"),
        }
        for name, value in computed.items()
    ]
    curve = [{key: document[key][i] for key in CURVE} for i in range(len(document["z_in"]))]
    swung = swing_text(document["swing_exponent"])
    return (
        f"{table_text(rows)}\n\nstruck by {document['ball']}, swing: {swung}\n"
        f"{table_text(curve, CURVE)}"
    )


def swing_text(exponent: float | None) -> str:
    """Return the name of the swing law."""
    return "constant energy" if exponent is None else f"n = {exponent:g}"


def balls_text(balls: Mapping[str, str]) -> str:
    """Return the ball for each bat, or one sentence if it is the same for all."""
    if len(set(balls.values())) == 1:
        return f"struck by {next(iter(balls.values()))}"
    return "; ".join(f"{bat} struck by {ball}" for bat, ball in balls.items())


def comparison_text(
    peaks: Sequence[Peaks], differences: Sequence[Difference], balls: Mapping[str, str]
) -> str:
    """Return the peaks of several bats, and their differences from those of the first."""
    swung = {"n": Column("swing", form=lambda row: swing_text(row.n))}
    tops = {"bat": Column("bat")} | swung | PEAK_COLUMNS
    pair = {"bat": Column("bat", form=lambda row: f"{row.bat} against {row.against}")}
    apart = pair | swung | columns_of(differences[0])
    return (
        f"greatest values (and where, inches from the tip), {balls_text(balls)}\n"
        f"{table_text(peaks, tops)}\n\n{table_text(differences, apart)}"
    )


def spread_of(rows: Sequence[LawRow]) -> str:
    """Return how far results spread over the laws of the ball."""
    spreads = (
        f"{name.removesuffix('_mph')} {_spread(rows, name):{form}}{f' {unit}' if unit else ''} "
        f"({_spread(rows, f'{name}_at_in'):.2f} in)"
        for name, (unit, form) in PEAKS.items()
    )
    return f"spread over the laws: {', '.join(spreads)}"


def _spread(rows: Sequence[LawRow], key: str) -> float:
    values = [row.peaks[key] for row in rows]
    return max(values) - min(values)


def _top(name: str, form: str) -> Callable[[Peaks | LawRow], str]:
    return lambda row: f"{row.peaks[name]:{form}} ({row.peaks[f'{name}_at_in']:.2f})"


PEAK_COLUMNS = {  # a greatest value, its place in brackets
    name: Column(name.removesuffix("_mph"), unit, _top(name, form))
    for name, (unit, form) in PEAKS.items()
}


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
