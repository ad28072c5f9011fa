"""Comparison of bats under standard game conditions (the paper's Figs. 3 and 4).

All numbers are model results for nominal bats, not measurements.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from virtual_lab import catalog
from virtual_lab.catalog.specs import Sport
from virtual_lab.errors import InputError
from virtual_lab.files.dictionary import with_units
from virtual_lab.output.result import Json, StudyResult, frame
from virtual_lab.output.tables import record
from virtual_lab.parameters import AnyLaboratory, SwingExponents, values_of
from virtual_lab.sheets import (
    AnyBall,
    AnyBat,
    AnyBats,
    Instruments,
    entry_name,
    entry_names,
)
from virtual_lab.studies.bats.curves import draw_comparison
from virtual_lab.studies.bats.profile import BatProfile, profiles
from virtual_lab.studies.bats.text import Difference, Peaks, comparison_text, peak_entries
from virtual_lab.units import OZ_IN2

if TYPE_CHECKING:
    import pandas as pd

    from virtual_lab.output.page_figure import PageFigure

PROFILE_SWINGS = (0.0, 0.5)


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class BatComparison(StudyResult):
    """Profiles of several bats, one per bat and exponent n of the swing law."""

    profiles: tuple[BatProfile, ...]  # sorted by bat, then by n

    name = "compare"

    @property
    def title(self) -> str:
        """Title with the names of the bats."""
        return f"Comparison of {', '.join(self.balls)}"

    @property
    def rows(self) -> list[Peaks]:
        """The peaks, one row per bat and exponent."""
        return self.peaks

    @property
    def table(self) -> pd.DataFrame:
        """The curves, one row per bat, exponent and position."""
        return self.curves

    @property
    def tables(self) -> dict[str, pd.DataFrame]:
        """Tables of curves, peaks and differences."""
        return {
            self.name: self.curves,
            "peaks": frame(self.peaks),
            "differences": frame(self.differences),
        }

    @property
    def text(self) -> str:
        """Tables of the peaks, and of their differences from the first bat."""
        return comparison_text(self.peaks, self.differences, self.balls)

    def draw(self) -> PageFigure:
        """Draw the paper's Figs. 3 and 4 of these bats."""
        return draw_comparison(self.curves)

    @property
    def curves(self) -> pd.DataFrame:
        """One row per bat, exponent and impact position."""
        import pandas as pd

        parts = [
            pd.DataFrame(
                {"bat": each.bat.name, "swing_exponent": each.swing} | each.table.to_dict("list")
            )
            for each in self.profiles
        ]
        return with_units(pd.concat(parts, ignore_index=True))

    @property
    def peaks(self) -> list[Peaks]:
        """One row per bat and exponent."""
        return [
            Peaks(bat=each.bat.name, swing_exponent=each.swing, peaks=peak_entries(each.peaks))
            for each in self.profiles
        ]

    @property
    def differences(self) -> list[Difference]:
        """One row per exponent and bat except the first, compared with the first bat."""
        first, speed = self.profiles[0].bat.name, "peak_batted_speed_mph"
        base = {row.swing_exponent: row.peaks for row in self.peaks if row.bat == first}
        return [
            Difference(
                bat=row.bat,
                against=first,
                swing_exponent=row.swing_exponent,
                batted_speed_difference_mph=row.peaks[speed] - base[row.swing_exponent][speed],
                **{
                    f"{name}_difference_percent": 100
                    * (row.peaks[f"peak_{name}"] / base[row.swing_exponent][f"peak_{name}"] - 1)
                    for name in ("restitution", "bat_performance_factor", "collision_efficiency")
                },
            )
            for row in self.peaks
            if row.bat != first
        ]

    @property
    def balls(self) -> dict[str, str]:
        """Name of the ball for each bat."""
        return {each.bat.name: each.ball.name for each in self.profiles}

    @property
    def sports(self) -> set[Sport | None]:
        """Sports of these balls; None means an unknown sport."""
        return {each.ball.sport for each in self.profiles}

    @property
    def document(self) -> Json:
        """The result for JSON."""
        return {
            "reference_inertia_oz_in2": self.profiles[0].reference_inertia / OZ_IN2,
            "balls": self.balls,
            "swing_law": self.profiles[0].document["swing_law"],
            "peaks": [record(row) for row in self.peaks],
            "differences": [record(row) for row in self.differences],
            "profiles": [each.document for each in self.profiles],
        }


