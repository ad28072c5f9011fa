"""Bat file from the measurements of a user, and the remaining uncertainty.

The bat is the most typical bat of the template that fits the data. Other bats are fitted with
random target values of the parameters, to the same data varied by their uncertainties. The
differences between these bats show which quantities the measurements do not determine.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from virtual_lab import catalog
from virtual_lab.catalog.specs import NO_SPREAD, BallSpec, BatBody
from virtual_lab.errors import InputError
from virtual_lab.files import new_files
from virtual_lab.measurement.reduction.kinematics import batted_speed
from virtual_lab.output.intervals import Interval, draw_intervals
from virtual_lab.output.progress import Progress, quiet
from virtual_lab.output.result import Json, StudyResult
from virtual_lab.output.tables import column, record, table_text
from virtual_lab.parameters import File, Seed, TwoOrMore
from virtual_lab.relations.peaks import peak
from virtual_lab.relations.swing import bat_speed
from virtual_lab.sheets import toml_text
from virtual_lab.simulation.collision.modal import ModalModel
from virtual_lab.simulation.collision.scene import Scenes
from virtual_lab.simulation.physics.beam import Free, beam_of
from virtual_lab.streams import Streams
from virtual_lab.studies.bats.bat_templates import (
    MEASURED,
    TEMPLATES,
    BatMeasurements,
    BodyFit,
    compute_quantities,
    fit,
    hoop_quantities,
    require_plausible_hoop,
)
from virtual_lab.studies.bats.profile import CONDITIONS, GameConditions
from virtual_lab.units import INCH, MPH

if TYPE_CHECKING:
    from virtual_lab.output.page_figure import PageFigure

PLACES_IN = np.arange(2.0, 10.01, 0.5)
UNUSUAL = 2.5  # deviation of a parameter that is stated [typical spreads]; most bats: up to 2
HINT = "'template measurements FILE' writes an empty form with all keys and units"
WORDS = (
    "e_A: free bat, standard ball of its sport, 160 mph; a certificate has those of its rules.\n"
    "v_f: batted ball in the game, bat swung at the same angular speed as others (n = 0); its\n"
    "position, the sweet spot, is from the tip."
)
PEAK, PEAK_PLACE, SWEET_SPOT = "peak e_A", "position of peak e_A", "sweet spot"
HOOP_UNITS = {"hoop frequency": "Hz", "hoop modal mass": "kg"}


@dataclass(frozen=True, slots=True, kw_only=True)
class Spread:
    """A quantity of the fitted bat, and its spread over the bats that fit the data."""

    quantity: str = column("quantity")
    unit: str = column("unit")
    value: float = column("this bat")
    lowest: float = column("lowest that fits the data")
    highest: float = column("highest")
    sd: float = column("standard deviation")
    is_measured: bool = column("measured", form=lambda row: "yes" if row.is_measured else "no")
    remark: str = column("remark", form="s")


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class FittedBat(StudyResult):
    """A fitted bat, its misfits, and the spread of its quantities over all bats that fit."""

    measured: BatMeasurements
    source: str  # name of the file of measurements
    fitted: BodyFit
    members: int  # number of bats for the spread
    spread: list[Spread]

    @property
    def document(self) -> Json:
        """The result for JSON."""
        parameters = TEMPLATES[self.measured.template].parameters
        values = self.fitted.parameters
        return {
            "bat": self.measured.name,
            "template": self.measured.template,
            "misfits": self.fitted.misfits,
            "parameters": {p.name: float(x) for p, x in zip(parameters, values, strict=True)},
            "members": self.members,
            "spread": [record(row) for row in self.spread],
        }

    name = "fit-bat"

    @property
    def title(self) -> str:
        """Title with the bat."""
        return f"{self.measured.name} fitted to its measurements"

    @property
    def rows(self) -> list[Spread]:
        """The spread, one row per quantity."""
        return self.spread

    @property
    def text(self) -> str:
        """The peaks, unusual parameters, the table of the spread, and the misfits."""
        worst = ", ".join(
            f"{name} {value / INCH:+.1e} in" if name.startswith("node") else f"{name} {value:+.1e}"
            for name, value in self.fitted.misfits.items()
        )
        rows = {row.quantity: row for row in self.spread}
        top, place, spot = rows[PEAK], rows[PEAK_PLACE], rows[SWEET_SPOT]
        answer = (
            f"peak e_A of {self.measured.name}: {top.value:.3f} ({top.lowest:.3f} to "
            f"{top.highest:.3f} among the bats that fit), {place.value:.1f} in from the tip"
            f"{place.remark and f', {place.remark}'}; sweet spot {spot.value:.1f} in from the tip "
            f"({spot.lowest:.1f} to {spot.highest:.1f})"
        )
        answer = ". ".join(part for part in (answer, self.unusual) if part)
        parts = (
            answer,
            table_text(self.spread),
            f"misfits (relative): {worst}",
            WORDS,
        )
        return "\n\n".join(parts)

    @property
    def unusual(self) -> str:
        """Sentence with the parameters unlike those of other bats, or "" if there are none."""
        template = TEMPLATES[self.measured.template]
        deviations = (self.fitted.parameters - template.usual) / template.spread
        pairs = zip(template.parameters, deviations, strict=True)
        far = "; ".join(f"{each.name} {x:+.1f}" for each, x in pairs if abs(x) > UNUSUAL)
        words = "Unlike other bats; check the measurements. Deviations in typical spreads"
        return f"{words}: {far}." if far else ""

    def draw(self) -> PageFigure:
        """Draw the spread of each quantity over the bats that fit, relative to this bat."""
        intervals = []
        for row in self.spread:
            if row.value:
                low, high = sorted(100 * (end / row.value - 1) for end in (row.lowest, row.highest))
                name = f"{row.quantity}, {row.value:.4g} {row.unit}".removesuffix(" 1")
                intervals.append(Interval(name, 0.0, low, high, hollow=not row.is_measured))
        label = "range over the bats that fit, relative to this bat, %"
        return draw_intervals(intervals, self.title, label, hollow="not measured")

    def write(self, path: Path) -> None:
        """Write the bat file, completely or not at all. Raises `InputError` if it exists."""
        with new_files(path.parent) as draft:
            (draft / path.name).write_text(self.toml, encoding="utf-8")

    @property
    def toml(self) -> str:
        """Content of the bat file; every number has a source."""
        body, measured, source = self.fitted.body, self.measured, self.source
        lines = [
            f"Fitted to measurements ({source}) with the {measured.template} template. Many other",
            f"bats fit them as well; lowest and highest are those of {self.members} of them.",
            "",
            *self.text.splitlines(),
        ]
        keys = ("name", "title", "sport", "construction")
        material = {"density": "kg/m^3", "youngs_modulus": "Pa", "shear_modulus": "Pa"}
        parts = {
            **_numbers(body, "assumed", damping_ratio="1"),
            "profile": _numbers(body.profile, source, z="m", outer_diameter="m", wall="m"),
            "material": _numbers(body.material, source, **material, shear_coefficient="1"),
            "lumps": [
                {"name": each.name, **_numbers(each, source, z="m", mass="kg")}
                for each in body.lumps
            ],
        }
        for key, unit in (("frequency", "Hz"), ("modal_mass", "kg")) if body.hoop else ():
            origin = "assumed" if getattr(measured, f"hoop_{key}") is None else source
            parts["hoop"] = parts.get("hoop", {}) | _numbers(body.hoop, origin, **{key: unit})
        spread = _numbers(
            NO_SPREAD, "this very bat", density="1", youngs_modulus="1", density_tilt="1"
        )
        stated = {key: words for key in keys if (words := getattr(measured, key))}
        comments = "".join(f"# {line}".rstrip() + "\n" for line in lines)
        return comments + toml_text({**stated, "body": parts, "spread": spread})


def fit_bat(
    path: File,
    *,
    members: TwoOrMore = 12,
    seed: Seed = 1,
    progress: Progress = quiet,
) -> FittedBat:
    """Fit a bat to measurements in a form.

    The table has the uncertainty that remains.

    Parameters
    ----------
    path
        File of the measurements, .toml: the filled-in form that ``template measurements FILE``
        writes, with the keys ``name``, ``title``, ``template`` (wood or hollow), ``length``,
        ``mass``, ``z_cm`` (balance point), ``inertia`` and ``inertia_axis``. Positions are
        distances from the barrel tip: subtract those from the knob from the length. Optional keys:
        ``sport``, ``construction``, ``bending_frequencies`` and ``barrel_nodes`` (of the first two
        modes), ``hoop_frequency``, ``hoop_modal_mass``, and the u of a number, such as ``mass_u``.
        A number is a table, such as
        mass = { value = 30, unit = "oz", source = "measured", verified = true }.
    members
        Number of fitted bats that show the spread. A bat is omitted if its fit fails.
    seed
        Seed of the random parameters and of the variation of the measurements.
    progress
        Function that is called with a message, the number of bats fitted, and the total. Before the
        collisions are computed, it is called with a message only. If it is not given, the functions
        of `virtual_lab` and the commands show the progress on stderr.

    Raises
    ------
    InputError
        The file cannot be used, `members` is below 2, no bat of the template fits the data, or the
        modal mass of the hoop mode is below half or above twice the modal mass of a shell with the
        bat's outline.
    """
    path = str(path)
    try:
        if not path.endswith(".toml"):
            raise InputError("", "measurements", path, "allowed: a .toml file")
        measured = catalog.load("bats", path, BatMeasurements).spec
        require_plausible_hoop(measured)
        best = fit(measured)
    except InputError as fault:
        allowed = f"{fault.allowed}; {HINT}"
        raise InputError(fault.where and path, fault.key, fault.value, allowed) from fault
    template = TEMPLATES[measured.template]
    streams = Streams(seed)
    draws = streams.normal("fit-bat", (members, len(template.parameters)))
    errors = streams.normal("fit-bat measurements", (members, len(MEASURED), 2))
    bodies = []
    for number, (draw, error) in enumerate(zip(draws, errors, strict=True)):
        progress("bats that fit the data", number, members)
        target = template.usual + template.spread * draw
        try:
            bodies.append(fit(measured.vary(error), target).body)
        except ValueError:  # the fit does not reach the data, or the data contradict themselves
            continue
    progress("collisions")
    units, best_values = _quantities(best.body, measured)
    member_values = [_quantities(body, measured)[1] for body in bodies] or [best_values]
    table = np.array([list(values.values()) for values in member_values])
    rows = [
        Spread(
            quantity=name,
            unit=unit,
            value=value,
            lowest=float(min(every.min(), value)),
            highest=float(max(every.max(), value)),
            sd=float(every.std(ddof=1)) if len(every) > 1 else 0.0,
            is_measured=name in measured.goals,
            remark=remark_on(name, value, *every),
        )
        for (name, value), unit, every in zip(best_values.items(), units, table.T, strict=True)
    ]
    return FittedBat(
        measured=measured,
        source=Path(path).name,
        fitted=best,
        members=len(bodies),
        spread=rows,
    )


def _quantities(body: BatBody, measured: BatMeasurements) -> tuple[list[str], dict[str, float]]:
    """Return the units and the values of the quantities of a bat, in the same order."""
    values = compute_quantities(body, measured.inertia_axis, frequencies=2, nodes=2)
    game = catalog.load("conditions", CONDITIONS, GameConditions).spec
    ball = catalog.load("balls", game.ball_of(measured.sport), BallSpec).spec
    z = PLACES_IN * INCH
    moving = np.asarray(bat_speed(game.angular_speed, beam_of(body).length, z))
    speeds = np.concatenate([np.full(z.size, 160 * MPH), game.pitch_speed + moving])
    scenes = Scenes.with_ball(ball, impact_position=np.tile(z, 2), relative_speed=speeds)
    e_A, in_game = np.split(ModalModel.of(body, Free()).collide(scenes).collision_efficiency, 2)
    v_f = np.asarray(batted_speed(in_game, game.pitch_speed, moving))
    top, fastest = peak(PLACES_IN, e_A), peak(PLACES_IN, v_f / MPH)
    rows = [
        *((name, HOOP_UNITS[name], value) for name, value in hoop_quantities(body).items()),
        ("f1", "Hz", values["f1"]),
        ("f2", "Hz", values["f2"]),
        ("node1", "in", values["node1"] / INCH),
        ("node2", "in", values["node2"] / INCH),
        *(
            (f"e_A at {z:g} in", "1", float(e_A[z == PLACES_IN][0]))
            for z in (3.0, 5.0, 6.0, 7.0, 9.0)
        ),
        (PEAK, "1", top.value),
        (PEAK_PLACE, "in", top.place),
        ("largest v_f", "mph", fastest.value),
        (SWEET_SPOT, "in", fastest.place),
    ]
    return [unit for _, unit, _ in rows], {name: value for name, _, value in rows}


def remark_on(quantity: str, *values: float) -> str:
    """Return a remark if the position of a peak is at an end of the searched range.

    The peaks are those of e_A, the collision efficiency, and of v_f, the speed of the batted ball.
    The searched range is 2 to 10 in from the tip. `quantity` is the name of a quantity, and
    `values` are its values for several bats. The result is an empty string if the quantity is not
    such a position, or if all values are inside the range.
    """
    low, high = PLACES_IN[0], PLACES_IN[-1]
    if quantity in (PEAK_PLACE, SWEET_SPOT) and (min(values) <= low or max(values) >= high):
        return f"at the end of the range {low:g} to {high:g} in: the true peak may lie beyond it"
    return ""


def _numbers(part: object, source: str, **units: str) -> Json:
    """Return numbers of a part of a bat as its sheet states them, in SI units with 7 digits."""
    return {
        key: {"value": _rounded(value), "unit": unit, "source": source, "verified": False}
        for key, unit in units.items()
        if (value := getattr(part, key)) is not None
    }


def _rounded(value: float | tuple[float, ...]) -> float | list[float]:
    if isinstance(value, tuple):
        return [float(f"{each:.7g}") for each in value]
    return float(f"{value:.7g}")
