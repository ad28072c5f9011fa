"""Effect of hits away from the center of percussion on a pivoted test (the paper's Sec. V B).

Such hits load the pivot. Each shot is simulated with the installed bearing, with a plain bearing
and with a loose bearing. The differences show the effect of the bearing on e_A by recoil. e_A by
rebound, which does not depend on the pivot, is computed for comparison.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from math import nan
from typing import TYPE_CHECKING, Any

import numpy as np

from virtual_lab.errors import InputError
from virtual_lab.lab import Laboratory, TestSetup, run_test
from virtual_lab.lab.plans import with_records
from virtual_lab.measurement.procedure import percussion_position
from virtual_lab.measurement.reduction.observations import ImpactReadings, along_of
from virtual_lab.measurement.reduction.shot_algebra import bat_properties
from virtual_lab.measurement.session_reduction import Reduction, reduce_block
from virtual_lab.output.progress import Progress, quiet
from virtual_lab.output.result import Json, StudyResult
from virtual_lab.output.tables import column, record, table_text
from virtual_lab.parameters import Seed
from virtual_lab.records.block import SessionBlock
from virtual_lab.records.session import Session
from virtual_lab.sheets import AnyBat, Instruments, entry_name
from virtual_lab.simulation.faults.fault import with_sheet
from virtual_lab.simulation.physics.beam import Pinned, beam_of
from virtual_lab.simulation.stations.rig import Reality, ShotPlan, Stage
from virtual_lab.studies.bats.percussion_chart import draw_percussion
from virtual_lab.uncertainty.budget import HITS, Variants, combine_components, type_a_component
from virtual_lab.uncertainty.scatter import Scatter
from virtual_lab.units import INCH, Array

if TYPE_CHECKING:
    from virtual_lab.output.page_figure import PageFigure

READINGS = {"recoil": "recoil_efficiency", "rebound": "rebound_efficiency"}


def _milli(key: str, form: str) -> Callable[[Any], str]:
    """Return a function that prints the field `key` in thousandths; None is printed as blank."""

    def text(row: object) -> str:
        value = getattr(row, key)
        return "" if value is None else f"{1e3 * value:{form}}"

    return text


@dataclass(frozen=True, slots=True, kw_only=True)
class ReadError:
    """Errors of e_A by one method; None if no rebound was detected."""

    # error without randomness
    bias: float | None = column("error", "1e-3", _milli("bias", "+.2f"))
    # root mean squares over laboratories, of the error and of the stated u
    rms_error: float | None = column("rms", "1e-3", _milli("rms_error", ".2f"))
    rms_u: float | None = column("u", "1e-3", _milli("rms_u", ".2f"))


@dataclass(frozen=True, slots=True, kw_only=True)
class PositionReadings:
    """One impact position: nominal values, and errors of e_A by recoil and by rebound."""

    impact_position_in: float = column("position from the tip", "in", ".2f")
    collision_efficiency: float = column("true e_A", form=".4f")
    reaction_ns: float = column(
        "impulse on the axis", "N s", "+.2f"
    )  # positive in the direction of the ball
    reaction_n: float = column("mean force", "N", "+.0f")
    ring_mrad: float = column(
        "vibration at the encoder", "mrad", ".2f"
    )  # amplitude of the vibration at the encoder
    rebounds_detected: float = column("rebounds detected", form=".0%")
    recoil: ReadError
    rebound: ReadError
    plain_shift: float = column("shift, plain bearing", "1e-3", _milli("plain_shift", "+.3f"))
    loose_shift: float = column("shift, loose bearing", "1e-3", _milli("loose_shift", "+.3f"))


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class PercussionStudy(StudyResult):
    """Errors of e_A and loads of the axis, one row per impact position."""

    bat: str
    percussion_in: float  # center of percussion of the nominal bat, from the tip
    rows: list[PositionReadings]

    name = "percussion"

    @property
    def title(self) -> str:
        """Title with the bat."""
        return f"{self.bat} hit away from its center of percussion"

    @property
    def text(self) -> str:
        """Table of the positions, and sentences on the largest errors."""
        return _text(self.rows, self.percussion_in)

    def draw(self) -> PageFigure:
        """Draw errors, shifts and loads against the impact position."""
        return draw_percussion(self.table, self.percussion_in, self.bat)

    @property
    def document(self) -> Json:
        """The result for JSON."""
        return {
            "bat": self.bat,
            "percussion_in": self.percussion_in,
            "places": [record(row) for row in self.rows],
        }


@dataclass(frozen=True, slots=True, kw_only=True)
class LaboratoryReading:
    """Means of the shots of one laboratory at a position, by `READINGS`; NaN without a rebound."""

    detected: float  # share of shots with a detected rebound
    error: Mapping[str, float]
    u: Mapping[str, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class _Stand:
    """A laboratory that has measured bat and balls, ready to fire at any impact position."""

    laboratory: Laboratory
    session: Session

    @classmethod
    def of(cls, bat: str, seed: int, reality: Reality) -> _Stand:
        setup = TestSetup.of(bat, procedure="astm-f1881", seed=seed, reality=reality)
        laboratory = Laboratory.open(setup)
        session = run_test(laboratory).of(0).certification.session
        return cls(laboratory=laboratory, session=session)

    def counting_finely(self) -> _Stand:
        """Return the laboratory with an encoder that does not round its counts to integers."""
        stations: Any = self.laboratory.stations
        impact = with_sheet(stations[Stage.IMPACT], "encoder", whole_counts=False)
        laboratory = replace(self.laboratory, stations={**stations, Stage.IMPACT: impact})
        return replace(self, laboratory=laboratory)

    def fire(
        self, place: float, shots: int, number: int, **bearing: float
    ) -> tuple[tuple[Reduction, ImpactReadings], Array, Array]:
        """Fire shots at an impact position [m from the tip].

        Return reduction and readings, true e_A and contact time [s], arrays of shape (shot,).
        `bearing` changes constants of the pivot.
        """
        laboratory, stage = self.laboratory, Stage.IMPACT
        plan = ShotPlan(
            slot=1_000_000
            + number * shots
            + np.arange(shots),  # above all shot numbers of the test
            ball=np.arange(shots) % laboratory.rules.spec.balls,
            speed=np.full(shots, laboratory.rules.spec.ball_speed),
            place=np.full(shots, place - along_of(self.session)),
        )
        station = with_sheet(laboratory.stations[stage], "pivot", **bearing)
        play = station.play(plan, laboratory.specimen, laboratory.draws)
        block = SessionBlock.of(with_records(self.session, stage, [play]))
        reduced = reduce_block(block)
        return reduced, play.truth["collision_efficiency"], play.truth["contact_time"]


def percussion(
    bat: AnyBat,
    *,
    laboratories: int = 10,
    seed: Seed = 1,
    shots: int = 6,
    instruments: Instruments = (),
    progress: Progress = quiet,
) -> PercussionStudy:
    """Show the errors of the collision efficiency e_A away from the center of percussion.

    The bat is on a pivot. The table has one row per impact position.

    Parameters
    ----------
    bat
        The bat: a name in the catalog or a .toml file.

        Or a sheet, ``vl.bat("r161")``, whose values may be changed.
    laboratories
        Number of laboratories.
    seed
        Seed of the first laboratory; the others follow.
    shots
        Number of shots per laboratory and impact position. A reading is the mean of these shots.
    instruments
        Instruments and rigs with changed values, used instead of the catalog entries.

        Example: ``[vl.instrument("pivot-gates").with_(distance_u="0.2 mm")]``.
    progress
        Function that is called with a message, the number of impact positions done in all
        laboratories, and the total. If it is not given, the functions of `virtual_lab` and the
        commands show the progress on stderr.

    Returns
    -------
    PercussionStudy
        One row per impact position. The positions are 2 to 12 in from the tip in steps of 1 in, and
        the center of percussion. Two more positions are 0.01 in away from the center of percussion,
        one on each side.

    Raises
    ------
    InputError
        There are fewer than 2 laboratories or shots, or the bat is unknown.
    """
    bat = entry_name(bat)
    for name, number in (("laboratories", laboratories), ("shots", shots)):
        if number < 2:
            raise InputError("", name, number, "allowed: at least 2")
    still = _Stand.of(bat, 0, Reality.NOISE_FREE)
    body = still.laboratory.specimen.bat.body
    beam = beam_of(body)
    inertial = {"length": beam.length, "mass": beam.mass, "z_cm": beam.z_cm}
    axis = still.laboratory.rules.spec.pivot_from_knob
    centre = percussion_position(inertial | {"inertia_cm": beam.inertia_cm}, axis)
    beside = (
        np.array([-0.01, 0.0, 0.01]) * INCH
    )  # at these positions the bearing takes up its clearance late
    places = np.sort(np.append(np.arange(2.0, 12.01, 1.0) * INCH, centre + beside))
    readings: list[list[LaboratoryReading]] = [[] for _ in places]
    for laboratory in range(laboratories):
        stand = _Stand.of(bat, seed + laboratory, Reality.REAL)
        for number, place in enumerate(places):
            progress("places", laboratory * len(places) + number, laboratories * len(places))
            readings[number].append(_read_place(stand, float(place), shots, number))
    rows = [
        _row(still, place, shots, laboratory_readings)
        for place, laboratory_readings in zip(places, readings, strict=True)
    ]
    return PercussionStudy(bat=still.session.bat, percussion_in=float(centre / INCH), rows=rows)


def _row(
    still: _Stand, place: float, shots: int, readings_of_laboratories: list[LaboratoryReading]
) -> PositionReadings:
    """Return the row of a position: nominal values, and errors of the laboratories."""
    (reduced, _), true, lasted = still.fire(place, shots, 0)
    laboratory = still.laboratory
    body, ball = laboratory.specimen.bat.body, laboratory.specimen.balls.mean_ball()
    beam = beam_of(body)
    axis = beam.length - laboratory.rules.spec.pivot_from_knob
    speed = laboratory.rules.spec.ball_speed
    impulse = float(ball.mass[0] * speed * (1 + true[0]))
    percussed = beam.inertia(axis) / (beam.mass * (axis - beam.z_cm))
    reaction = impulse * (1 - (axis - place) / percussed)
    smooth = still.counting_finely()
    as_installed, plain, loose = (
        smooth.fire(place, 2, 0, **bearing)[0][0].shots.recoil_efficiency[0]
        for bearing in ({}, {"friction": 0.09}, {"clearance": 0.2e-3})  # rolling, plain, loose [m]
    )

    def readings(name: str) -> ReadError:
        error = float((getattr(reduced.shots, READINGS[name]) - true).mean())
        return ReadError(
            bias=error if np.isfinite(error) else None,
            rms_error=_root_mean_square([each.error[name] for each in readings_of_laboratories]),
            rms_u=_root_mean_square([each.u[name] for each in readings_of_laboratories]),
        )

    return PositionReadings(
        impact_position_in=float(place / INCH),
        collision_efficiency=float(true[0]),
        reaction_ns=reaction,
        reaction_n=reaction / float(lasted[0]),
        ring_mrad=1e3 * _ring(still, place),
        rebounds_detected=float(np.mean([each.detected for each in readings_of_laboratories])),
        recoil=readings("recoil"),
        rebound=readings("rebound"),
        plain_shift=float(plain - as_installed),
        loose_shift=float(loose - as_installed),
    )


def _ring(still: _Stand, place: float) -> float:
    """Return the amplitude of the vibration at the axis [rad], root sum square over the modes."""
    from virtual_lab.simulation.collision.scene import Scenes

    laboratory = still.laboratory
    body, ball = laboratory.specimen.bat.body, laboratory.specimen.balls.spec
    axis = body.length - laboratory.rules.spec.pivot_from_knob
    model = laboratory.specimen.collision(body, Pinned(axis))
    speed = laboratory.rules.spec.ball_speed
    scenes = Scenes.with_ball(ball, impact_position=np.array([place]), relative_speed=speed)
    hit, modes = model.collide(scenes), model.modes
    bends = slice(modes.rigid, None)
    swing = np.hypot(
        hit.modal_displacements[0, bends],
        hit.modal_velocities[0, bends] / modes.angular_frequencies[bends],
    )
    return float(np.linalg.norm(modes.rotation(axis)[bends] * swing))


def _read_place(stand: _Stand, place: float, shots: int, number: int) -> LaboratoryReading:
    """Return error and stated u of the mean of the shots of a laboratory at a position."""
    (reduced, readings), true, _ = stand.fire(place, shots, number)
    errors = {name: getattr(reduced.shots, field) - true for name, field in READINGS.items()}
    finite_errors = {name: error[np.isfinite(error)] for name, error in errors.items()}
    return LaboratoryReading(
        detected=finite_errors["rebound"].size / shots,
        error={
            name: float(error.mean()) if error.size else np.nan
            for name, error in finite_errors.items()
        },
        u={
            name: _u_of_mean(reduced, readings, field, errors[name])
            for name, field in READINGS.items()
        },
    )


def _u_of_mean(reduced: Reduction, readings: ImpactReadings, field: str, error: Array) -> float:
    """Return the standard uncertainty of the mean of the shots with a reading.

    It combines the uncertainties of the constants and the scatter of the readings about the true
    e_A of each shot. The scatter of the true values is not included. The result is NaN for fewer
    than two readings.
    """
    detected = np.isfinite(error)
    many = int(detected.sum())
    if many < 2:
        return np.nan

    variants = Variants.of(reduced.constants)
    columns = variants.columns
    shots = reduced.model(readings).shots(columns, bat_properties(columns))
    parts = variants.components(getattr(shots, field)[..., detected].mean(axis=-1))
    hits, weights = error[None, detected], np.full((1, many), 1 / many)
    scatter = Scatter.of_hits(hits, weights, np.zeros((1, many)), np.zeros((1, 0, many)))
    mean = hits.mean(axis=1)
    return float(
        combine_components(mean, parts + type_a_component(HITS, mean, scatter.u, scatter.dof)).u[0]
    )


def _root_mean_square(values: list[float]) -> float | None:
    finite = np.array(values)[np.isfinite(values)]
    return float(np.sqrt((finite**2).mean())) if finite.size else None


def _text(rows: Sequence[PositionReadings], percussion_in: float) -> str:
    """Return a table of the positions, and sentences on the largest errors."""
    near = min(rows, key=lambda row: abs(row.impact_position_in - percussion_in))
    worst = max(rows, key=lambda row: abs(row.plain_shift))
    loose = max(rows, key=lambda row: abs(row.loose_shift))
    far = rows[-1]
    missed_at = [f"{row.impact_position_in:.3g}" for row in rows if row.rebounds_detected < 0.5]
    words = [
        f"At the center of percussion, {percussion_in:.2f} in, the impulse on the "
        f"axis is {near.reaction_ns:+.2f} N s. At {worst.impact_position_in:.3g} in it is "
        f"{worst.reaction_ns:+.2f} N s, and a plain bearing shifts e_A by recoil by "
        f"{worst.plain_shift:+.1e}, which is "
        f"{abs(worst.plain_shift) / (worst.recoil.rms_u or nan):.2f} of its u.",
        f"A loose bearing shifts e_A by {loose.loose_shift:+.1e} at "
        f"{loose.impact_position_in:.2f} in and by {far.loose_shift:+.0e} at "
        f"{far.impact_position_in:.3g} in. The clearance changes the "
        "angle and not the rate, except close to the center of percussion, where no force "
        "takes up the clearance.",
    ]
    if missed_at:
        words.append(f"The gates miss most rebounds at {', '.join(missed_at)} in.")
    return (
        f"e_A by recoil and by rebound: error without randomness; rms error and u with randomness\n"
        f"{table_text(rows)}\n\n" + "\n".join(words)
    )