def profile(
    bats: AnyBats,
    *more: AnyBat,
    swings: SwingExponents = (),
    ball: AnyBall | None = None,
    laboratory: AnyLaboratory | None = None,
    instruments: Instruments = (),
) -> BatProfile | BatComparison:
    """Show how hard a bat hits along the barrel.

    The result of one bat has its curves along the barrel, modal frequencies and nodes. The result
    of several bats has the largest e, BPF, e_A and v_f of each bat, and the differences between the
    bats. The largest values are those up to 12 in from the tip where ball and bat touch once.

    The symbols: e is the restitution of bat and ball, BPF the bat performance factor, r the recoil
    factor, e_A the collision efficiency, and v_f the speed of the batted ball.

    Parameters
    ----------
    bats
        Bat: a name in the catalog or a .toml file.

        In Python, a sheet such as ``vl.bat("r161")``, or a list, is also allowed.
    more
        Further bats, instead of a list.
    swings
        Exponent n of the swing law, 0 to 0.5. The speed of a bat with the moment of inertia I,
        about a point 1 in from the knob end, is that of the game, multiplied by
        (17000 oz in^2 / I)^n. With 0 all bats are swung at the same speed. One bat has one
        exponent, by default 0. For several bats the default is 0 and 0.5; swings of players suggest
        about 0.3 (unverified).
    ball
        Ball in play on the field: a name in the catalog or a .toml file. By default the standard
        ball of the bat's sport.
    laboratory
        Folder of a laboratory, made by ``laboratory`` or by hand. Its sheets of instruments, rigs
        and balls replace those of the catalog.
    instruments
        Instruments and rigs with changed values, used instead of the catalog entries.

        Example: ``[vl.instrument("pivot-gates").with_(distance_u="0.2 mm")]``.

    Raises
    ------
    InputError
        Several exponents are stated for one bat, two bats have the same name, or a bat, a ball or
        an exponent cannot be used.
    """
    several, exponents = entry_names(bats) + entry_names(more), values_of(swings)
    ball = None if ball is None else entry_name(ball)
    alone = len(several) == 1
    exponents = tuple(dict.fromkeys(exponents or PROFILE_SWINGS[: 1 if alone else None]))
    if not alone:
        return compare(several, swings=exponents, ball=ball)
    if len(exponents) > 1:
        allowed = "one bat is profiled with one exponent; name several bats to compare them"
        raise InputError("", "swing", exponents[1], allowed)
    return profiles(several[0], swings=exponents, ball=ball)[0]


def compare(
    bats: Sequence[str],
    *,
    swings: Sequence[float | None] = PROFILE_SWINGS,
    reference_bat: str | None = None,
    ball: str | None = None,
) -> BatComparison:
    """Return the comparison of several free bats under standard game conditions.

    Parameters
    ----------
    bats
        At least two: names in the catalog or paths of .toml files.
    swings
        Exponents n of the swing law, Eq. (14) of Nathan (2003). None means the law of constant
        energy.
    reference_bat
        Bat whose moment of inertia is I0 in the law. By default the I0 of the game conditions is
        used, 17000 oz in². Nathan (2003) uses the barrel-loaded bat for the two loaded bats.
    ball
        Name in the catalog or path of a .toml file; by default the standard ball of each bat's
        sport.

    Raises
    ------
    InputError
        There are fewer than two bats, or two have the same name. No exponent is stated, or an
        exponent is not between 0 and 0.5. A bat or a ball cannot be used.
    """
    if len(bats) < 2:
        raise InputError("", "bats", ", ".join(bats) or "none", "allowed: at least two")
    if not swings:
        raise InputError("", "swing", "none", "allowed: at least one, each 0 to 0.5")
    exponents = tuple(dict.fromkeys(swings))
    groups = [
        profiles(bat, swings=exponents, reference_bat=reference_bat, ball=ball) for bat in bats
    ]
    catalog.require_own_names("bats", [each[0].bat.name for each in groups])
    return BatComparison(profiles=tuple(bat_profile for each in groups for bat_profile in each))
