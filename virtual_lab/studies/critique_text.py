"""Text of the study of procedures for a terminal."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from virtual_lab.output.tables import inline, number, table_text
from virtual_lab.studies.bats.text import balls_text, swing_text


@dataclass(frozen=True, slots=True, kw_only=True)
class Placed:
    """A bat by a procedure and on the field."""

    bat: str
    procedure: str
    ball: str
    metric: str
    unit: str
    value: float | None  # by an error-free laboratory
    laboratories: int  # with a result
    mean: float | None
    sd: float | None
    v_f_mph: Mapping[str, float]  # greatest in the field, by swing: ``n0.3``, ``energy``


@dataclass(frozen=True, slots=True, kw_only=True)
class Ranking:
    """Ranking of two bats by a procedure, compared with the field.

    The verdict is ``as the field``, ``other way round``, ``by chance`` (neither is certain),
    ``tie`` (no order on the field), ``no result``.
    """

    laboratories: int  # with a result
    mean: float | None = None  # of the difference
    sd: float | None = None
    probability: float | None = None  # of the other order, by the normal law of mean and sd
    wrong: int | None = None  # laboratories that found it
    low: float | None = None  # of their share, by Clopper and Pearson, 95 %
    high: float | None = None
    verdict: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Pair:
    """Ranking of two bats by a procedure; differences are first minus second bat."""

    first: str
    second: str
    n: float | None  # exponent of the field's swing law; None: constant energy
    v_f_mph: float
    procedure: str
    own_n: float | None
    metric: str
    difference: float | None  # by an error-free laboratory
    ranking: Ranking = inline()


def critique_text(
    metrics: Sequence[Placed], pairs: Sequence[Pair], balls: Mapping[str, str]
) -> str:
    """Return ranks of all bats by procedure and on the field, and pairs in the wrong order."""
    tables: dict[str, dict[str, str]] = {}
    for row in metrics:
        line = tables.setdefault(row.bat, {"bat": row.bat})
        for key, speed in row.v_f_mph.items():
            rank = 1 + sum(other > speed for other in {each.v_f_mph[key] for each in metrics})
            swing = f"n = {key[1:]}" if key.startswith("n") else "constant energy"
            line[f"v_f, {swing}"] = f"{speed:.1f} ({rank})"
        rivals = [each.value for each in metrics if each.procedure == row.procedure]
        line[row.procedure] = _placed(row, [value for value in rivals if value is not None])
    tested = {row.procedure: row.ball for row in metrics}
    fires = [f"{name} fires {ball}" for name, ball in tested.items()]
    fired = "; ".join([f"in the field {balls_text(balls)}", *fires])
    found: dict[tuple[str, str, str], dict[str, str]] = {}
    for each in pairs:
        ranked = each.ranking
        pair, swing = f"{each.first} - {each.second}", swing_text(each.n)
        empty = {"pair": pair, "procedure": "the field", "error-free": "", "mean": "", "sd": ""}
        field = found.setdefault((each.first, each.second, ""), empty)
        field[swing] = f"{each.v_f_mph:+.2f} mph"
        line = found.setdefault(
            (each.first, each.second, each.procedure),
            {
                "pair": "",
                "procedure": f"{each.procedure}, {each.metric}",
                "error-free": number(each.difference, "+.4f"),
                "mean": number(ranked.mean, "+.4f"),
                "sd": number(ranked.sd, ".4f"),
            },
        )
        line[swing] = ranked.verdict
        if ranked.probability is not None:
            line[swing] += f" {ranked.probability:.3f} ({ranked.wrong} of {ranked.laboratories})"
    return (
        "error-free laboratory, place among the bats in brackets\n"
        f"{table_text(list(tables.values()))}\n{fired}\n\n"
        "first bat less second; probability of the other order than the field's, and laboratories "
        f"that found it\n{table_text(list(found.values()))}"
    )


def _placed(row: Placed, rivals: Sequence[float]) -> str:
    """Return an error-free metric with its rank among those of all bats."""
    if row.value is None:
        return "no result"
    places = 2 if row.unit == "mph" else 4
    rank = 1 + sum(other > row.value for other in rivals)
    return f"{row.metric} {row.value:.{places}f} ({rank})"
