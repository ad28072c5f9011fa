"""Profiles and comparisons of bats as plain text."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from virtual_lab.catalog.specs import PublishedBat
from virtual_lab.output.rounding import in_both_units, with_unit
from virtual_lab.output.tables import Column, column, columns_of, inline, number, table_text
from virtual_lab.relations.peaks import Peak
from virtual_lab.units import INCH, OUNCE, OZ_IN2

PEAKS = {  # curve: symbol, unit and format
    "restitution": ("e", "", ".4f"),
    "bat_performance_factor": ("BPF", "", ".4f"),
    "collision_efficiency": ("e_A", "", ".4f"),
    "batted_speed_mph": ("v_f", "mph", ".2f"),
}
INERTIAL = {  # key: words, unit
    "mass_oz": ("mass", "oz"),
    "z_cm_in": ("balance point from the tip", "in"),
    "i_cm_oz_in2": ("moment of inertia about it", "oz in²"),
    "i_knob_oz_in2": ("moment of inertia, 1 in from the knob", "oz in²"),
    "i_pivot_oz_in2": ("moment of inertia, 6 in from the knob", "oz in²"),
}
CURVE = {
    "impact_position_in": Column("position from the tip", "in", ".2f"),
    "restitution": Column("restitution", form=".4f"),
    "recoil_factor": Column("recoil_factor", form=".4f"),
    "collision_efficiency": Column("collision_efficiency", form="+.4f"),
    "bat_speed_mph": Column("bat speed", "mph", ".2f"),
    "batted_speed_mph": Column("batted-ball speed", "mph", ".2f"),
}
TWICE = "ball and bat touch more than once at these positions [in], which no largest value is from"


@dataclass(frozen=True, slots=True, kw_only=True)
class Peaks:
    """Largest values on a barrel and their positions, by the keys of `peak_entries`."""

    bat: str
    swing_exponent: float | None  # None: constant energy
    peaks: Mapping[str, float] = inline()


@dataclass(frozen=True, slots=True, kw_only=True)
class Difference:
    """Differences of the peaks of `bat` from the peaks of `against` [%], for v_f in mph."""

    bat: str
    against: str
    swing_exponent: float | None
    restitution_difference_percent: float = column("e", "%", "+.1f")
    bat_performance_factor_difference_percent: float = column("BPF", "%", "+.1f")
    collision_efficiency_difference_percent: float = column("e_A", "%", "+.1f")
    batted_speed_difference_mph: float = column("v_f", "mph", "+.2f")


@dataclass(frozen=True, slots=True, kw_only=True)
class LawRow:
    """Results for a force law of the ball: impact on a wall, and peaks of a bat."""

    bat: str
    law: str = column("law")
    exponent: float = column("exponent", form="g")
    stiffness: float
    wall_time_ms: float = column("time on a wall", "ms", ".3f")
    wall_force_kn: float = column("force on a wall", "kN", ".1f")
    peaks: Mapping[str, float] = inline()


def peak_entries(peaks: Mapping[str, Peak]) -> dict[str, float]:
    """Return the largest value of each curve and its position in one mapping.

    Each curve has two keys, for example ``peak_restitution`` and ``peak_restitution_position_in``
    for the curve ``restitution``. The units are the units of `peaks`: positions in inches from the
    tip, batted-ball speed in mph.
    """
    return {
        key: number
        for name, (value, place) in peaks.items()
        for key, number in ((f"peak_{name}", value), (peak_position(name), place))
    }


def peak_position(name: str) -> str:
    """Return the key of the position of a peak, such as ``peak_restitution_position_in``.

    `name` is the name of the curve; its ending ``_mph`` is dropped.
    """
    return f"peak_{name.removesuffix('_mph')}_position_in"


def profile_text(
    document: Mapping[str, Any],
    curve: Sequence[Mapping[Hashable, float]],
    published: PublishedBat | None,
) -> str:
    """Return the properties of a bat and its curves along the barrel as text with two tables.

    Parameters
    ----------
    document
        `BatProfile.document`, with lengths in inches and speeds in mph.
    curve
        `BatProfile.rows`, one per impact position.
    published
        Published properties, which are printed beside the computed ones; None if there are none.
    """
    computed = _properties(
        [document[key] for key in INERTIAL],
        document["modal_frequencies_hz"][:4],
        document["barrel_nodes_in"],
    )
    published_values = {}
    if published is not None:
        published_values = _properties(
            [
                published.mass / OUNCE,
                published.z_cm and published.z_cm / INCH,
                *(
                    inertia and inertia / OZ_IN2
                    for inertia in (
                        published.inertia_cm,
                        published.inertia_knob,
                        published.inertia_pivot,
                    )
                ),
            ],
            published.bending_frequencies,
            [node / INCH for node in published.barrel_nodes],
        )
    rows = [
        {
            "property": words,
            "unit": unit,
            "computed": f"{value:.6g}",
            "published": number(published_values.get((words, unit)), "g"),
        }
        for (words, unit), value in computed.items()
    ]
    swung = swing_text(document["swing_exponent"])
    (speed, fastest), (e_A, best) = (
        document["peaks"][name].values() for name in ("batted_speed_mph", "collision_efficiency")
    )
    twice = ", ".join(f"{row['impact_position_in']:g}" for row in curve if row["contacts"] > 1)
    repeated = f"\n\n{TWICE}: {twice}" if twice else ""
    return (
        f"{document['bat']} hits a ball up to {with_unit(speed, 'mph', '.1f')} fast, "
        f"{fastest:.1f} in from the tip (sweet spot); "
        f"e_A is largest, {e_A:.3f}, at {best:.1f} in\n\n"
        f"{table_text(rows)}\n\nstruck by {document['ball']}, swing: {swung}\n"
        f"{table_text(curve, CURVE).rstrip()}{repeated}"
    )


def _properties(
    inertial: Sequence[float | None], frequencies: Sequence[float], nodes: Sequence[float]
) -> dict[tuple[str, str], float | None]:
    """Return inertial properties, frequencies [Hz] and nodes [in], by name and unit."""
    return {
        **dict(zip(INERTIAL.values(), inertial, strict=True)),
        **{(f"bending frequency {i}", "Hz"): f for i, f in enumerate(frequencies, start=1)},
        **{(f"node of mode {i} from the tip", "in"): z for i, z in enumerate(nodes, start=1)},
    }


def swing_text(exponent: float | None) -> str:
    """Return the swing law as printed: ``n = 0.3``, or ``constant energy`` for None."""
    return "constant energy" if exponent is None else f"n = {exponent:g}"


def balls_text(balls: Mapping[str, str]) -> str:
    """Return a text that names the ball used with each bat.

    `balls` maps the name of each bat to the name of its ball. If all bats have the same ball, it is
    named once.
    """
    if len(set(balls.values())) == 1:
        return f"struck by {next(iter(balls.values()))}"
    return "; ".join(f"{bat} struck by {ball}" for bat, ball in balls.items())


def comparison_text(
    peaks: Sequence[Peaks], differences: Sequence[Difference], balls: Mapping[str, str]
) -> str:
    """Return the hardest hitter, and two tables: peaks of the bats, differences from the first.

    `balls` maps the name of each bat to the name of its ball. Raises `IndexError` if `differences`
    is empty.
    """
    swung = {"swing_exponent": Column("swing", form=lambda row: swing_text(row.swing_exponent))}
    tops = {"bat": Column("bat")} | swung | PEAK_COLUMNS
    pair = {"bat": Column("bat", form=lambda row: f"{row.bat} against {row.against}")}
    columns = pair | swung | columns_of(differences[0])
    return (
        f"{_hardest_hitters(peaks)}\n\n"
        f"largest values (at inches from the tip), {balls_text(balls)}\n"
        f"{table_text(peaks, tops)}\n\n{table_text(differences, columns)}"
    )


def _hardest_hitters(peaks: Sequence[Peaks]) -> str:
    """Return the bat with the fastest batted ball, and its lead, for each swing law.

    Two bats hit equally hard if the lead is 0.0 in print.
    """
    answers = []
    for law in dict.fromkeys(row.swing_exponent for row in peaks):
        speeds = {
            row.bat: row.peaks["peak_batted_speed_mph"]
            for row in peaks
            if row.swing_exponent == law
        }
        first, second = sorted(speeds, key=lambda bat: -speeds[bat])[:2]
        lead = speeds[first] - speeds[second]
        faster = f"if a bat of smaller inertia is swung faster ({swing_text(law)})"
        swung = "swung at the same angular speed" if law == 0 else faster
        top, more = (with_unit(each, "mph", ".1f") for each in (speeds[first], lead))
        if lead < 0.05:
            answers.append(f"{swung}, {first} and {second} hit equally hard: up to {top}")
        else:
            answers.append(f"{swung}, {first} hits hardest: up to {top}, {more} more than {second}")
    return "; ".join(answers)


def spread_of(rows: Sequence[LawRow]) -> str:
    """Return a sentence with the variation of the peaks and their positions between force laws.

    For each peak (bat-ball restitution e, bat performance factor BPF, collision efficiency e_A and
    batted-ball speed v_f) it states the largest minus the smallest value, and the same for its
    position [in]. `rows` has one row per force law, at least one.
    """
    spreads = (
        f"{symbol} {with_unit(_spread(rows, f'peak_{name}'), unit, form)}, "
        f"its position {_spread(rows, peak_position(name)):.2f} in"
        for name, (symbol, unit, form) in PEAKS.items()
    )
    return f"spread over the laws: {'; '.join(spreads)}"


def _spread(rows: Sequence[LawRow], key: str) -> float:
    values = [row.peaks[key] for row in rows]
    return max(values) - min(values)


def _top(name: str, form: str) -> Callable[[Peaks | LawRow], str]:
    unit = PEAKS[name][1]
    return lambda row: (
        f"{in_both_units(row.peaks[f'peak_{name}'], unit, form)} at "
        f"{row.peaks[peak_position(name)]:.2f}"
    )


PEAK_COLUMNS = {  # largest values, at their positions
    name: Column(symbol, unit, _top(name, form)) for name, (symbol, unit, form) in PEAKS.items()
}
